"""Accumulation of raw IMU samples to steps of the filter, with coning and sculling, and the noise of the samples."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import (
    cross,
    normalised,
    quaternion_product,
    rotate,
    rotation_over,
    rotation_vector,
)
from flightstack.estimation.error_state import read_vector, scaled, write_vector
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.prediction import DeltaSample, ImuNoise

SUMS_SIZE = 64
"""Elapsed time, rotation (4), velocity change (3); smoothed rate and specific force (6); number of samples; noise of
gyro and accelerometer (6); sums of two steps (7), their last four means (24), and the number of means; variances of
the unknown rotation and velocity change."""
Sums: TypeAlias = Annotated[FloatArray, SUMS_SIZE]

_MEAN, _COUNT, _NOISE, _PAIR_S, _PAIR, _PAST, _PAIRS, _UNKNOWN = 8, 14, 15, 21, 22, 28, 52, 53
_SMOOTHING_S = 0.1
_NOISE_SMOOTHING_S = 2.0
_PAIR_LENGTH_S = 0.0155
_DIFFERENCE_VARIANCE = 70.0
"""Variance of the fourth difference of white noise of variance 1."""
_GAP_RATE_RAD_S, _GAP_FORCE_M_S2 = 0.3, 3.0
"""Deviation of the mean rate and specific force of a gap from those of the sample that bridges it."""
_SHOCK_RAD, _SHOCK_M_S = 0.1, 5.0
"""Deviation of what a sample at the end of the range of gyro or accelerometer measures, as in an impact."""
_CLIPPED = 0.99
"""Share of the range from which a value may have been cut off."""


@compiled
def add_sample(sums: Sums, gyro: Vector3, accel: Vector3, dt_s: float) -> None:
    """Add one raw sample."""
    angle = scaled(gyro, dt_s)
    before = Quaternion(sums[1], sums[2], sums[3], sums[4])
    after = normalised(quaternion_product(before, rotation_over(angle, 1.0)))
    dv = rotate(before, in_start_frame(angle, scaled(accel, dt_s)))
    sums[0] += dt_s
    sums[1], sums[2], sums[3], sums[4] = after.w, after.x, after.y, after.z
    sums[5] += dv.x
    sums[6] += dv.y
    sums[7] += dv.z
    share = min(dt_s / _SMOOTHING_S, 1.0) if sums[_COUNT] > 0.0 else 1.0
    _smooth(sums, _MEAN, gyro, share)
    _smooth(sums, _MEAN + 3, accel, share)
    sums[_COUNT] += 1.0


@compiled
def note_gap(sums: Sums, gap_s: float) -> None:
    """Note a time without samples, which the next sample bridges."""
    angle_rad, speed_m_s = _GAP_RATE_RAD_S * gap_s, _GAP_FORCE_M_S2 * gap_s
    sums[_UNKNOWN] += angle_rad * angle_rad
    sums[_UNKNOWN + 1] += speed_m_s * speed_m_s


@compiled
def note_clipping(sums: Sums, gyro: Vector3, accel: Vector3, params: EstimatorParams) -> None:
    """Note a sample with a value at the end of its range: the true one may be far larger."""
    if max(abs(gyro.x), abs(gyro.y), abs(gyro.z)) >= _CLIPPED * params.gyro_range_rad_s:
        sums[_UNKNOWN] += _SHOCK_RAD * _SHOCK_RAD
    if max(abs(accel.x), abs(accel.y), abs(accel.z)) >= _CLIPPED * params.accel_range_m_s2:
        sums[_UNKNOWN + 1] += _SHOCK_M_S * _SHOCK_M_S


@compiled
def in_start_frame(angle: Vector3, velocity: Vector3) -> Vector3:
    """Return a sample's change of the velocity in the frame at its start, to first order of its rotation vector.

    The mean specific force acts in the attitude in the middle of the sample.
    """
    turn = cross(angle, velocity)
    return Vector3(velocity.x + 0.5 * turn.x, velocity.y + 0.5 * turn.y, velocity.z + 0.5 * turn.z)


@compiled
def _smooth(sums: Sums, at: int, value: Vector3, share: float) -> None:
    sums[at] += share * (value.x - sums[at])
    sums[at + 1] += share * (value.y - sums[at + 1])
    sums[at + 2] += share * (value.z - sums[at + 2])


@compiled
def _measure_noise(sums: Sums, sample_dt_s: float, angle: Vector3, velocity: Vector3) -> None:
    """Update the noise densities from the fourth difference of means over two steps, 20 ms.

    The vehicle's motion has little power there, and vibration, which averages out within that time, does not count.
    """
    sums[_PAIR_S] += sample_dt_s
    sums[_PAIR] += angle.x
    sums[_PAIR + 1] += angle.y
    sums[_PAIR + 2] += angle.z
    sums[_PAIR + 3] += velocity.x
    sums[_PAIR + 4] += velocity.y
    sums[_PAIR + 5] += velocity.z
    length_s = sums[_PAIR_S]
    if length_s < _PAIR_LENGTH_S:
        return
    share = max(
        min(length_s / _NOISE_SMOOTHING_S, 1.0), 1.0 / (sums[_PAIRS] - 2.0 if sums[_PAIRS] > 3.0 else 2.0)
    )
    for i in range(6):
        mean, at = sums[_PAIR + i] / length_s, _PAST + 4 * i
        fourth = mean - 4.0 * sums[at] + 6.0 * sums[at + 1] - 4.0 * sums[at + 2] + sums[at + 3]
        if sums[_PAIRS] >= 4.0:
            density = fourth * fourth * (length_s / _DIFFERENCE_VARIANCE)
            sums[_NOISE + i] += share * (density - sums[_NOISE + i])
        sums[at + 3], sums[at + 2], sums[at + 1], sums[at] = sums[at + 2], sums[at + 1], sums[at], mean
        sums[_PAIR + i] = 0.0
    sums[_PAIR_S] = 0.0
    sums[_PAIRS] += 1.0


@compiled
def mean_rate(sums: Sums) -> Vector3:
    """Return the rate [rad/s], smoothed over 0.1 s."""
    return read_vector(sums, _MEAN)


@compiled
def mean_force(sums: Sums) -> Vector3:
    """Return the specific force [m/s²], smoothed over 0.1 s."""
    return read_vector(sums, _MEAN + 3)


@compiled
def noise_of(sums: Sums) -> ImuNoise:
    """Return the noise that is measured of the sensor."""
    return ImuNoise(read_vector(sums, _NOISE), read_vector(sums, _NOISE + 3))


@compiled
def take_step(sums: Sums, time_s: float) -> DeltaSample:
    """Return the accumulated step that ends at ``time_s``, and start the next one."""
    angle = rotation_vector(Quaternion(sums[1], sums[2], sums[3], sums[4]))
    velocity = read_vector(sums, 5)
    _measure_noise(sums, sums[0], angle, velocity)
    sample = DeltaSample(
        time_s,
        sums[0],
        angle,
        velocity,
        sums[_UNKNOWN],
        sums[_UNKNOWN + 1],
    )
    sums[_UNKNOWN], sums[_UNKNOWN + 1] = 0.0, 0.0
    for i in range(8):
        sums[i] = 0.0
    sums[1] = 1.0
    return sample


@compiled
def write_step(row: FloatArray, sample: DeltaSample) -> None:
    """Write a step to a row of the IMU ring, shape (10,)."""
    row[0], row[1] = sample.time_s, sample.dt_s
    write_vector(row, 2, sample.angle_rad)
    write_vector(row, 5, sample.velocity_m_s)
    row[8], row[9] = sample.unknown_angle, sample.unknown_velocity


@compiled
def read_step(row: FloatArray) -> DeltaSample:
    """Read a step from a row of the IMU ring."""
    return DeltaSample(
        row[0],
        row[1],
        read_vector(row, 2),
        read_vector(row, 5),
        row[8],
        row[9],
    )
