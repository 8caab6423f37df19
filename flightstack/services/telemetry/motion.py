"""Messages of attitude, position, velocity and actuators, packed without pymavlink: they are sent most often."""

from __future__ import annotations

import math

from flightstack.core.contract import LoopRow, Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.mavlink.link import Message
from flightstack.mavlink.packed import Packing
from flightstack.services.telemetry.fields import NAN, boot_ms, euler_rad, heading_deg, wrapped
from flightstack.services.telemetry.sensors import pose_and_twist_covariance, reset_counter
from flightstack.vehicle.status import VehicleStatus, in_single_precision

RPM_PER_RAD_S = 60.0 / (2.0 * math.pi)
UNKNOWN_COVARIANCE = [NAN, *[0.0] * 20]
UNKNOWN_SATELLITES = 255

ACTUATOR_OUTPUT_STATUS = Packing("ACTUATOR_OUTPUT_STATUS")
ALTITUDE = Packing("ALTITUDE")
ATTITUDE = Packing("ATTITUDE")
ATTITUDE_QUATERNION = Packing("ATTITUDE_QUATERNION")
ATTITUDE_TARGET = Packing("ATTITUDE_TARGET")
ESC_STATUS = Packing("ESC_STATUS")
GLOBAL_POSITION_INT = Packing("GLOBAL_POSITION_INT")
GPS_RAW_INT = Packing("GPS_RAW_INT")
LOCAL_POSITION_NED = Packing("LOCAL_POSITION_NED")
ODOMETRY = Packing("ODOMETRY")
POSITION_TARGET_GLOBAL_INT = Packing("POSITION_TARGET_GLOBAL_INT")
POSITION_TARGET_LOCAL_NED = Packing("POSITION_TARGET_LOCAL_NED")
SERVO_OUTPUT_RAW = Packing("SERVO_OUTPUT_RAW")
VFR_HUD = Packing("VFR_HUD")
PACKINGS = tuple(value for value in globals().values() if isinstance(value, Packing))


def attitude(f: VehicleStatus) -> Message:
    """ATTITUDE."""
    x = f.state
    return ATTITUDE(boot_ms(f), *euler_rad(*x[6:10]), *x[10:13])


def attitude_quaternion(f: VehicleStatus) -> Message:
    """ATTITUDE_QUATERNION."""
    return ATTITUDE_QUATERNION(boot_ms(f), *f.state[6:13])


def attitude_target(f: VehicleStatus) -> Message:
    """ATTITUDE_TARGET: attitude and thrust commanded by the outer loop, and the reference rates."""
    target = f.attitude_target
    rates = in_single_precision(f.row[LoopRow.REFERENCE_RATES])
    thrust = min(1.0, max(0.0, target[4] / f.info.max_thrust_n)) if math.isfinite(target[4]) else 0.0
    return ATTITUDE_TARGET(boot_ms(f), 0, *target[:4], *rates, thrust)


def local_position(f: VehicleStatus) -> Message:
    """LOCAL_POSITION_NED."""
    return LOCAL_POSITION_NED(boot_ms(f), *f.state[:6])


def position_target(f: VehicleStatus) -> Message:
    """POSITION_TARGET_LOCAL_NED."""
    return POSITION_TARGET_LOCAL_NED(boot_ms(f), mavlink.MAV_FRAME_LOCAL_NED, 0, *f.setpoint)


def position_target_global(f: VehicleStatus) -> Message:
    """POSITION_TARGET_GLOBAL_INT."""
    s = f.setpoint
    point = f.info.frame.to_geo(Vector3(*s[:3]))
    return POSITION_TARGET_GLOBAL_INT(
        boot_ms(f), mavlink.MAV_FRAME_GLOBAL_INT, 0,
        int32(point.latitude_deg * 1e7), int32(point.longitude_deg * 1e7), point.altitude_m, *s[3:],
    )  # fmt: skip


def global_position(f: VehicleStatus) -> Message:
    """GLOBAL_POSITION_INT: altitude above the sea and above home."""
    x = f.state
    latitude_deg, longitude_deg, altitude_m = f.info.frame.to_geo(Vector3(*x[:3]))
    return GLOBAL_POSITION_INT(
        boot_ms(f),
        int32(latitude_deg * 1e7),
        int32(longitude_deg * 1e7),
        int32(altitude_m * 1e3),
        int32((altitude_m - f.home.altitude_m) * 1e3),
        int16(x[3] * 100.0),
        int16(x[4] * 100.0),
        int16(x[5] * 100.0),
        whole(heading_deg(x[6:10]) * 100.0, 0, 35999),
    )


