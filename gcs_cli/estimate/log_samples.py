"""Samples of sensors in a ULog of PX4, of versions 1.8 to 1.16, or of this flight stack."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray, Vector3
from flightstack.estimation.estimator_params import EstimatorParams, GnssLimits, tuning_of
from flightstack.estimation.sensor_samples import (
    BaroSample,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)
from flightstack.params.estimator import ESTIMATOR_SPECS
from gcs_cli.errors import CliError
from gcs_cli.logs.recording import Recording, Topic

Sample: TypeAlias = ImuSample | MagSample | BaroSample | GnssSample | RangeSample


class Landed(NamedTuple):
    """A report of the land detector."""

    time_s: float
    is_landed: bool


_ORDER: dict[type, int] = {ImuSample: 1, Landed: 2}
"""At equal times, measurements precede the IMU, whose step may fuse them, and the land detector, which reads the state,
comes last."""
DECLINATION = "EKF2_MAG_DECL"
_OF_SENSORS = (
    "EKF2_GPS_DELAY", "EKF2_MAG_DELAY", "EKF2_BARO_DELAY", "EKF2_RNG_DELAY",
    "EKF2_REQ_EPH", "EKF2_REQ_EPV", "EKF2_REQ_SACC", "EKF2_REQ_NSATS",
)  # fmt: skip
"""Parameters that describe the sensors of a vehicle, which hold for any filter."""
_STANDARD_PRESSURE_HPA = 1013.25
_IN_AIR_BIT = 1 << 7
"""``estimator_status.control_mode_flags`` of PX4."""
_LONGEST_IMU_STEP_S = 0.1
_ROUNDING_S = 1e-7
"""Difference of two times that is one of their rounding: the stated step is exact."""


def topic_of(log: Recording, *names: str) -> Topic | None:
    """Return the first of these topics that the log has, of its first instance."""
    topics = {topic.name: topic for topic in log.topics}
    return next((topics[name] for name in names if name in topics), None)


def times_s(topic: Topic, *, sampled: bool = True) -> FloatArray:
    """Return the times of measurement, or of publication where the log has no others."""
    stamps = topic.fields.get("timestamp_sample") if sampled else None
    if stamps is None or not len(stamps) or stamps[-1] <= 0:
        stamps = topic.time_us
    times: FloatArray = stamps.astype(np.float64) * 1e-6
    return times


def samples_of(log: Recording) -> list[Sample | Landed]:
    """Return all samples by time; raise CliError if the log has no IMU or no attitude reference."""
    imu = topic_of(log, "sensor_combined")
    if imu is None or imu.count < 2:
        raise CliError(f"{log.source}: the log has no topic sensor_combined: log the IMU (SDLOG_PROFILE)")
    found: list[Sample | Landed] = list(_imu_samples(imu))
    found += _mag_samples(log)
    found += _baro_samples(log)
    found += _gnss_samples(log)
    found += _range_samples(log)
    found += _landed(log)
    return sorted(found, key=lambda sample: (sample.time_s, _ORDER.get(type(sample), 0)))


def params_of(
    log: Recording, given: Mapping[str, float] = MappingProxyType({})
) -> tuple[EstimatorParams, GnssLimits, float]:
    """Return the filter's parameters, limits of GNSS, and declination [rad], NaN if unknown.

    A log of this flight stack gives all parameters, another one those of its sensors; ``given`` replaces them.
    """
    is_own = log.info.get("sys_name") == "flightstack"
    logged = {
        name: min(max(float(value), ESTIMATOR_SPECS[name].low), ESTIMATOR_SPECS[name].high)
        for name, value in log.parameters.items()
        if name in (ESTIMATOR_SPECS if is_own else _OF_SENSORS)
    }
    declination_deg = given.get(DECLINATION, log.parameters.get(DECLINATION, math.nan))
    return *tuning_of({**logged, **given}), math.radians(declination_deg)


def _rows(topic: Topic, names: list[str]) -> FloatArray | None:
    return topic.columns(names)


def _vectors(topic: Topic, name: str) -> FloatArray | None:
    return _rows(topic, [f"{name}[{axis}]" for axis in range(3)])


def _imu_samples(topic: Topic) -> Iterator[ImuSample]:
    times = times_s(topic, sampled=False)
    gyro, accel = _vectors(topic, "gyro_rad"), _vectors(topic, "accelerometer_m_s2")
    if gyro is None or accel is None:
        raise CliError("sensor_combined: the log lacks gyro_rad or accelerometer_m_s2")
    steps = np.diff(times, prepend=times[0] - np.median(np.diff(times)))
    if (stated := topic.fields.get("gyro_integral_dt")) is not None:
        stated_s = stated.astype(np.float64) * 1e-6
        steps = np.where(np.abs(steps - stated_s) < _ROUNDING_S, stated_s, steps)
    rows = zip(times.tolist(), steps.tolist(), gyro.tolist(), accel.tolist(), strict=True)
    for time_s, dt_s, rate, force in rows:
        if dt_s > 0.0 and all(map(math.isfinite, (*rate, *force))):
            yield ImuSample(time_s, min(dt_s, _LONGEST_IMU_STEP_S), Vector3(*rate), Vector3(*force))


def _mag_samples(log: Recording) -> Iterator[MagSample]:
    topic = topic_of(log, "vehicle_magnetometer")
    field = None if topic is None else _vectors(topic, "magnetometer_ga")
    if topic is None or field is None:
        topic = topic_of(log, "sensor_mag")
        field = None if topic is None else _rows(topic, ["x", "y", "z"])
        if topic is None or field is None:
            return
        field = field - [float(log.parameters.get(f"CAL_MAG0_{axis}OFF", 0.0)) for axis in "XYZ"]
        field = field * [float(log.parameters.get(f"CAL_MAG0_{axis}SCALE", 1.0)) for axis in "XYZ"]
    for time_s, values in zip(times_s(topic).tolist(), field.tolist(), strict=True):
        if all(map(math.isfinite, values)):
            yield MagSample(time_s, Vector3(*values))


def pressure_altitude_m(pressure_hpa: Any) -> Any:
    """Return the altitude in the standard atmosphere, up to 11 km (ISO 2533)."""
    return 44330.77 * (1.0 - (pressure_hpa / _STANDARD_PRESSURE_HPA) ** 0.190263)


def _baro_samples(log: Recording) -> Iterator[BaroSample]:
    topic = topic_of(log, "vehicle_air_data")
    if topic is not None and "baro_alt_meter" in topic.fields:
        altitude = topic.fields["baro_alt_meter"].astype(np.float64)
        pressure = topic.fields["baro_pressure_pa"].astype(np.float64) * 1e-2
        celsius = topic.fields.get("baro_temp_celcius", np.full(topic.count, math.nan))
    else:
        topic = topic_of(log, "sensor_baro")
        if topic is None or "pressure" not in topic.fields:
            return
        pressure = topic.fields["pressure"].astype(np.float64)
        pressure = np.where(pressure > 2000.0, pressure * 1e-2, pressure)  # Pa since 1.14
        altitude = pressure_altitude_m(pressure)
        celsius = topic.fields.get("temperature", np.full(topic.count, math.nan))
    rows = (times_s(topic), pressure, altitude, celsius.astype(np.float64))
    for row in zip(*(column.tolist() for column in rows), strict=True):
        if math.isfinite(row[2]):
            yield BaroSample(*row)


def _gnss_samples(log: Recording) -> Iterator[GnssSample]:
    topic = topic_of(log, "vehicle_gps_position", "sensor_gps")
    if topic is None:
        return
    fields = topic.fields
    names, factors = ("latitude_deg", "longitude_deg", "altitude_msl_m"), (1.0, 1.0, 1.0)
    if "latitude_deg" not in fields:
        names, factors = ("lat", "lon", "alt"), (1e-7, 1e-7, 1e-3)
    accuracies = ["eph", "epv", "s_variance_m_s", "fix_type", "satellites_used"]
    rows = _rows(topic, [*names, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s", *accuracies])
    if rows is None:
        return
    for time_s, row in zip(times_s(topic, sampled=False).tolist(), rows.tolist(), strict=True):
        latitude, longitude, altitude = (value * factor for value, factor in zip(row, factors, strict=False))
        if all(map(math.isfinite, row[:6])):
            yield GnssSample(
                time_s, latitude, longitude, altitude, Vector3(*row[3:6]),
                row[6], row[7], row[8], int(row[9]), int(row[10]),
            )  # fmt: skip


def _range_samples(log: Recording) -> Iterator[RangeSample]:
    topic = topic_of(log, "distance_sensor")
    if topic is None or "current_distance" not in topic.fields:
        return
    down = 25  # MAV_SENSOR_ROTATION_PITCH_270
    orientation = topic.fields.get("orientation", np.full(topic.count, down))
    quality = topic.fields.get("signal_quality", np.full(topic.count, -1))
    low, high = (
        topic.fields.get(name, np.full(topic.count, end))
        for name, end in (("min_distance", 0.0), ("max_distance", 1e3))
    )
    distance = topic.fields["current_distance"].astype(np.float64)
    good = (orientation == down) & (quality != 0) & (distance > low) & (distance < high)
    for time_s, distance_m, is_good in zip(
        times_s(topic).tolist(), distance.tolist(), good.tolist(), strict=True
    ):
        yield RangeSample(time_s, distance_m, float(is_good))


def _landed(log: Recording) -> Iterator[Landed]:
    sources: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
        ("vehicle_land_detected", "landed", lambda value: value > 0),
        ("estimator_status_flags", "cs_in_air", lambda value: value == 0),
        ("estimator_status", "control_mode_flags", lambda value: (value.astype(np.int64) & _IN_AIR_BIT) == 0),
    )
    for name, field, is_landed in sources:
        topic = topic_of(log, name)
        if topic is not None and field in topic.fields:
            states = is_landed(topic.fields[field]).tolist()
            yield from map(Landed, (topic.time_us * 1e-6).tolist(), states)
            return
