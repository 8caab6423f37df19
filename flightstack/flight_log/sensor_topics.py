"""Topics of a vehicle that flies on its sensors: measurements and truth, with PX4's names and fields.

Each group has a trace of its own, whose rows are filled by ``fill_…``.
"""

from __future__ import annotations

import math

from flightstack.core.compiled import plain
from flightstack.core.contract import STATE_SIZE, FloatArray
from flightstack.estimation.sensor_feed import fix_row
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, MagSample, RangeSample
from flightstack.flight_log.sensor_rows import store_baro, store_gnss, store_mag
from flightstack.flight_log.topics import Field, Group, Heading, Topic
from flightstack.mavlink.dialect import mavlink

_DEVICE = 1
"""Device id of the only sensor of each kind."""


# ---------------------------------------------------------------------- measurements

IMU_GROUP = Group(
    "imu",
    7,
    (
        Topic(
            "sensor_combined",
            (
                Field("float", "gyro_rad", 3, 1),
                Field("uint32_t", "gyro_integral_dt", 0, 0),
                Field("int32_t", "accelerometer_timestamp_relative"),
                Field("float", "accelerometer_m_s2", 3, 4),
                Field("uint32_t", "accelerometer_integral_dt", 0, 0),
                Field("uint8_t", "accelerometer_clipping"),
                Field("uint8_t", "gyro_clipping"),
                Field("uint8_t", "accel_calibration_count"),
                Field("uint8_t", "gyro_calibration_count"),
            ),
        ),
    ),
)

MAG_GROUP = Group(
    "mag",
    4,
    (
        Topic(
            "vehicle_magnetometer",
            (
                Field("uint64_t", "timestamp_sample", 0, 0),
                Field("uint32_t", "device_id", default=_DEVICE),
                Field("float", "magnetometer_ga", 3, 1),
                Field("uint8_t", "calibration_count"),
            ),
        ),
    ),
)

BARO_GROUP = Group(
    "baro",
    5,
    (
        Topic(
            "vehicle_air_data",
            (
                Field("uint64_t", "timestamp_sample", 0, 0),
                Field("uint32_t", "baro_device_id", default=_DEVICE),
                Field("float", "baro_alt_meter", 0, 1),
                Field("float", "baro_temp_celcius", 0, 2),
                Field("float", "baro_pressure_pa", 0, 3),
                Field("float", "rho", 0, 4),
                Field("float", "eas2tas", default=1.0),
                Field("uint8_t", "calibration_count"),
            ),
        ),
    ),
)

GNSS_GROUP = Group(
    "gnss",
    14,
    (
        Topic(
            "vehicle_gps_position",
            (
                Field("uint64_t", "timestamp_sample", 0, 0),
                Field("double", "latitude_deg", 0, 1),
                Field("double", "longitude_deg", 0, 2),
                Field("double", "altitude_msl_m", 0, 3),
                Field("double", "altitude_ellipsoid_m", 0, 3),
                Field("uint32_t", "device_id", default=_DEVICE),
                Field("float", "s_variance_m_s", 0, 9),
                Field("float", "c_variance_rad", default=math.nan),
                Field("float", "eph", 0, 7),
                Field("float", "epv", 0, 8),
                Field("float", "hdop", default=math.nan),
                Field("float", "vdop", default=math.nan),
                Field("float", "vel_m_s", 0, 12),
                Field("float", "vel_n_m_s", 0, 4),
                Field("float", "vel_e_m_s", 0, 5),
                Field("float", "vel_d_m_s", 0, 6),
                Field("float", "cog_rad", 0, 13),
                Field("float", "heading", default=math.nan),
                Field("bool", "vel_ned_valid", default=1),
                Field("uint8_t", "fix_type", 0, 10),
                Field("uint8_t", "satellites_used", 0, 11),
            ),
        ),
    ),
)

RANGE_GROUP = Group(
    "range",
    2,
    (
        Topic(
            "distance_sensor",
            (
                Field("uint32_t", "device_id", default=_DEVICE),
                Field("float", "min_distance", default=0.0),
                Field("float", "max_distance", default=1000.0),
                Field("float", "current_distance", 0, 0),
                Field("int8_t", "signal_quality", 0, 1),
                Field("uint8_t", "orientation", default=mavlink.MAV_SENSOR_ROTATION_PITCH_270),
            ),
        ),
    ),
)


def fill_mag(row: FloatArray, sample: MagSample) -> None:
    """Fill a row of ``MAG_GROUP``."""
    plain(store_mag)(row, round(sample.time_s * 1e6), *sample.field_frd_gauss)


def fill_baro(row: FloatArray, sample: BaroSample) -> None:
    """Fill a row of ``BARO_GROUP``."""
    time_us = round(sample.time_s * 1e6)
    plain(store_baro)(row, time_us, sample.pressure_hpa, sample.pressure_altitude_m, sample.temperature_c)


def fill_gnss(row: FloatArray, sample: GnssSample) -> None:
    """Fill a row of ``GNSS_GROUP``."""
    plain(store_gnss)(row, round(sample.time_s * 1e6), fix_row(sample), sample.speed_accuracy_m_s)


def fill_range(row: FloatArray, sample: RangeSample) -> None:
    """Fill a row of ``RANGE_GROUP``; a quality of 0 is an invalid measurement."""
    row[0], row[1] = sample.distance_m, round(sample.quality * 100.0)


# ---------------------------------------------------------------------- truth


TRUTH_GROUP = Group(
    "truth",
    STATE_SIZE,
    (
        Topic("vehicle_attitude_groundtruth", (Field("float", "q", 4, 6),)),
        Topic("vehicle_angular_velocity_groundtruth", (Field("float", "xyz", 3, 10),)),
        Topic(
            "vehicle_local_position_groundtruth",
            (
                Field("double", "ref_lat"),
                Field("double", "ref_lon"),
                Field("float", "x", 0, 0),
                Field("float", "y", 0, 1),
                Field("float", "z", 0, 2),
                Field("float", "vx", 0, 3),
                Field("float", "vy", 0, 4),
                Field("float", "vz", 0, 5),
                Field("float", "heading", 0, Heading(6)),
                Field("float", "ref_alt"),
                *(
                    Field("bool", name, default=1)
                    for name in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid", "xy_global", "z_global")
                ),
            ),
        ),
    ),
)
TRUTH_GLOBAL_GROUP = Group(
    "truth_global",
    3,
    (
        Topic(
            "vehicle_global_position_groundtruth",
            (Field("double", "lat", 0, 0), Field("double", "lon", 0, 1), Field("float", "alt", 0, 2)),
        ),
    ),
)
