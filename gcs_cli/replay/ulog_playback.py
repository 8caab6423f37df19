"""The messages that a vehicle would have sent during the flight of a ULog. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geometry_bulk import euler_from_quaternions
from flightstack.mavlink.dialect import EscStatus, mavlink
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.mavlink.link import Address, Message
from flightstack.mavlink.param_values import value_message
from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs.motion import Motion, Samples, Source, elements, motion_of, samples
from gcs_cli.logs.recording import Recording
from gcs_cli.replay.logged_plans import LoggedPlans
from gcs_cli.replay.throttle import throttle_of

NAN = math.nan
_AUTO, _POSITION = 4, 3
PX4_MODES: Mapping[int, tuple[int, int]] = {
    0: (1, 0), 1: (2, 0), 2: (_POSITION, 0), 3: (_AUTO, 4), 4: (_AUTO, 3), 5: (_AUTO, 5), 10: (5, 0), 12: (_AUTO, 6),
    13: (10, 0), 14: (6, 0), 15: (7, 0), 17: (_AUTO, 2), 18: (_AUTO, 6), 19: (_AUTO, 8), 20: (_AUTO, 9),
    21: (_POSITION, 1), 22: (_AUTO, 10),
}  # fmt: skip
"""Main and sub mode of PX4's ``vehicle_status.nav_state``."""
_ARMED = 2
_MISSION = 3
"""``vehicle_status.nav_state`` of a mission."""
_NO_MISSION = 0xFFFF
_HEALTH = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_AHRS | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)  # fmt: skip
_FIX_3D = mavlink.GPS_FIX_TYPE_3D_FIX
_TYPES = range(1, 64)
_ROTORS = 4
"""Rotors in one ESC_STATUS."""
_RPM_PER_RAD_S = 30.0 / math.pi


class Stream(NamedTuple):
    """A message at a fixed rate; ``make`` returns None before the log has its data."""

    period_s: float
    make: Callable[[float], Message | None]


def parameter_messages(recording: Recording) -> Sequence[Message]:
    """Return PARAM_VALUE of all parameters, sorted by name."""
    parameters = sorted(recording.parameters.items())
    return [
        value_message(name, value, isinstance(value, int), index, len(parameters))
        for index, (name, value) in enumerate(parameters)
    ]


