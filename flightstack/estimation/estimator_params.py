"""Parameters of the filter."""

from __future__ import annotations

from typing import NamedTuple


class EstimatorParams(NamedTuple):
    """Noise, gates and delays of the filter; SI units, 1σ. ``*_noise_*`` are the least noise of a measurement."""

    # process
    gyro_noise: float = 0.0008  # rad/s/√Hz
    accel_noise: float = 0.012  # m/s²/√Hz
    imu_noise_share: float = 0.1
    """Share of the measured noise of the IMU that counts at the start."""
    gyro_bias_walk: float = 3e-4  # rad/s/√s
    accel_bias_walk: float = 1e-3  # m/s²/√s
    earth_field_walk: float = 1e-4  # gauss/√s
    body_field_walk: float = 2e-3  # gauss/√s
    wind_walk: float = 0.05  # m/s/√s
    baro_walk: float = 0.03  # m/√s
    # initial uncertainty
    tilt_rad: float = 0.05
    gyro_bias_rad_s: float = 0.02
    accel_bias_m_s2: float = 0.1
    earth_field_gauss: float = 0.005
    field_scale: float = 0.1
    """Error of the magnetometer's scale, which the filter counts as an error of the Earth's field along itself."""
    body_field_gauss: float = 0.01
    declination_rad: float = 0.35
    """Error of a declination that is not known."""
    # GNSS
    gnss_delay_s: float = 0.11
    gnss_velocity_noise_m_s: float = 0.05
    gnss_position_noise_m: float = 0.1
    gnss_bias_share: float = 0.7
    """Share of the accuracy stated by the receiver that is a slow error, a Gauss–Markov process."""
    gnss_bias_s: float = 60.0
    """Correlation time of that error."""
    gnss_velocity_gate: float = 5.0
    gnss_position_gate: float = 5.0
    # without GNSS
    hold_noise_m: float = 5.0
    hold_velocity_m_s: float = 3.0
    """Uncertainty of the horizontal velocity above which the filter holds its position."""
    # barometer, range finder
    baro_delay_s: float = 0.0
    baro_noise_m: float = 0.1
    baro_largest_noise_m: float = 3.5
    baro_gate: float = 5.0
    range_delay_s: float = 0.005
    range_noise_m: float = 0.1
    range_gate: float = 5.0
    # magnetometer
    mag_delay_s: float = 0.0
    mag_noise_gauss: float = 0.005
    mag_largest_noise_gauss: float = 0.05
    mag_gate: float = 3.0
    mag_corrects_tilt: float = 0.0
    # at rest
    rest_velocity_noise_m_s: float = 0.02
    rest_rate_noise_rad_s: float = 0.006
    # timing
    delay_s: float = 0.12
    """Age of the state of the filter; measurements older than this are fused late."""
    sensor_period_s: float = 0.02
    """Least time between two measurements of magnetometer, barometer or range finder; samples between are averaged."""
    period_s: float = 0.008
    """Least time between two predictions of the filter."""
    output_s: float = 0.0
    """Time constant with which the output follows the filter; 0 follows at once."""
    reset_s: float = 7.0
    """Time without an accepted GNSS position or velocity after which the filter is reset to GNSS."""
    gravity_m_s2: float = 9.80665


PARAMS_SIZE = len(EstimatorParams._fields)


class GnssLimits(NamedTuple):
    """Accuracy that a GNSS fix must have before the filter starts to use the receiver."""

    eph_m: float = 3.0
    epv_m: float = 5.0
    speed_accuracy_m_s: float = 0.5
    satellites: float = 6
