"""The messages of telemetry, each made from what the vehicle knows. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Protocol

from flightstack import __version__
from flightstack.contract import FloatArray, LoopRow, Vector3
from flightstack.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Message
from flightstack.modes import CUSTOM_MODE, Mode

NAN = math.nan
RPM_PER_RAD_S = 60.0 / (2.0 * math.pi)
STATUSTEXT_SIZE = 50
_SINGLE_LIMIT = 1e18
"""Beyond this a number counts as infinite: single-precision fields, and their products, must hold it."""


class VehicleFacts(Protocol):
    """What telemetry reads."""

    state: FloatArray
    setpoint: FloatArray
    attitude_target: FloatArray
    max_thrust_n: float
    system_id: int
    rotors: int
    home: GeoPoint
    frame: LocalFrame

    @property
    def time_us(self) -> int:
        """Time of the newest tick."""
        ...

    @property
    def armed(self) -> bool:
        """Whether the vehicle is armed."""
        ...

    @property
    def mode(self) -> Mode:
        """The mode."""
        ...

    @property
    def landed(self) -> bool:
        """Whether the vehicle stands on the ground."""
        ...

    @property
    def climbing(self) -> bool:
        """Whether a takeoff is under way."""
        ...

    @property
    def descending(self) -> bool:
        """Whether a landing is under way."""
        ...

    @property
    def mission_current(self) -> int:
        """Number of the current item."""
        ...

    @property
    def mission_count(self) -> int:
        """Number of items."""
        ...

    @property
    def mission_state(self) -> int:
        """MISSION_STATE of the common dialect."""
        ...

    @property
    def can_arm(self) -> bool:
        """Whether an arm command would be accepted."""
        ...

    @property
    def has_state(self) -> bool:
        """Whether a state has ever arrived."""
        ...

    @property
    def row(self) -> FloatArray:
        """The newest row of the inner loop, shape (48,)."""
        ...

    @property
    def loop_timing(self) -> Callable[[], Message]:
        """Makes FS_LOOP_TIMING."""
        ...


def euler(q: list[float]) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a quaternion w, x, y, z (plain Python: telemetry needs no compiled code)."""
    w, x, y, z = q
    sin_pitch = min(1.0, max(-1.0, 2.0 * (w * y - z * x)))
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(sin_pitch),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def _whole(value: float, low: int, high: int) -> int:
    """Round into an integer field; what is not finite becomes 0."""
    return max(low, min(high, round(value))) if math.isfinite(value) else 0


def _floats(array: FloatArray) -> list[float]:
    """Return the values for fields of single precision, which not every double fits."""
    values: list[float] = array.tolist()
    if any(abs(value) > _SINGLE_LIMIT for value in values):
        return [math.copysign(math.inf, v) if abs(v) > _SINGLE_LIMIT else v for v in values]
    return values


def _int16(value: float) -> int:
    return _whole(value, -32768, 32767)


def _int32(value: float) -> int:
    return _whole(value, -(2**31), 2**31 - 1)


def boot_ms(f: VehicleFacts) -> int:
    """Time since boot in the 32-bit field that wraps."""
    return (f.time_us // 1000) & 0xFFFFFFFF


def heartbeat(f: VehicleFacts, leaving: bool = False) -> Message:
    """HEARTBEAT."""
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_HIL_ENABLED
    base |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    if f.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    system = mavlink.MAV_STATE_ACTIVE if f.armed else mavlink.MAV_STATE_STANDBY
    if leaving:
        system = mavlink.MAV_STATE_POWEROFF
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, base, CUSTOM_MODE[f.mode], system, 3
    )


def _attitude(f: VehicleFacts) -> Message:
    x = _floats(f.state)
    return mavlink.MAVLink_attitude_message(boot_ms(f), *euler(x[6:10]), *x[10:13])


def _attitude_quaternion(f: VehicleFacts) -> Message:
    return mavlink.MAVLink_attitude_quaternion_message(boot_ms(f), *_floats(f.state)[6:13])


def _attitude_target(f: VehicleFacts) -> Message:
    target = _floats(f.attitude_target)
    rates = _floats(f.row[LoopRow.REFERENCE_RATES])
    thrust = min(1.0, max(0.0, target[4] / f.max_thrust_n)) if math.isfinite(target[4]) else 0.0
    return mavlink.MAVLink_attitude_target_message(boot_ms(f), 0, target[:4], *rates, thrust)


def _local_position(f: VehicleFacts) -> Message:
    return mavlink.MAVLink_local_position_ned_message(boot_ms(f), *_floats(f.state)[:6])


def _position_target(f: VehicleFacts) -> Message:
    s = _floats(f.setpoint)
    return mavlink.MAVLink_position_target_local_ned_message(boot_ms(f), mavlink.MAV_FRAME_LOCAL_NED, 0, *s)


def _global_position(f: VehicleFacts) -> Message:
    x = _floats(f.state)
    point = f.frame.to_geo(Vector3(*x[:3]))
    heading = math.degrees(euler(x[6:10])[2]) % 360.0 if math.isfinite(x[6]) else 0.0
    return mavlink.MAVLink_global_position_int_message(
        boot_ms(f),
        _int32(point.latitude_deg * 1e7),
        _int32(point.longitude_deg * 1e7),
        _int32(point.altitude_m * 1e3),
        _int32(-x[2] * 1e3),
        *(_int16(v * 100.0) for v in x[3:6]),
        _whole(heading * 100.0, 0, 35999),
    )