class UlogPlayback:
    """The flight of a ULog as telemetry: attitude, position, battery, mode, mission, texts, parameters."""

    def __init__(self, recording: Recording, plans: LoggedPlans | None = None) -> None:
        """``plans``: those of a tlog of the same flight; a ULog has the progress of the mission, not its items.

        Raise CliError (usage) if the log has neither attitude nor position.
        """
        self._log = recording
        self._motion: Motion = motion_of(recording)
        if self._motion.attitude.is_empty and self._motion.position.is_empty:
            raise CliError(f"{recording.source}: the log has no attitude and no position to replay", USAGE)
        self.vehicle = Address(*recording.vehicle)
        self.duration_s = recording.duration_s
        self._euler = Samples(
            self._motion.attitude.time_us, euler_from_quaternions(self._motion.attitude.values)
        )
        self._battery = self._read("battery_status", "voltage_v", "current_a", "remaining")
        self._status = self._read("vehicle_status", "nav_state", "arming_state")
        self._type = self._read("vehicle_status", "system_type")
        self._landed = self._read("vehicle_land_detected", "landed")
        self._plans = plans
        self._mission = self._read("mission_result", "seq_current", "seq_total", "seq_reached", "finished")
        self._throttle = throttle_of(recording)
        self._setpoint = self._read(
            "trajectory_setpoint", *elements("position", 3), *elements("velocity", 3), "yaw"
        )
        self._attitude_setpoint = self._read("vehicle_attitude_setpoint", *elements("q_d", 4))
        self._rotors = [
            self._read("rotor_speeds", *elements("speed_rad_s", first + _ROTORS)[first:])
            for first in (0, _ROTORS)
        ]
        self._streams = self._make_streams()
        self._reached = self._reached_items()
        self._text_s = np.array([recording.since_start_s(text.time_us) for text in recording.texts])
        self.parameters = parameter_messages(recording)

    def _make_streams(self) -> tuple[Stream, ...]:
        return (
            Stream(0.04, self._attitude),
            Stream(0.04, self._quaternion),
            Stream(0.1, self._local_position),
            Stream(0.1, self._global_position),
            Stream(0.1, self._attitude_target),
            Stream(0.1, self._position_target),
            *(Stream(0.2, partial(self._rotor_speeds, index)) for index in range(len(self._rotors))),
            Stream(0.2, self._hud),
            Stream(0.2, self._satellites),
            Stream(0.5, self._extended_state),
            Stream(1.0, self._sys_status),
            Stream(1.0, self._battery_status),
            Stream(1.0, self._mission_current),
            Stream(1.0, self._home),
            Stream(1.0, self._system_time),
        )

    def _read(self, topic: str, *fields: str) -> Samples:
        return samples(self._log, [Source(topic, fields)], len(fields), finite=False)

    # -- the interface of a playback

    def messages(self, begin_s: float, end_s: float) -> Iterable[Message]:
        """Return the messages of all streams, and texts."""
        due: list[tuple[float, int, Message]] = []
        for order, stream in enumerate(self._streams):
            first = math.floor(begin_s / stream.period_s) + 1
            for tick in range(first, math.floor(end_s / stream.period_s) + 1):
                message = stream.make(tick * stream.period_s)
                if message is not None:
                    due.append((tick * stream.period_s, order, message))
        first, last = np.searchsorted(self._text_s, (begin_s, end_s), side="right")
        for index in range(int(first), int(last)):
            text = self._log.texts[index]
            content = text.text.encode("ascii", "replace")[:50]
            message = mavlink.MAVLink_statustext_message(text.severity, content)
            due.append((float(self._text_s[index]), len(self._streams) + index, message))
        due += [(at_s, -1, message) for at_s, message in self._reached if begin_s < at_s <= end_s]
        return [message for *_, message in sorted(due, key=lambda entry: entry[:2])]

    def state(self, at_s: float) -> Sequence[Message]:
        """Return the newest message of each stream, and of the last reached item."""
        made = (stream.make(at_s) for stream in self._streams)
        reached = [message for reached_s, message in self._reached if reached_s <= at_s]
        return [*(message for message in made if message is not None), *reached[-1:]]

    def heartbeat(self, at_s: float) -> Message:
        """Return HEARTBEAT with PX4's mode."""
        nav_state, arming_state = self._at(self._status, at_s, (4.0, 1.0))
        main, sub = PX4_MODES.get(int(nav_state), (_AUTO, 3))
        armed = int(arming_state) == _ARMED
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED if main == _AUTO else 0
        state = mavlink.MAV_STATE_ACTIVE if armed else mavlink.MAV_STATE_STANDBY
        kind = int(self._at(self._type, at_s, (mavlink.MAV_TYPE_QUADROTOR,))[0])
        kind = kind if kind in _TYPES else mavlink.MAV_TYPE_QUADROTOR
        return mavlink.MAVLink_heartbeat_message(
            kind, mavlink.MAV_AUTOPILOT_PX4, base, main << 16 | sub << 24, state, 3
        )

    def version(self) -> Message | None:
        """Return AUTOPILOT_VERSION with the release in the log."""
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        )
        release = self._log.info.get("ver_sw_release")
        release = release if isinstance(release, int) else 0
        none = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            capabilities, whole(release, 0, 0xFFFF_FFFF), 0, 0, 0, none, none, none, 0, 0, 0
        )

    def plan(self, kind: int, at_s: float) -> Sequence[Message]:
        """Return the items of the last transfer in the tlog of the flight."""
        return () if self._plans is None else self._plans.at(kind, math.inf)

    # -- values

    def _time_us(self, at_s: float) -> float:
        return self._log.start_us + at_s * 1e6

    def _boot_ms(self, at_s: float) -> int:
        return round(self._time_us(at_s) * 1e-3) & 0xFFFF_FFFF

    def _known(self, found: Samples, at_s: float) -> FloatArray | None:
        """Return the newest sample; None before the first one."""
        index = int(np.searchsorted(found.time_us, self._time_us(at_s), side="right"))
        return found.values[index - 1] if index else None

    def _at(self, found: Samples, at_s: float, default: Sequence[float]) -> Sequence[float]:
        known = self._known(found, at_s)
        return default if known is None else known.tolist()

    def _altitudes_m(self, at_s: float) -> tuple[float, float]:
        """Return altitude above mean sea level and above home [m]; NaN where unknown."""
        above_sea = self._at(self._motion.geodetic, at_s, (NAN, NAN, NAN))[2]
        home = self._motion.home or self._motion.origin
        if home is not None:
            return above_sea, above_sea - home.altitude_m
        return above_sea, -self._at(self._motion.position, at_s, (NAN, NAN, NAN))[2]

    def _yaw_deg(self, at_s: float) -> float:
        return math.degrees(self._at(self._euler, at_s, (0.0, 0.0, NAN))[2]) % 360.0

    # -- messages

    def _attitude(self, at_s: float) -> Message | None:
        euler = self._known(self._euler, at_s)
        if euler is None:
            return None
        rates = self._at(self._motion.rates, at_s, (NAN, NAN, NAN))
        return mavlink.MAVLink_attitude_message(self._boot_ms(at_s), *euler.tolist(), *rates)

    def _quaternion(self, at_s: float) -> Message | None:
        q = self._known(self._motion.attitude, at_s)
        if q is None:
            return None
        rates = self._at(self._motion.rates, at_s, (NAN, NAN, NAN))
        return mavlink.MAVLink_attitude_quaternion_message(self._boot_ms(at_s), *q.tolist(), *rates)

    def _local_position(self, at_s: float) -> Message | None:
        position = self._known(self._motion.position, at_s)
        if position is None:
            return None
        velocity = self._at(self._motion.velocity, at_s, (NAN, NAN, NAN))
        return mavlink.MAVLink_local_position_ned_message(self._boot_ms(at_s), *position.tolist(), *velocity)

    def _global_position(self, at_s: float) -> Message | None:
        place = self._known(self._motion.geodetic, at_s)
        if place is None:
            return None
        latitude, longitude, _ = place.tolist()
        above_sea_m, above_home_m = self._altitudes_m(at_s)
        velocity = [int16(100.0 * speed) for speed in self._at(self._motion.velocity, at_s, (0.0, 0.0, 0.0))]
        yaw = self._yaw_deg(at_s)
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms(at_s), int32(1e7 * latitude), int32(1e7 * longitude), int32(1e3 * above_sea_m),
            int32(1e3 * above_home_m), *velocity, 0xFFFF if math.isnan(yaw) else whole(100.0 * yaw, 0, 35_999),
        )  # fmt: skip

    def _attitude_target(self, at_s: float) -> Message | None:
        q = self._known(self._attitude_setpoint, at_s)
        if q is None:
            return None
        return mavlink.MAVLink_attitude_target_message(self._boot_ms(at_s), 0, q.tolist(), NAN, NAN, NAN, NAN)

    def _position_target(self, at_s: float) -> Message | None:
        setpoint = self._known(self._setpoint, at_s)
        if setpoint is None:
            return None
        *motion, yaw = setpoint.tolist()
        frame = mavlink.MAV_FRAME_LOCAL_NED
        return mavlink.MAVLink_position_target_local_ned_message(
            self._boot_ms(at_s), frame, 0, *motion, NAN, NAN, NAN, yaw, NAN
        )

    def _rotor_speeds(self, index: int, at_s: float) -> Message | None:
        speeds = self._known(self._rotors[index], at_s)
        if speeds is None:
            return None
        rpm = [int32(_RPM_PER_RAD_S * speed) for speed in speeds.tolist()]
        return EscStatus(_ROTORS * index, round(self._time_us(at_s)), rpm, [NAN] * _ROTORS, [NAN] * _ROTORS)

    def _hud(self, at_s: float) -> Message | None:
        velocity = self._known(self._motion.velocity, at_s)
        if velocity is None:
            return None
        north, east, down = velocity.tolist()
        yaw, (above_sea_m, _) = self._yaw_deg(at_s), self._altitudes_m(at_s)
        heading = 0 if math.isnan(yaw) else whole(yaw, 0, 359)
        throttle = whole(100.0 * self._at(self._throttle, at_s, (0.0,))[0], 0, 100)
        speed = math.hypot(north, east)
        return mavlink.MAVLink_vfr_hud_message(NAN, speed, heading, throttle, above_sea_m, -down)

    def _satellites(self, at_s: float) -> Message | None:
        place = self._known(self._motion.geodetic, at_s)
        if place is None:
            return None
        latitude, longitude, altitude_m = place.tolist()
        return mavlink.MAVLink_gps_raw_int_message(
            round(self._time_us(at_s)), _FIX_3D, int32(1e7 * latitude), int32(1e7 * longitude),
            int32(1e3 * altitude_m), 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, 0xFF,
        )  # fmt: skip

    def _extended_state(self, at_s: float) -> Message | None:
        landed = self._known(self._landed, at_s)
        state = mavlink.MAV_LANDED_STATE_UNDEFINED
        if landed is not None:
            on_ground, in_air = mavlink.MAV_LANDED_STATE_ON_GROUND, mavlink.MAV_LANDED_STATE_IN_AIR
            state = on_ground if landed[0] else in_air
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, state)

    def _battery_fields(self, at_s: float) -> tuple[int, int, int]:
        """Return voltage [mV], current [cA] and charge [%], or MAVLink's values for unknown."""
        voltage, current, remaining = self._at(self._battery, at_s, (NAN, NAN, NAN))
        return (
            whole(1e3 * voltage, 0, 0xFFFE) if math.isfinite(voltage) else 0xFFFF,
            int16(100.0 * current) if math.isfinite(current) else -1,
            whole(100.0 * remaining, 0, 100) if math.isfinite(remaining) else -1,
        )

    def _sys_status(self, at_s: float) -> Message | None:
        return mavlink.MAVLink_sys_status_message(
            _HEALTH, _HEALTH, _HEALTH, 0, *self._battery_fields(at_s), 0, 0, 0, 0, 0, 0
        )

    def _battery_status(self, at_s: float) -> Message | None:
        if self._known(self._battery, at_s) is None:
            return None
        voltage, current, remaining = self._battery_fields(at_s)
        return mavlink.MAVLink_battery_status_message(
            0, mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO, 0x7FFF,
            [voltage, *[0xFFFF] * 9], current, -1, -1, remaining,
        )  # fmt: skip

    def _mission_current(self, at_s: float) -> Message | None:
        mission = self._known(self._mission, at_s)
        if mission is None:
            return None
        current, total, reached, finished = mission.tolist()
        nav_state, arming_state = self._at(self._status, at_s, (NAN, NAN))
        if not total:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif finished and (self._log.info.get("sys_name") == "flightstack" or reached >= total - 1):
            # of PX4 a takeoff, a return and a landing that have ended are finished, too
            state = mavlink.MISSION_STATE_COMPLETE
        elif nav_state == _MISSION and arming_state == _ARMED:
            state = mavlink.MISSION_STATE_ACTIVE
        else:
            state = mavlink.MISSION_STATE_PAUSED if reached >= 0 else mavlink.MISSION_STATE_NOT_STARTED
        return mavlink.MAVLink_mission_current_message(
            whole(current, 0, 0xFFFF), whole(total, 0, 0xFFFF) or _NO_MISSION, state
        )

    def _reached_items(self) -> list[tuple[float, Message]]:
        """Return time [s] and MISSION_ITEM_REACHED of each reached item."""
        numbers = self._mission.values[:, 2] if not self._mission.is_empty else np.zeros(0)
        changed = np.flatnonzero((numbers != np.append(-1.0, numbers[:-1])) & (numbers >= 0.0))
        return [
            (
                self._log.since_start_s(int(self._mission.time_us[index])),
                mavlink.MAVLink_mission_item_reached_message(whole(numbers[index], 0, 0xFFFF)),
            )
            for index in changed.tolist()
        ]

    def _home(self, at_s: float) -> Message | None:
        home = self._motion.home or self._motion.origin
        if home is None:
            return None
        return mavlink.MAVLink_home_position_message(
            int32(1e7 * home.latitude_deg), int32(1e7 * home.longitude_deg), int32(1e3 * home.altitude_m),
            0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], NAN, NAN, NAN,
        )  # fmt: skip

    def _system_time(self, at_s: float) -> Message | None:
        utc_us = 0 if self._log.epoch_us is None else round(self._log.epoch_us + self._time_us(at_s))
        return mavlink.MAVLink_system_time_message(max(0, utc_us), self._boot_ms(at_s))
