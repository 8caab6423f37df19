"""Messages of sensors and estimator, for a vehicle that flies on its sensors. Units and contents follow PX4's."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.portable_math import atan2, distance
from flightstack.estimation.estimator_report import CONTROL, SOLUTION
from flightstack.estimation.motion_covariance import upper_triangle
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.sensor_samples import (
    BaroSample,
    GnssFix,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.mavlink.link import Message
from flightstack.mavlink.packed import Packing
from flightstack.services.telemetry.fields import NAN, wrapped
from flightstack.vehicle.status import VehicleStatus, in_single_precision

STANDARD_GRAVITY_M_S2 = 9.80665
MILLIGAUSS = MILLIRADIANS = 1e3
UNKNOWN_DILUTION = UNKNOWN_SPEED = 0xFFFF
LATE_S = 0.1
"""Age from which a measurement is no longer marked as updated in HIGHRES_IMU."""
SILENT_S = 1.0
GNSS_SILENT_S = 2.0
"""Age of its newest measurement from which a sensor is unhealthy."""
WIDEST_MM = 0xFFFFFFFF

GPS_RAW_INT = Packing("GPS_RAW_INT")
HIGHRES_IMU = Packing("HIGHRES_IMU")
LOCAL_POSITION_NED_COV = Packing("LOCAL_POSITION_NED_COV")
PACKINGS = (GPS_RAW_INT, HIGHRES_IMU, LOCAL_POSITION_NED_COV)

_ACCEL_GYRO = (
    mavlink.HIGHRES_IMU_UPDATED_XACC | mavlink.HIGHRES_IMU_UPDATED_YACC | mavlink.HIGHRES_IMU_UPDATED_ZACC
    | mavlink.HIGHRES_IMU_UPDATED_XGYRO | mavlink.HIGHRES_IMU_UPDATED_YGYRO | mavlink.HIGHRES_IMU_UPDATED_ZGYRO
)  # fmt: skip
_MAG = mavlink.HIGHRES_IMU_UPDATED_XMAG | mavlink.HIGHRES_IMU_UPDATED_YMAG | mavlink.HIGHRES_IMU_UPDATED_ZMAG
_BARO = (
    mavlink.HIGHRES_IMU_UPDATED_ABS_PRESSURE
    | mavlink.HIGHRES_IMU_UPDATED_PRESSURE_ALT
    | mavlink.HIGHRES_IMU_UPDATED_TEMPERATURE
)
_NOWHERE = Vector3(0.0, 0.0, 0.0)
_NO_MAG = MagSample(-math.inf, _NOWHERE)
_NO_BARO = BaroSample(-math.inf, 0.0, 0.0, 0.0)


def _less(a: Vector3, b: Vector3) -> tuple[float, float, float]:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _us(time_s: float) -> int:
    return round(time_s * 1e6)


def _ms(time_s: float) -> int:
    return wrapped(_us(time_s) // 1000)


def highres_imu(_f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """HIGHRES_IMU: the newest measurements less the estimated biases; none before the first measurement."""
    samples, bias = sensed.samples, sensed.nominal
    imu, mag, baro = samples.imu, samples.mag or _NO_MAG, samples.baro or _NO_BARO
    if imu is None:
        return ()
    updated = 0
    for bits, sample in ((_ACCEL_GYRO, imu), (_MAG, mag), (_BARO, baro)):
        if sensed.time_s - sample.time_s < LATE_S:
            updated |= bits
    return (
        HIGHRES_IMU(
            _us(imu.time_s),
            *_less(imu.accel_frd_m_s2, bias.accel_bias_m_s2),
            *_less(imu.gyro_frd_rad_s, bias.gyro_bias_rad_s),
            *(_less(mag.field_frd_gauss, bias.body_field_frd_gauss) if mag is not _NO_MAG else _NOWHERE),
            baro.pressure_hpa, 0.0, baro.pressure_altitude_m, baro.temperature_c, updated,
        ),
    )  # fmt: skip


def scaled_imu(_f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """SCALED_IMU: the newest measurements in mG, mrad/s and mgauss, with their biases."""
    imu, mag = sensed.samples.imu, sensed.samples.mag or _NO_MAG
    if imu is None:
        return ()
    return (
        mavlink.MAVLink_scaled_imu_message(
            _ms(imu.time_s),
            *(int16(value / STANDARD_GRAVITY_M_S2 * 1e3) for value in imu.accel_frd_m_s2),
            *(int16(value * MILLIRADIANS) for value in imu.gyro_frd_rad_s),
            *(int16(value * MILLIGAUSS) for value in mag.field_frd_gauss),
        ),
    )


def scaled_pressure(_f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """SCALED_PRESSURE of the barometer."""
    baro = sensed.samples.baro
    if baro is None:
        return ()
    return (
        mavlink.MAVLink_scaled_pressure_message(
            _ms(baro.time_s), baro.pressure_hpa, 0.0, int16(baro.temperature_c * 100.0)
        ),
    )


def gps_raw(_f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """GPS_RAW_INT as the receiver reports it, also while the estimator refuses its measurements."""
    gnss, now_s = sensed.samples.gnss, sensed.time_s
    if gnss is None or now_s - gnss.time_s > GNSS_SILENT_S:
        return (GPS_RAW_INT(_us(now_s), mavlink.GPS_FIX_TYPE_NO_GPS, 0, 0, 0, *[UNKNOWN_SPEED] * 4, 0),)
    north, east, _ = gnss.velocity_ned_m_s
    course_deg = math.degrees(atan2(east, north)) % 360.0 if math.isfinite(north + east) else 0.0
    altitude_mm = int32(gnss.altitude_msl_m * 1e3)
    speed = distance(north, east) * 100.0
    return (
        GPS_RAW_INT(
            _us(gnss.time_s), gnss.fix_type, int32(gnss.latitude_deg * 1e7), int32(gnss.longitude_deg * 1e7),
            altitude_mm, UNKNOWN_DILUTION, UNKNOWN_DILUTION,
            whole(speed, 0, UNKNOWN_SPEED - 1) if math.isfinite(speed) else UNKNOWN_SPEED,
            whole(course_deg * 100.0, 0, 35999), gnss.satellites, altitude_mm,
            _millimetres(gnss.eph_m), _millimetres(gnss.epv_m), _millimetres(gnss.speed_accuracy_m_s),
        ),
    )  # fmt: skip


def _millimetres(value: float) -> int:
    """Return an accuracy [mm]; 0 if it is unknown."""
    return whole(value * 1e3, 0, WIDEST_MM)


def vibration(f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """VIBRATION with PX4's contents: coning [rad²], change of the rates [rad/s] and of the specific force [m/s²]."""
    found = sensed.vibration
    return (
        mavlink.MAVLink_vibration_message(
            f.time_us, found.coning_rad2, found.gyro_rad_s, found.accel_m_s2, 0, 0, 0
        ),
    )