def _esc_status(f: VehicleFacts, first: int = 0) -> Message:
    speeds = f.row[LoopRow.ROTOR_SPEED].tolist()[first : first + 4]
    rpm = [_int32(speed * RPM_PER_RAD_S) for speed in speeds]
    return EscStatus(first, f.time_us, rpm, [NAN] * 4, [NAN] * 4)


def _vfr_hud(f: VehicleFacts) -> Message:
    x = _floats(f.state)
    speed = math.hypot(x[3], x[4])
    heading = math.degrees(euler(x[6:10])[2]) % 360.0 if math.isfinite(x[6]) else 0.0
    throttle = 100.0 * float(f.row[LoopRow.WRENCH_ACHIEVED][0]) / f.max_thrust_n
    return mavlink.MAVLink_vfr_hud_message(
        speed, speed, _int16(heading), _whole(throttle, 0, 100), f.home.altitude_m - x[2], -x[5]
    )


def _extended_state(f: VehicleFacts) -> Message:
    landed = mavlink.MAV_LANDED_STATE_IN_AIR
    if f.landed:
        landed = mavlink.MAV_LANDED_STATE_ON_GROUND
    elif f.climbing:
        landed = mavlink.MAV_LANDED_STATE_TAKEOFF
    elif f.descending:
        landed = mavlink.MAV_LANDED_STATE_LANDING
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def _mission_current(f: VehicleFacts) -> Message:
    # a finished mission's current item would be one past its last
    current = min(f.mission_current, max(0, f.mission_count - 1))
    mission_mode = 1 if f.mode is Mode.MISSION else 2
    return mavlink.MAVLink_mission_current_message(current, f.mission_count, f.mission_state, mission_mode)


def _sys_status(f: VehicleFacts) -> Message:
    present = (
        mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
        | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
        | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
        | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
        | mavlink.MAV_SYS_STATUS_SENSOR_GPS
        | mavlink.MAV_SYS_STATUS_AHRS
        | mavlink.MAV_SYS_STATUS_GEOFENCE
    )
    present |= mavlink.MAV_SYS_STATUS_PREARM_CHECK
    healthy = present if f.has_state else 0
    if not f.can_arm:
        healthy &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    no_battery = (0xFFFF, -1, -1)  # voltage, current, remaining: not known
    return mavlink.MAVLink_sys_status_message(present, present, healthy, 0, *no_battery, 0, 0, 0, 0, 0, 0)


def _system_time(f: VehicleFacts) -> Message:
    return mavlink.MAVLink_system_time_message(0, boot_ms(f))


def _home(f: VehicleFacts) -> Message:
    home = f.home
    return mavlink.MAVLink_home_position_message(
        _int32(home.latitude_deg * 1e7),
        _int32(home.longitude_deg * 1e7),
        _int32(home.altitude_m * 1e3),
        0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], NAN, NAN, NAN, f.time_us,
    )  # fmt: skip


def _origin(f: VehicleFacts) -> Message:
    home = f.home
    return mavlink.MAVLink_gps_global_origin_message(
        _int32(home.latitude_deg * 1e7),
        _int32(home.longitude_deg * 1e7),
        _int32(home.altitude_m * 1e3),
        f.time_us,
    )


def autopilot_version(f: VehicleFacts) -> Message:
    """AUTOPILOT_VERSION: what this vehicle can do, and which version of the stack it runs."""
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    version = major << 24 | minor << 16 | patch << 8
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, version, 0, 0, 0, nothing, nothing, nothing, 0, 0, f.system_id
    )


def status_texts(severity: int, text: str) -> Iterator[Message]:
    """STATUSTEXT, in chunks of 50 octets when it is longer; the last chunk is the one that is not full."""
    octets = text.encode("utf-8")
    if len(octets) <= STATUSTEXT_SIZE:
        yield mavlink.MAVLink_statustext_message(severity, octets, 0, 0)
        return
    identity = 1 + sum(octets) % 0xFFFF
    for chunk, start in enumerate(range(0, len(octets) + 1, STATUSTEXT_SIZE)):
        part = octets[start : start + STATUSTEXT_SIZE]
        yield mavlink.MAVLink_statustext_message(severity, part, identity, chunk)


MAKERS: dict[int, Callable[[VehicleFacts], Message]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: _attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: _attitude_target,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _local_position,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: _position_target,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
    EscStatus.id: _esc_status,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _extended_state,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: _mission_current,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: _home,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: _origin,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    FS_LOOP_TIMING_ID: lambda f: f.loop_timing(),
}


def messages(message_id: int, f: VehicleFacts) -> Iterator[Message]:
    """Yield a message of ``MAKERS`` as it is now: two of ESC_STATUS, which holds four rotors, for more."""
    yield MAKERS[message_id](f)
    if message_id == EscStatus.id and f.rotors > 4:
        yield _esc_status(f, 4)
