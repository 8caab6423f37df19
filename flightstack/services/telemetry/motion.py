"""Messages of attitude, position, velocity and actuators."""

from __future__ import annotations

import math

from flightstack.core.contract import LoopRow, Vector3
from flightstack.core.portable_math import euler_angles
from flightstack.mavlink.dialect import EscStatus, mavlink
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.mavlink.link import Message
from flightstack.services.telemetry.fields import NAN, boot_ms, floats, heading_deg, singles, wrapped
from flightstack.vehicle.status import VehicleStatus

RPM_PER_RAD_S = 60.0 / (2.0 * math.pi)
UNKNOWN_COVARIANCE = [NAN, *[0.0] * 20]
UNKNOWN_SATELLITES = 255


def attitude(f: VehicleStatus) -> Message:
    """ATTITUDE."""
    x = floats(f.state)
    return mavlink.MAVLink_attitude_message(boot_ms(f), *euler_angles(*x[6:10]), *x[10:13])


def attitude_quaternion(f: VehicleStatus) -> Message:
    """ATTITUDE_QUATERNION."""
    return mavlink.MAVLink_attitude_quaternion_message(boot_ms(f), *floats(f.state)[6:13])


def attitude_target(f: VehicleStatus) -> Message:
    """ATTITUDE_TARGET: attitude and thrust commanded by the outer loop, and the reference rates."""
    target = floats(f.attitude_target)
    rates = floats(f.row[LoopRow.REFERENCE_RATES])
    thrust = min(1.0, max(0.0, target[4] / f.info.max_thrust_n)) if math.isfinite(target[4]) else 0.0
    return mavlink.MAVLink_attitude_target_message(boot_ms(f), 0, target[:4], *rates, thrust)


def local_position(f: VehicleStatus) -> Message:
    """LOCAL_POSITION_NED."""
    return mavlink.MAVLink_local_position_ned_message(boot_ms(f), *floats(f.state)[:6])


def position_target(f: VehicleStatus) -> Message:
    """POSITION_TARGET_LOCAL_NED."""
    s = floats(f.setpoint)
    return mavlink.MAVLink_position_target_local_ned_message(boot_ms(f), mavlink.MAV_FRAME_LOCAL_NED, 0, *s)


def position_target_global(f: VehicleStatus) -> Message:
    """POSITION_TARGET_GLOBAL_INT."""
    s = floats(f.setpoint)
    point = f.info.frame.to_geo(Vector3(*s[:3]))
    return mavlink.MAVLink_position_target_global_int_message(
        boot_ms(f), mavlink.MAV_FRAME_GLOBAL_INT, 0,
        int32(point.latitude_deg * 1e7), int32(point.longitude_deg * 1e7), point.altitude_m, *s[3:],
    )  # fmt: skip


def global_position(f: VehicleStatus) -> Message:
    """GLOBAL_POSITION_INT: altitude above the sea and above home."""
    x = floats(f.state)
    point = f.info.frame.to_geo(Vector3(*x[:3]))
    return mavlink.MAVLink_global_position_int_message(
        boot_ms(f),
        int32(point.latitude_deg * 1e7),
        int32(point.longitude_deg * 1e7),
        int32(point.altitude_m * 1e3),
        int32((point.altitude_m - f.home.altitude_m) * 1e3),
        *(int16(v * 100.0) for v in x[3:6]),
        whole(heading_deg(x[6:10]) * 100.0, 0, 35999),
    )


def gps_raw(f: VehicleStatus) -> Message:
    """GPS_RAW_INT from the true position: a 3D fix while the state is good. Satellites are not simulated."""
    x = floats(f.state)
    point = f.info.frame.to_geo(Vector3(*x[:3]))
    fix = mavlink.GPS_FIX_TYPE_3D_FIX if f.state_is_good else mavlink.GPS_FIX_TYPE_NO_FIX
    course = math.degrees(math.atan2(x[4], x[3])) % 360.0 if math.isfinite(x[3] + x[4]) else 0.0
    altitude_mm = int32(point.altitude_m * 1e3)
    return mavlink.MAVLink_gps_raw_int_message(
        f.time_us, fix, int32(point.latitude_deg * 1e7), int32(point.longitude_deg * 1e7), altitude_mm,
        0xFFFF, 0xFFFF, whole(math.hypot(x[3], x[4]) * 100.0, 0, 0xFFFE), whole(course * 100.0, 0, 35999),
        UNKNOWN_SATELLITES, altitude_mm,
    )  # fmt: skip


def altitude(f: VehicleStatus) -> Message:
    """ALTITUDE. Terrain is unknown, so terrain altitude and clearance are NaN."""
    down_m = floats(f.state)[2]
    above_sea_m = f.info.frame.origin.altitude_m - down_m
    return mavlink.MAVLink_altitude_message(
        f.time_us, above_sea_m, above_sea_m, -down_m, above_sea_m - f.home.altitude_m, NAN, NAN
    )


def odometry(f: VehicleStatus) -> Message:
    """ODOMETRY: pose in NED, velocity in the body frame FRD."""
    x = floats(f.state)
    return mavlink.MAVLink_odometry_message(
        f.time_us, mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_FRD, *x[:3], x[6:10],
        *singles(_into_body(x[6:10], x[3:6])), *x[10:13], UNKNOWN_COVARIANCE, UNKNOWN_COVARIANCE,
        0, mavlink.MAV_ESTIMATOR_TYPE_NAIVE,
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
    speeds = f.row[LoopRow.ROTOR_SPEED].tolist()[first : first + 4]
    rpm = [int32(speed * RPM_PER_RAD_S) for speed in speeds]
    return EscStatus(first, f.time_us, rpm, [NAN] * 4, [NAN] * 4)


def _command_shares(f: VehicleStatus) -> list[float]:
    """Return rotor speed commands as fractions of the maximum speed, in the order of the vehicle file."""
    commands = f.row[LoopRow.ROTOR_COMMAND].tolist()
    shares = [command / top for command, top in zip(commands, f.info.top_speed_rad_s, strict=False)]
    return [min(1.0, max(0.0, share)) if math.isfinite(share) else 0.0 for share in shares]


def servo_output(f: VehicleStatus) -> Message:
    """SERVO_OUTPUT_RAW: rotor speed commands as pulses, 1000 µs (stopped) to 2000 µs (maximum speed)."""
    pulses = [1000 + round(1000.0 * share) for share in _command_shares(f)]
    pulses += [0] * (8 - len(pulses))
    return mavlink.MAVLink_servo_output_raw_message(wrapped(f.time_us), 0, *pulses)


def actuator_output(f: VehicleStatus) -> Message:
    """ACTUATOR_OUTPUT_STATUS: rotor speed commands, 0 to 1 of the maximum speed."""
    shares = _command_shares(f)
    return mavlink.MAVLink_actuator_output_status_message(
        f.time_us, (1 << len(shares)) - 1, shares + [0.0] * (32 - len(shares))
    )


def vfr_hud(f: VehicleStatus) -> Message:
    """VFR_HUD."""
    x = floats(f.state)
    speed = math.hypot(x[3], x[4])
    throttle = 100.0 * float(f.row[LoopRow.WRENCH_ACHIEVED][0]) / f.info.max_thrust_n
    above_sea_m = f.info.frame.origin.altitude_m - x[2]
    return mavlink.MAVLink_vfr_hud_message(
        speed, speed, int16(heading_deg(x[6:10])), whole(throttle, 0, 100), above_sea_m, -x[5]
    )
