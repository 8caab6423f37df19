"""Telemetry: each message once per poll, of one status, and the streams of a link with their rates. No I/O.

Rates count simulated time and are limited to the same rate on the link clock: at 50 times real time a client gets 50
ATTITUDE messages per second of wall time, not 2500. At real time, and on an in-memory link, both clocks agree. A
vehicle that was late and runs several ticks at once sends what was due in each of them, up to half a second's: that
much also comes at once when a slow simulation becomes a fast one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Set

from flightstack.core.errors import TargetError
from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Message
from flightstack.services.telemetry import modes, motion, vehicle
from flightstack.services.telemetry.fields import euler_rad, wrapped
from flightstack.services.telemetry.sensors import SENSED
from flightstack.vehicle.status import VehicleStatus

M = mavlink

MAKERS: dict[int, Callable[[VehicleStatus], Message]] = {
    M.MAVLINK_MSG_ID_HEARTBEAT: vehicle.heartbeat,
    M.MAVLINK_MSG_ID_SYS_STATUS: vehicle.sys_status,
    M.MAVLINK_MSG_ID_SYSTEM_TIME: vehicle.system_time,
    M.MAVLINK_MSG_ID_GPS_RAW_INT: motion.gps_raw,
    M.MAVLINK_MSG_ID_ATTITUDE: motion.attitude,
    M.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: motion.attitude_quaternion,
    M.MAVLINK_MSG_ID_LOCAL_POSITION_NED: motion.local_position,
    M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: motion.global_position,
    M.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: motion.servo_output,
    M.MAVLINK_MSG_ID_MISSION_CURRENT: vehicle.mission_current,
    M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: vehicle.origin,
    M.MAVLINK_MSG_ID_VFR_HUD: motion.vfr_hud,
    M.MAVLINK_MSG_ID_ATTITUDE_TARGET: motion.attitude_target,
    M.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: motion.position_target,
    M.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: motion.position_target_global,
    M.MAVLINK_MSG_ID_ALTITUDE: motion.altitude,
    M.MAVLINK_MSG_ID_BATTERY_STATUS: vehicle.battery_status,
    M.MAVLINK_MSG_ID_AUTOPILOT_VERSION: vehicle.autopilot_version,
    M.MAVLINK_MSG_ID_FENCE_STATUS: vehicle.fence_status,
    M.MAVLINK_MSG_ID_ESTIMATOR_STATUS: vehicle.estimator_status,
    M.MAVLINK_MSG_ID_HOME_POSITION: vehicle.home_position,
    M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: vehicle.extended_state,
    M.MAVLINK_MSG_ID_FLIGHT_INFORMATION: vehicle.flight_information,
    EscStatus.id: motion.esc_status,
    M.MAVLINK_MSG_ID_PROTOCOL_VERSION: vehicle.protocol_version,
    M.MAVLINK_MSG_ID_ODOMETRY: motion.odometry,
    M.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: motion.actuator_output,
    M.MAVLINK_MSG_ID_CURRENT_MODE: modes.current_mode,
    M.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: modes.available_modes_monitor,
}
"""Constructors of the messages that depend on the status alone, by message id."""

STREAMED = frozenset({*MAKERS, FS_LOOP_TIMING_ID})
"""Messages that can be sent at a rate."""
SENSOR_STREAMED = STREAMED | SENSED.keys()
"""The same for a vehicle that flies on its sensors."""
_GLOBAL = frozenset(
    {
        M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        M.MAVLINK_MSG_ID_HOME_POSITION,
    }
)
"""Messages of places on earth, which a vehicle on its sensors does not know before its first fix."""
_REQUESTED = frozenset({M.MAVLINK_MSG_ID_AVAILABLE_MODES, M.MAVLINK_MSG_ID_MISSION_ITEM_REACHED})
"""Further messages on request."""

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


class Telemetry:
    """Builds each message once per poll and tick, for all links."""

    def __init__(
        self,
        status: Callable[[], VehicleStatus],
        time_us: Callable[[], int],
        loop_timing: Callable[[], Message],
        has_sensors: bool = False,
    ) -> None:
        """``has_sensors`` is true if the vehicle flies on its sensors: the status then has ``sensed``."""
        self.has_sensors = has_sensors
        self.streamed = SENSOR_STREAMED if has_sensors else STREAMED
        """Messages that can be sent at a rate."""
        self._status_of_now = status
        self._time_us = time_us
        self._loop_timing = loop_timing
        self._status: VehicleStatus | None = None
        self._made: dict[int, tuple[Message, ...]] = {}
        euler_rad(1.0, 0.0, 0.0, 0.0)  # compile now and not at the first message

    def is_available(self, message_id: int) -> bool:
        """Return True if the message can be requested."""
        return message_id in self.streamed or message_id in _REQUESTED

    def begin_poll(self) -> None:
        """Discard the status and the messages of the last poll."""
        self._status = None
        self._made.clear()

    @property
    def status(self) -> VehicleStatus:
        """The status in this poll."""
        if self._status is None:
            self._status = self._status_of_now()
        return self._status

    @property
    def time_us(self) -> int:
        """Vehicle time of the newest tick."""
        return self._time_us()

    @property
    def boot_ms(self) -> int:
        """Vehicle time for the field ``time_boot_ms``."""
        return wrapped(self.time_us // 1000)

    def messages(self, message_id: int) -> tuple[Message, ...]:
        """Return a message of ``streamed``, as of this tick: ticks may come between two parts of a poll."""
        if self._status is not None and self._status.time_us != self._time_us():
            self.begin_poll()
        made = self._made.get(message_id)
        if made is None:
            made = self._made[message_id] = self._make(message_id)
        return made

    def requested(self, message_id: int, argument: float = 0.0) -> tuple[Message, ...]:
        """Return an available message as of now; ``argument`` is the second parameter of REQUEST_MESSAGE.

        Before the first reached item there is no MISSION_ITEM_REACHED.
        """
        if message_id == M.MAVLINK_MSG_ID_AVAILABLE_MODES:
            return tuple(modes.available_modes(argument))
        self.begin_poll()
        if message_id == M.MAVLINK_MSG_ID_MISSION_ITEM_REACHED:
            return vehicle.item_reached(self.status)
        return self.messages(message_id)

    def farewell(self) -> Message:
        """Return the final HEARTBEAT with MAV_STATE_POWEROFF, of the last status if the target is lost."""
        last = self._status
        self.begin_poll()
        try:
            last = self.status
        except TargetError:
            if last is None:
                raise
        return vehicle.heartbeat(last, leaving=True)

    def _make(self, message_id: int) -> tuple[Message, ...]:
        sensed = self.status.sensed
        if sensed is not None:
            if (sensor_maker := SENSED.get(message_id)) is not None:
                return sensor_maker(self.status, sensed)
            if message_id in _GLOBAL and not sensed.has_origin:
                return ()
        maker = MAKERS.get(message_id)
        if maker is None:
            return (self._loop_timing(),)
        if message_id == EscStatus.id and self.status.info.rotors > 4:  # one message holds four rotors
            return (motion.esc_status(self.status), motion.esc_status(self.status, 4))
        return (maker(self.status),)


def default_rates_hz(is_api: bool, has_sensors: bool) -> dict[int, float]:
    """Return the default rates of a link, that of companions and scripts or that of a ground station."""
    if has_sensors:
        return SENSOR_API_RATES_HZ if is_api else SENSOR_GROUND_RATES_HZ
    return API_RATES_HZ if is_api else GROUND_RATES_HZ


class _Stream:
    """A streamed message, due at ``vehicle_s`` on the vehicle clock and ``link_s`` on the link clock."""

    __slots__ = ("interval_s", "link_s", "message_id", "vehicle_s")

    def __init__(self, message_id: int, interval_s: float) -> None:
        self.message_id = message_id
        self.interval_s = interval_s
        self.vehicle_s = self.link_s = -math.inf

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
        self._streams = {message_id: _Stream(message_id, 1.0 / rate) for message_id, rate in rates_hz.items()}
        self._soonest_s = -math.inf

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
            self._streams[message_id] = _Stream(message_id, 1.0 / self._default[message_id])
        elif interval_us <= 0:
            self._streams.pop(message_id, None)
        else:
            self._streams[message_id] = _Stream(message_id, interval_us * 1e-6)
        self._soonest_s = -math.inf
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

    def idle_s(self, vehicle_s: float) -> float:
        """Return the time for which nothing is due, from the time ``vehicle_s`` of the last call of ``due`` [s]."""
        return self._soonest_s - vehicle_s

    def due(self, telemetry: Telemetry, link_now_s: float) -> list[Message]:
        """Return the messages that are due on both the vehicle clock and the link clock."""
        now_s = telemetry.time_us * 1e-6
        until_s = now_s + ROUNDING_S
        due: list[Message] = []
        if until_s < self._soonest_s:
            return due
        soonest_s = math.inf
        for stream in self._streams.values():
            vehicle_s = stream.vehicle_s
            if until_s >= vehicle_s and link_now_s >= stream.link_s:
                stream.sent(now_s, link_now_s)
                vehicle_s = stream.vehicle_s
                due += telemetry.messages(stream.message_id)
            if vehicle_s < soonest_s:  # noqa: PLR1730  # ``min`` takes three times as long
                soonest_s = vehicle_s
        self._soonest_s = soonest_s
        return due
