"""Parameters of the filter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from flightstack.estimation.rings import IMU_ROWS
from flightstack.params.estimator import estimator_default, fields_of, horizon_s

_IMU_SPARE_ROWS = 16
"""Rows for the steps at both ends of the delay, and for steps up to a fifth shorter than their period."""


class EstimatorParams(NamedTuple):
    """Noise, gates and delays of the filter; SI units, 1σ. ``*_noise_*`` are the least noise of a measurement."""

    # process
    gyro_noise: float = estimator_default("gyro_noise")  # rad/s/√Hz
    accel_noise: float = estimator_default("accel_noise")  # m/s²/√Hz
    imu_noise_share: float = 0.1
    """Share of the measured noise of the IMU that counts at the start."""
    gyro_scale_error: float = 0.0035
    """Error of scale and alignment of the gyro, 1σ of each term."""
    gyro_bias_walk: float = estimator_default("gyro_bias_walk")  # rad/s/√s
    accel_bias_walk: float = estimator_default("accel_bias_walk")  # m/s²/√s
    earth_field_walk: float = estimator_default("earth_field_walk")  # gauss/√s
    body_field_walk: float = estimator_default("body_field_walk")  # gauss/√s
    wind_walk: float = estimator_default("wind_walk")  # m/s/√s
    baro_walk: float = 0.015  # m/√s
    baro_dynamic_share: float = 0.025
    """Share of the dynamic pressure that the barometer feels, 1σ."""
    gyro_range_rad_s: float = estimator_default("gyro_range_rad_s")
    accel_range_m_s2: float = estimator_default("accel_range_m_s2")
    # initial uncertainty
    tilt_rad: float = estimator_default("tilt_rad")
    gyro_bias_rad_s: float = estimator_default("gyro_bias_rad_s")
    accel_bias_m_s2: float = estimator_default("accel_bias_m_s2")
    earth_field_gauss: float = 0.003
    field_scale: float = 0.02
    """Error of the magnetometer's scale, which the filter counts as an error of the Earth's field along itself."""
    body_field_gauss: float = 0.005
    declination_rad: float = 0.35
    """Error of a declination that is not known."""
    # GNSS
    gnss_delay_s: float = estimator_default("gnss_delay_s")
    gnss_velocity_noise_m_s: float = estimator_default("gnss_velocity_noise_m_s")
    gnss_position_noise_m: float = estimator_default("gnss_position_noise_m")
    gnss_bias_share: float = 0.7
    """Share of the accuracy stated by the receiver that is a slow error, a Gauss–Markov process."""
    gnss_bias_s: float = 60.0
    """Correlation time of that error."""
    gnss_velocity_gate: float = estimator_default("gnss_velocity_gate")
    gnss_position_gate: float = estimator_default("gnss_position_gate")
    # without GNSS
    hold_noise_m: float = 5.0
    hold_velocity_m_s: float = 3.0
    """Uncertainty of the horizontal velocity above which the filter holds its position."""
    # barometer, range finder
    baro_delay_s: float = estimator_default("baro_delay_s")
    baro_noise_m: float = estimator_default("baro_noise_m")
    baro_largest_noise_m: float = 3.5
    baro_gate: float = estimator_default("baro_gate")
    range_delay_s: float = estimator_default("range_delay_s")
    range_noise_m: float = estimator_default("range_noise_m")
    range_gate: float = estimator_default("range_gate")
    # drag
    drag_is_fused: float = estimator_default("drag_is_fused")
    drag_variance: float = estimator_default("drag_variance")  # (m/s²)²
    ballistic_x_kg_m2: float = estimator_default("ballistic_x_kg_m2")
    ballistic_y_kg_m2: float = estimator_default("ballistic_y_kg_m2")
    momentum_drag_1_s: float = estimator_default("momentum_drag_1_s")
    # magnetometer
    mag_delay_s: float = estimator_default("mag_delay_s")
    mag_noise_gauss: float = estimator_default("mag_noise_gauss")
    mag_largest_noise_gauss: float = 0.05
    mag_gate: float = estimator_default("mag_gate")
    mag_corrects_tilt: float = 0.0
    wind_m_s: float = 5.0
    # at rest
    rest_velocity_noise_m_s: float = 0.02
    rest_rate_noise_rad_s: float = 0.003
    """The most by which a vehicle at rest sways."""
    # timing
    delay_s: float = horizon_s(
        estimator_default("period_s"), gnss_delay_s, baro_delay_s, range_delay_s, mag_delay_s
    )
    """Age of the state of the filter; measurements older than this are fused late."""
    sensor_period_s: float = 0.05
    """Least time between two measurements of magnetometer, barometer or range finder; samples between are averaged.
    PX4 has 0.067 and 0.05 (SENS_MAG_RATE, SENS_BARO_RATE)."""
    period_s: float = estimator_default("period_s")
    """Least time between two predictions of the filter."""
    output_s: float = estimator_default("output_s")
    """Time constant with which the output follows the filter; 0 follows at once."""
    reset_s: float = 7.0
    """Time without an accepted GNSS position or velocity after which the filter is reset to GNSS."""
    gyro_cutoff_hz: float = estimator_default("gyro_cutoff_hz")
    """Cutoff of the rates of the output; 0 for none."""
    gravity_m_s2: float = 9.80665


PARAMS_SIZE = len(EstimatorParams._fields)


class GnssLimits(NamedTuple):
    """Accuracy that a GNSS fix must have before the filter starts to use the receiver."""

    eph_m: float = estimator_default("eph_m")
    epv_m: float = estimator_default("epv_m")
    speed_accuracy_m_s: float = estimator_default("speed_accuracy_m_s")
    satellites: float = estimator_default("satellites")


def tuning_of(values: Mapping[str, float]) -> tuple[EstimatorParams, GnssLimits]:
    """Return the filter's parameters and GNSS limits from parameters by name (EKF2_…); the others have defaults.

    The period is extended where the steps within the longest delay would not fit into the filter's memory.
    """
    given: dict[str, Any] = fields_of(values)
    limits = GnssLimits()._replace(
        **{name: value for name, value in given.items() if name in GnssLimits._fields}
    )
    params = EstimatorParams()._replace(
        **{name: value for name, value in given.items() if name in EstimatorParams._fields}
    )
    averaged_s = params.baro_delay_s, params.range_delay_s, params.mag_delay_s
    delay_s = horizon_s(params.period_s, params.gnss_delay_s, *averaged_s)
    period_s = max(params.period_s, delay_s / (IMU_ROWS - _IMU_SPARE_ROWS))
    return params._replace(delay_s=delay_s, period_s=period_s), limits
