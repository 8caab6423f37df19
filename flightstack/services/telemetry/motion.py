"""Messages of attitude, position, velocity and actuators, packed without pymavlink.

Those that are sent most often are tables of ``MotionValues`` (``CONTENTS``), the others functions of the status.
"""

from __future__ import annotations

import math

from flightstack.core.contract import LoopRow, Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import int32, whole
from flightstack.mavlink.link import Message
from flightstack.mavlink.packed import Packing
from flightstack.services.telemetry.fields import NAN, boot_ms
from flightstack.services.telemetry.sensors import pose_and_twist_covariance, reset_counter
from flightstack.vehicle.status import VehicleStatus, in_single_precision

RPM_PER_RAD_S = 60.0 / (2.0 * math.pi)
UNKNOWN_COVARIANCE = [NAN, *[0.0] * 20]
UNKNOWN_SATELLITES = 255

ACTUATOR_OUTPUT_STATUS = Packing("ACTUATOR_OUTPUT_STATUS")
ESC_STATUS = Packing("ESC_STATUS")
GPS_RAW_INT = Packing("GPS_RAW_INT")
ODOMETRY = Packing("ODOMETRY")
POSITION_TARGET_GLOBAL_INT = Packing("POSITION_TARGET_GLOBAL_INT")
PACKINGS = tuple(value for value in globals().values() if isinstance(value, Packing))

CONTENTS: dict[str, tuple[str, ...]] = {
    "ALTITUDE": (
        "time_us", "altitude_m", "altitude_m", "above_origin_m", "above_home_m", "unknown", "unknown",
    ),
    "ATTITUDE": ("boot_ms", "euler", "rates"),
    "ATTITUDE_QUATERNION": ("boot_ms", "attitude", "rates"),
    "ATTITUDE_TARGET": ("boot_ms", "zero", "target_attitude", "target_rates", "target_thrust"),
    "GLOBAL_POSITION_INT": (
        "boot_ms", "latitude_1e7", "longitude_1e7", "altitude_mm", "above_home_mm", "velocity_cm_s", "heading_cdeg",
    ),
    "LOCAL_POSITION_NED": ("boot_ms", "position", "velocity"),
    "POSITION_TARGET_LOCAL_NED": ("boot_ms", "local_ned", "zero", "setpoint"),
    "SERVO_OUTPUT_RAW": ("time_32_us", "zero", "pulses"),
    "VFR_HUD": ("ground_speed", "ground_speed", "heading_deg", "throttle", "altitude_m", "climb"),
}  # fmt: skip
"""Values of the messages that are sent most often, by the names of ``MotionValues`` in the order of declaration.

ALTITUDE: terrain is unknown. ATTITUDE_TARGET: attitude and thrust commanded by the outer loop, and the reference rates.
SERVO_OUTPUT_RAW: rotor speed commands as pulses, 1000 µs (stopped) to 2000 µs (maximum speed).
"""


def position_target_global(f: VehicleStatus) -> Message:
    """POSITION_TARGET_GLOBAL_INT."""
    s = f.setpoint
    point = f.info.frame.to_geo(Vector3(*s[:3]))
    return POSITION_TARGET_GLOBAL_INT(
        boot_ms(f), mavlink.MAV_FRAME_GLOBAL_INT, 0,
        int32(point.latitude_deg * 1e7), int32(point.longitude_deg * 1e7), point.altitude_m, *s[3:],
    )  # fmt: skip


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


def actuator_output(f: VehicleStatus) -> Message:
    """ACTUATOR_OUTPUT_STATUS: rotor speed commands, 0 to 1 of the maximum speed."""
    shares = _command_shares(f)
    return ACTUATOR_OUTPUT_STATUS(f.time_us, (1 << len(shares)) - 1, *shares)
