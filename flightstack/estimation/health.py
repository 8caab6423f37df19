"""Health of an estimate: what commander and arming checks need to know of it."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.contract import Record
from flightstack.estimation.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from flightstack.estimation.kalman import BARO, FUSED_S, GNSS_POSITION, GNSS_VELOCITY, MAG, TEST_RATIO
from flightstack.estimation.memory import ALIGNED
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.sensor_samples import GnssFix

SMOOTHING = 0.1
"""Share of the newest test ratio in its mean."""
_GYRO_BIAS_AT, _ACCEL_BIAS_AT = slice(GYRO_BIAS + 1, GYRO_BIAS + 4), slice(ACCEL_BIAS + 1, ACCEL_BIAS + 4)


class EstimateHealth(NamedTuple):
    """Health at one time. Ages are infinite without a measurement; deviations are 1σ; ratios are 1 at the gate."""

    aligned: bool
    has_origin: bool
    imu_age_s: float
    imu_is_stuck: bool
    mag_age_s: float
    baro_age_s: float
    fix_age_s: float
    """Time since the newest three-dimensional fix."""
    unaided_s: float
    """Time since the newest accepted horizontal position or velocity: that of dead reckoning."""
    refused_s: float
    """Time for which horizontal positions of GNSS have arrived and were refused."""
    horizontal_m: float
    velocity_m_s: float
    """Horizontal."""
    tilt_rad: float
    gyro_bias_rad_s: float
    accel_bias_m_s2: float
    velocity_ratio: float
    position_ratio: float
    height_ratio: float
    heading_ratio: float


NO_HEALTH = EstimateHealth(
    False, False, math.inf, False, math.inf, math.inf, math.inf, math.inf, 0.0, math.inf, math.inf,
    math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
)  # fmt: skip
_RATIOS_AT = EstimateHealth._fields.index("velocity_ratio")


def estimate_health(
    before: EstimateHealth, memory: Record, samples: NewestSamples, has_origin: bool, time_s: float
) -> EstimateHealth:
    """Return the health at ``time_s`` from the estimator's record; ``before`` is the last one, for the mean ratios."""
    rows = memory["observations"].tolist()
    variance = memory["covariance"].diagonal().tolist()
    nominal = memory["nominal"].tolist()
    horizon_s = float(memory["clock"][0])
    fused = [row[FUSED_S] for row in rows]
    position_s = min(fused[GNSS_POSITION : GNSS_POSITION + 2])
    velocity_s = min(fused[GNSS_VELOCITY : GNSS_VELOCITY + 2])
    fix_age_s, imu = _fix_age_s(samples, time_s), samples.imu
    groups = ((GNSS_VELOCITY, 3), (GNSS_POSITION, 2), (BARO, 1), (MAG, 3))
    ratios = (math.sqrt(max(row[TEST_RATIO] for row in rows[at : at + size])) for at, size in groups)
    means = (mean + SMOOTHING * (new - mean) for mean, new in zip(before[_RATIOS_AT:], ratios, strict=True))
    return EstimateHealth(
        bool(memory["flags"][ALIGNED]),
        has_origin,
        math.inf if imu is None else time_s - imu.time_s,
        samples.imu_track.repeats >= STUCK_SAMPLES,
        math.inf if samples.mag is None else time_s - samples.mag.time_s,
        math.inf if samples.baro is None else time_s - samples.baro.time_s,
        fix_age_s,
        horizon_s - max(position_s, velocity_s) if has_origin else math.inf,
        horizon_s - position_s if has_origin and fix_age_s < 1.0 else 0.0,
        math.sqrt(variance[POSITION] + variance[POSITION + 1]),
        math.sqrt(variance[VELOCITY] + variance[VELOCITY + 1]),
        math.sqrt(max(variance[ATTITUDE], variance[ATTITUDE + 1])),
        max(map(abs, nominal[_GYRO_BIAS_AT])),
        max(map(abs, nominal[_ACCEL_BIAS_AT])),
        *means,
    )


def _fix_age_s(samples: NewestSamples, time_s: float) -> float:
    gnss = samples.gnss
    return math.inf if gnss is None or gnss.fix_type < GnssFix.FIX_3D else time_s - gnss.time_s


STUCK_SAMPLES = 100
"""Equal successive samples of the inertial sensor after which it is stuck; PX4's limit. Noise changes the last bits."""
