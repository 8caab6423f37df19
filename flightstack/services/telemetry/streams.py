"""Streams of telemetry on a link, with their rates. No I/O.

Rates count simulated time and are limited to the same rate on the link clock: at 50 times real time a client gets 50
ATTITUDE messages per second of wall time, not 2500. At real time, and on an in-memory link, both clocks agree. A
vehicle that was late and runs several ticks at once sends what was due in each of them, up to half a second's: that
much also comes at once when a slow simulation becomes a fast one.
"""

from __future__ import annotations

import math
from collections.abc import Set
from itertools import groupby

from flightstack.mavlink.dialect import mavlink
from flightstack.services.telemetry.telemetry import MOTION, STREAMED

M = mavlink

LONGEST_INTERVAL_US = 2**31 - 1
"""Range of the field in MESSAGE_INTERVAL."""
CATCH_UP_S = 0.5
"""How far a stream may be behind on the link clock and still make up for it: as long as the simulator catches up."""
ROUNDING_S = 0.5e-6
"""Above the rounding of an hour's sum of intervals, below the resolution of the vehicle clock."""

# PX4's default rates on its two links in simulation, for the messages that this vehicle has. Messages that pymavlink's
# releases lack (ESC_STATUS, CURRENT_MODE, AVAILABLE_MODES_MONITOR, the project's dialect) are sent on request only:
# MAVProxy and scripts count each message that they cannot decode as a lost packet.
GROUND_RATES_HZ: dict[int, float] = {
    M.MAVLINK_MSG_ID_ATTITUDE: 50.0,
    M.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 50.0,
    M.MAVLINK_MSG_ID_ATTITUDE_TARGET: 50.0,
    M.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
    M.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 50.0,
    M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
    M.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 50.0,
    M.MAVLINK_MSG_ID_GPS_RAW_INT: 5.0,
    M.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
    M.MAVLINK_MSG_ID_MISSION_CURRENT: 2.0,
    M.MAVLINK_MSG_ID_ALTITUDE: 1.0,
    M.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    M.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    M.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
    M.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    M.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 0.5,
}
STANDARD_MODES_RATES_HZ: dict[int, float] = {
    M.MAVLINK_MSG_ID_CURRENT_MODE: 0.5,
    M.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: 0.3,
}
"""For clients that request AVAILABLE_MODES: they implement the standard modes protocol."""
API_RATES_HZ: dict[int, float] = {
    **GROUND_RATES_HZ,
    M.MAVLINK_MSG_ID_ATTITUDE: 100.0,
    M.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
    M.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 10.0,
    M.MAVLINK_MSG_ID_ATTITUDE_TARGET: 10.0,
    M.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 10.0,
    M.MAVLINK_MSG_ID_ODOMETRY: 30.0,
    M.MAVLINK_MSG_ID_ALTITUDE: 10.0,
    M.MAVLINK_MSG_ID_VFR_HUD: 10.0,
    M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
    M.MAVLINK_MSG_ID_MISSION_CURRENT: 5.0,
    M.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
}
SENSOR_GROUND_RATES_HZ: dict[int, float] = {
    **GROUND_RATES_HZ,
    M.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
    M.MAVLINK_MSG_ID_WIND_COV: 0.5,
    M.MAVLINK_MSG_ID_VIBRATION: 0.1,
}
SENSOR_API_RATES_HZ: dict[int, float] = {
    **API_RATES_HZ,
    M.MAVLINK_MSG_ID_HIGHRES_IMU: 50.0,
    M.MAVLINK_MSG_ID_WIND_COV: 10.0,
    M.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
    M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: 1.0,
    M.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
    M.MAVLINK_MSG_ID_VIBRATION: 0.5,
}
"""Rates of a vehicle that flies on its sensors."""
GROUPS: dict[int, tuple[int, ...]] = {
    M.MAV_DATA_STREAM_RAW_SENSORS: (
        M.MAVLINK_MSG_ID_GPS_RAW_INT,
        M.MAVLINK_MSG_ID_SCALED_IMU,
        M.MAVLINK_MSG_ID_SCALED_PRESSURE,
    ),
    M.MAV_DATA_STREAM_EXTENDED_STATUS: (
        M.MAVLINK_MSG_ID_SYS_STATUS,
        M.MAVLINK_MSG_ID_MISSION_CURRENT,
        M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    ),
    M.MAV_DATA_STREAM_RC_CHANNELS: (M.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,),
    M.MAV_DATA_STREAM_RAW_CONTROLLER: (M.MAVLINK_MSG_ID_ATTITUDE_TARGET,),
    M.MAV_DATA_STREAM_POSITION: (
        M.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    ),
    M.MAV_DATA_STREAM_EXTRA1: (
        M.MAVLINK_MSG_ID_ATTITUDE,
        M.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
        M.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
    ),
    M.MAV_DATA_STREAM_EXTRA2: (M.MAVLINK_MSG_ID_VFR_HUD,),
    M.MAV_DATA_STREAM_EXTRA3: (
        M.MAVLINK_MSG_ID_VIBRATION,
        M.MAVLINK_MSG_ID_SYSTEM_TIME,
        M.MAVLINK_MSG_ID_BATTERY_STATUS,
        M.MAVLINK_MSG_ID_ALTITUDE,
    ),
}
"""Message groups of REQUEST_DATA_STREAM, as in ArduPilot."""