def gps_raw(f: VehicleStatus) -> Message:
    """GPS_RAW_INT from the true position: a 3D fix while the state is good. Satellites are not simulated."""
    x = f.state
    point = f.info.frame.to_geo(Vector3(*x[:3]))
    fix = mavlink.GPS_FIX_TYPE_3D_FIX if f.state_is_good else mavlink.GPS_FIX_TYPE_NO_FIX
    course = math.degrees(math.atan2(x[4], x[3])) % 360.0 if math.isfinite(x[3] + x[4]) else 0.0
    altitude_mm = int32(point.altitude_m * 1e3)
    return GPS_RAW_INT(
        f.time_us, fix, int32(point.latitude_deg * 1e7), int32(point.longitude_deg * 1e7), altitude_mm,
        0xFFFF, 0xFFFF, whole(math.hypot(x[3], x[4]) * 100.0, 0, 0xFFFE), whole(course * 100.0, 0, 35999),
        UNKNOWN_SATELLITES, altitude_mm,
    )  # fmt: skip


def altitude(f: VehicleStatus) -> Message:
    """ALTITUDE. Terrain is unknown, so terrain altitude and clearance are NaN."""
    down_m = f.state[2]
    above_sea_m = f.info.frame.origin.altitude_m - down_m
    return ALTITUDE(f.time_us, above_sea_m, above_sea_m, -down_m, above_sea_m - f.home.altitude_m, NAN, NAN)


def odometry(f: VehicleStatus) -> Message:
    """ODOMETRY: pose in NED, velocity in the body frame FRD."""
    x, sensed = f.state, f.sensed
    if sensed is None:
        covariances = (*UNKNOWN_COVARIANCE, *UNKNOWN_COVARIANCE)
        resets, estimator = 0, mavlink.MAV_ESTIMATOR_TYPE_NAIVE
    else:
        covariances = pose_and_twist_covariance(f, sensed)
        resets, estimator = reset_counter(sensed), mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT
    return ODOMETRY(
        f.time_us, mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_FRD, *x[:3], *x[6:10],
        *in_single_precision(_into_body(x[6:10], x[3:6])), *x[10:13], *covariances,
        resets, estimator,
    )  # fmt: skip


def _into_body(q: list[float], v: list[float]) -> list[float]:
    """Rotate a world vector to the body frame, by the transposed rotation matrix of ``q``."""
    w, x, y, z = q
    return [
        (1 - 2 * (y * y + z * z)) * v[0] + 2 * (x * y + w * z) * v[1] + 2 * (x * z - w * y) * v[2],
        2 * (x * y - w * z) * v[0] + (1 - 2 * (x * x + z * z)) * v[1] + 2 * (y * z + w * x) * v[2],
        2 * (x * z + w * y) * v[0] + 2 * (y * z - w * x) * v[1] + (1 - 2 * (x * x + y * y)) * v[2],
    ]


def esc_status(f: VehicleStatus, first: int = 0) -> Message:
    """ESC_STATUS of four rotors, beginning with ``first``."""
    speeds = f.row[LoopRow.ROTOR_SPEED][first : first + 4]
    rpm = [int32(speed * RPM_PER_RAD_S) for speed in speeds]
    return ESC_STATUS(first, f.time_us, *rpm, *[NAN] * 8)


def _command_shares(f: VehicleStatus) -> list[float]:
    """Return rotor speed commands as fractions of the maximum speed, in the order of the vehicle file."""
    commands = f.row[LoopRow.ROTOR_COMMAND]
    shares = [command / top for command, top in zip(commands, f.info.top_speed_rad_s, strict=False)]
    return [min(1.0, share) if 0.0 < share < math.inf else 0.0 for share in shares]


def servo_output(f: VehicleStatus) -> Message:
    """SERVO_OUTPUT_RAW: rotor speed commands as pulses, 1000 µs (stopped) to 2000 µs (maximum speed)."""
    pulses = [1000 + round(1000.0 * share) for share in _command_shares(f)]
    return SERVO_OUTPUT_RAW(wrapped(f.time_us), 0, *pulses)


def actuator_output(f: VehicleStatus) -> Message:
    """ACTUATOR_OUTPUT_STATUS: rotor speed commands, 0 to 1 of the maximum speed."""
    shares = _command_shares(f)
    return ACTUATOR_OUTPUT_STATUS(f.time_us, (1 << len(shares)) - 1, *shares)


def vfr_hud(f: VehicleStatus) -> Message:
    """VFR_HUD."""
    x = f.state
    speed = math.hypot(x[3], x[4])
    throttle = 100.0 * f.row[LoopRow.WRENCH_ACHIEVED][0] / f.info.max_thrust_n
    above_sea_m = f.info.frame.origin.altitude_m - x[2]
    return VFR_HUD(speed, speed, int16(heading_deg(x[6:10])), whole(throttle, 0, 100), above_sea_m, -x[5])