def wind_cov(f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """WIND_COV; none while the wind is not observed."""
    if not sensed.report.wind_is_observed:
        return ()
    wind, variance = sensed.nominal, sum(sensed.wind_variances)
    return (
        mavlink.MAVLink_wind_cov_message(
            f.time_us, wind.wind_north_m_s, wind.wind_east_m_s, NAN, variance, NAN, NAN,
            math.sqrt(abs(variance)), NAN,
        ),
    )  # fmt: skip


def estimator_status(f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """ESTIMATOR_STATUS: flags, ratios of innovations to their gates, and accuracies [1σ]."""
    report = sensed.report
    return (
        mavlink.MAVLink_estimator_status_message(
            f.time_us, int(report.solution), report.velocity_ratio, report.position_ratio,
            report.height_ratio, report.field_ratio, report.range_ratio, NAN,
            report.horizontal_accuracy_m, report.vertical_accuracy_m,
        ),
    )  # fmt: skip


def pose_and_twist_covariance(f: VehicleStatus, sensed: Sensed) -> tuple[float, ...]:
    """Return both covariances of ODOMETRY, 21 values each."""
    attitude, velocity = Quaternion(*f.state[6:10]), Vector3(*f.state[3:6])
    pose, twist = sensed.pose_covariance(attitude), sensed.twist_covariance(attitude, velocity)
    return tuple(in_single_precision(upper_triangle(pose) + upper_triangle(twist)))


def reset_counter(sensed: Sensed) -> int:
    """Return the number of resets of the estimate, which ODOMETRY counts modulo 256."""
    return sensed.resets & 0xFF


def local_position_cov(f: VehicleStatus, sensed: Sensed) -> tuple[Message, ...]:
    """LOCAL_POSITION_NED_COV: position, velocity and acceleration, with their covariance."""
    imu, bias = sensed.samples.imu, sensed.nominal.accel_bias_m_s2
    if imu is None:
        return ()
    x = f.state
    attitude, force = Quaternion(*x[6:10]), Vector3(*_less(imu.accel_frd_m_s2, bias))
    north, east, down = _into_world(attitude, force)
    covariance = in_single_precision(upper_triangle(sensed.motion_covariance(attitude, force)))
    return (
        LOCAL_POSITION_NED_COV(
            f.time_us, mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT, *x[:6],
            *in_single_precision([north, east, down + STANDARD_GRAVITY_M_S2]), *covariance,
        ),
    )  # fmt: skip


def _into_world(q: Quaternion, v: Vector3) -> tuple[float, float, float]:
    w, x, y, z = q
    return (
        (1 - 2 * (y * y + z * z)) * v[0] + 2 * (x * y - w * z) * v[1] + 2 * (x * z + w * y) * v[2],
        2 * (x * y + w * z) * v[0] + (1 - 2 * (x * x + z * z)) * v[1] + 2 * (y * z - w * x) * v[2],
        2 * (x * z - w * y) * v[0] + 2 * (y * z + w * x) * v[1] + (1 - 2 * (x * x + y * y)) * v[2],
    )


_IMU = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
_Timed: TypeAlias = ImuSample | MagSample | BaroSample | GnssSample | RangeSample


def sensor_health(sensed: Sensed) -> tuple[int, int]:
    """Return the bits of MAV_SYS_STATUS_SENSOR of the sensors that are present, and of the healthy ones."""
    samples, now_s = sensed.samples, sensed.time_s
    present = healthy = mavlink.MAV_SYS_STATUS_AHRS | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    if not sensed.report.solution & SOLUTION.ATTITUDE:
        healthy &= ~mavlink.MAV_SYS_STATUS_AHRS
    for bits, sample, limit_s in _sensors(samples):
        if sample is None:
            continue
        present |= bits
        if now_s - sample.time_s < limit_s and not _is_without_fix(sample):
            healthy |= bits
    if sensed.imu_has_failed:
        healthy &= ~_IMU
    if not sensed.report.control & CONTROL.MAG_3D:
        healthy &= ~mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    return present, healthy


def _sensors(samples: NewestSamples) -> tuple[tuple[int, _Timed | None, float], ...]:
    return (
        (_IMU, samples.imu, SILENT_S),
        (mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG, samples.mag, SILENT_S),
        (mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE, samples.baro, SILENT_S),
        (mavlink.MAV_SYS_STATUS_SENSOR_GPS, samples.gnss, GNSS_SILENT_S),
        (mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION, samples.range, SILENT_S),
    )  # fmt: skip


def _is_without_fix(sample: _Timed) -> bool:
    return isinstance(sample, GnssSample) and sample.fix_type < GnssFix.FIX_3D


SENSED: dict[int, Callable[[VehicleStatus, Sensed], tuple[Message, ...]]] = {
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: estimator_status,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: highres_imu,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU: scaled_imu,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: scaled_pressure,
    mavlink.MAVLINK_MSG_ID_VIBRATION: vibration,
    mavlink.MAVLINK_MSG_ID_WIND_COV: wind_cov,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED_COV: local_position_cov,
}
"""Constructors of the messages of a vehicle that flies on its sensors, by message id."""