def default_rates_hz(is_api: bool, has_sensors: bool) -> dict[int, float]:
    """Return the default rates of a link, that of companions and scripts or that of a ground station."""
    if has_sensors:
        return SENSOR_API_RATES_HZ if is_api else SENSOR_GROUND_RATES_HZ
    return API_RATES_HZ if is_api else GROUND_RATES_HZ


class _Stream:
    """Times of streamed messages: due at ``vehicle_s`` on the vehicle clock and ``link_s`` on the link clock."""

    __slots__ = ("interval_s", "link_s", "vehicle_s")

    def __init__(self, interval_s: float, vehicle_s: float = -math.inf, link_s: float = -math.inf) -> None:
        self.interval_s = interval_s
        self.vehicle_s, self.link_s = vehicle_s, link_s

    @property
    def times(self) -> tuple[float, float, float]:
        """The arguments of an equal stream."""
        return self.interval_s, self.vehicle_s, self.link_s

    def sent(self, now_s: float, link_now_s: float) -> None:
        """Compute the next due times. Keep the phase, unless a whole interval was missed."""
        interval_s = self.interval_s
        upcoming_s = self.vehicle_s + interval_s
        self.vehicle_s = upcoming_s if upcoming_s > now_s + ROUNDING_S else now_s + interval_s
        if self.link_s == -math.inf:  # half an interval: the two clocks are read at different instants
            self.link_s = link_now_s + 0.5 * interval_s
        else:
            self.link_s = max(self.link_s + interval_s, link_now_s - CATCH_UP_S)


class Streams:
    """The telemetry streams of one link."""

    def __init__(self, rates_hz: dict[int, float], available: Set[int] = STREAMED) -> None:
        """``available`` are the messages that can be streamed."""
        self._default = rates_hz
        self.available = available
        self._streams = {message_id: _Stream(1.0 / rate) for message_id, rate in rates_hz.items()}
        self._groups: list[tuple[_Stream, list[int], bool]] = []
        self._join()

    def _join(self) -> None:
        """Join successive messages of equal times to one stream: seven of ten messages are due together."""
        self._groups.clear()
        for times, members in groupby(
            list(self._streams), lambda message_id: self._streams[message_id].times
        ):
            joined, message_ids = _Stream(*times), list(members)
            self._groups.append((joined, message_ids, MOTION.issuperset(message_ids)))
            self._streams.update(dict.fromkeys(message_ids, joined))
        self._soonest_s = self._soonest_other_s = -math.inf

    def interval_us(self, message_id: int) -> int:
        """Return the interval of a message [µs]; −1 if it is not streamed, 0 if it is not supported."""
        if message_id in self._streams:
            return round(self._streams[message_id].interval_s * 1e6)
        return -1 if message_id in self.available else 0

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """Set an interval as SET_MESSAGE_INTERVAL defines (−1 stops, 0 is the default); return False if denied."""
        if message_id not in self.available or not -1 <= interval_us <= LONGEST_INTERVAL_US:  # True for NaN
            return False
        if interval_us == 0 and message_id in self._default:
            self._streams[message_id] = _Stream(1.0 / self._default[message_id])
        elif interval_us <= 0:
            self._streams.pop(message_id, None)
        else:
            self._streams[message_id] = _Stream(interval_us * 1e-6)
        self._join()
        return True

    def add_standard_modes(self) -> None:
        """Stream the messages of STANDARD_MODES_RATES_HZ that are not streamed yet."""
        for message_id, rate_hz in STANDARD_MODES_RATES_HZ.items():
            if message_id not in self._streams:
                self.set_interval(message_id, 1e6 / rate_hz)

    def set_group(self, group: int, rate_hz: float) -> None:
        """Set the rate of a MAV_DATA_STREAM group as REQUEST_DATA_STREAM defines; 0 stops it."""
        interval_us = 1e6 / rate_hz if rate_hz > 0.0 else -1.0
        members = [m for g in GROUPS.values() for m in g] if group == 0 else GROUPS.get(group, ())
        for message_id in members:
            self.set_interval(message_id, interval_us)

    def idle_s(self, vehicle_s: float, motion: bool = True) -> float:
        """Return the time for which nothing is due, from the time ``vehicle_s`` of the last call of ``due`` [s].

        Without ``motion``, nothing but messages of the motion.
        """
        return (self._soonest_s if motion else self._soonest_other_s) - vehicle_s

    def due(self, now_s: float, link_now_s: float) -> list[int]:
        """Return the messages that are due on both the vehicle clock and the link clock, by their ids."""
        until_s = now_s + ROUNDING_S
        due: list[int] = []
        if until_s < self._soonest_s:
            return due
        soonest_s = soonest_other_s = math.inf
        for stream, message_ids, is_motion in self._groups:
            vehicle_s = stream.vehicle_s
            if until_s >= vehicle_s and link_now_s >= stream.link_s:
                stream.sent(now_s, link_now_s)
                vehicle_s = stream.vehicle_s
                due += message_ids
            if vehicle_s < soonest_s:  # noqa: PLR1730  # ``min`` takes three times as long
                soonest_s = vehicle_s
            if vehicle_s < soonest_other_s and not is_motion:
                soonest_other_s = vehicle_s
        self._soonest_s, self._soonest_other_s = soonest_s, soonest_other_s
        return due
