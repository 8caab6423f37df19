"""Accumulation of raw IMU samples to steps of the filter, with coning and sculling, and the noise of the samples."""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, Vector3
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
from flightstack.estimation.rings import StepRecord

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


class ImuSums(NamedTuple):
    """Sums of the samples since the last step, and what is known of the sensor."""

    elapsed_s: float
    """Since the last step; rotation and velocity change too."""
    rotation: Annotated[FloatArray, 4]
    velocity_m_s: Annotated[FloatArray, 3]
    rate_rad_s: Annotated[FloatArray, 3]
    """Smoothed, as the specific force."""
    force_m_s2: Annotated[FloatArray, 3]
    samples: float
    """Number of samples so far."""
    unknown_angle: float
    """Variance of the rotation [rad²] that was not measured since the last step."""
    unknown_velocity: float
    """The same of the velocity change [m²/s²]."""
    noise: Annotated[FloatArray, 6]
    """Densities of gyro and accelerometer, as variances."""
    pair_s: float
    """Length of the steps in ``pair``."""
    pair: Annotated[FloatArray, 6]
    """Sum of the rotation vectors and velocity changes of up to two steps."""
    past: Annotated[FloatArray, 6, 4]
    """Means of the last four pairs, the newest first."""
    pairs: float
    """Number of pairs so far."""


ImuSumsRecord: TypeAlias = Annotated[Record, ImuSums]


@compiled
def add_sample(sums: ImuSumsRecord, gyro: Vector3, accel: Vector3, dt_s: float) -> None:
    """Add one raw sample."""
    angle, q, velocity = scaled(gyro, dt_s), sums["rotation"], sums["velocity_m_s"]
    before = Quaternion(q[0], q[1], q[2], q[3])
    after = normalised(quaternion_product(before, rotation_over(angle, 1.0)))
    dv = rotate(before, in_start_frame(angle, scaled(accel, dt_s)))
    sums["elapsed_s"] += dt_s
    q[0], q[1], q[2], q[3] = after.w, after.x, after.y, after.z
    velocity[0] += dv.x
    velocity[1] += dv.y
    velocity[2] += dv.z
    share = min(dt_s / _SMOOTHING_S, 1.0) if sums["samples"] > 0.0 else 1.0
    _smooth(sums["rate_rad_s"], gyro, share)
    _smooth(sums["force_m_s2"], accel, share)
    sums["samples"] += 1.0


@compiled
def note_gap(sums: ImuSumsRecord, gap_s: float) -> None:
    """Note a time without samples, which the next sample bridges."""
    angle_rad, speed_m_s = _GAP_RATE_RAD_S * gap_s, _GAP_FORCE_M_S2 * gap_s
    sums["unknown_angle"] += angle_rad * angle_rad
    sums["unknown_velocity"] += speed_m_s * speed_m_s


@compiled
def note_clipping(sums: ImuSumsRecord, gyro: Vector3, accel: Vector3, params: EstimatorParams) -> None:
    """Note a sample with a value at the end of its range: the true one may be far larger."""
    if max(abs(gyro.x), abs(gyro.y), abs(gyro.z)) >= _CLIPPED * params.gyro_range_rad_s:
        sums["unknown_angle"] += _SHOCK_RAD * _SHOCK_RAD
    if max(abs(accel.x), abs(accel.y), abs(accel.z)) >= _CLIPPED * params.accel_range_m_s2:
        sums["unknown_velocity"] += _SHOCK_M_S * _SHOCK_M_S


@compiled
def in_start_frame(angle: Vector3, velocity: Vector3) -> Vector3:
    """Return a sample's change of the velocity in the frame at its start, to first order of its rotation vector.

    The mean specific force acts in the attitude in the middle of the sample.
    """
    turn = cross(angle, velocity)
    return Vector3(velocity.x + 0.5 * turn.x, velocity.y + 0.5 * turn.y, velocity.z + 0.5 * turn.z)


@compiled
def _smooth(mean: Annotated[FloatArray, 3], value: Vector3, share: float) -> None:
    mean[0] += share * (value.x - mean[0])
    mean[1] += share * (value.y - mean[1])
    mean[2] += share * (value.z - mean[2])


@compiled
def _measure_noise(sums: ImuSumsRecord, sample_dt_s: float, angle: Vector3, velocity: Vector3) -> None:
    """Update the noise densities from the fourth difference of means over two steps, 20 ms.

    The vehicle's motion has little power there, and vibration, which averages out within that time, does not count.
    """
    pair, past, pairs = sums["pair"], sums["past"], sums["pairs"]
    sums["pair_s"] += sample_dt_s
    pair[0] += angle.x
    pair[1] += angle.y
    pair[2] += angle.z
    pair[3] += velocity.x
    pair[4] += velocity.y
    pair[5] += velocity.z
    length_s = sums["pair_s"]
    if length_s < _PAIR_LENGTH_S:
        return
    share = max(min(length_s / _NOISE_SMOOTHING_S, 1.0), 1.0 / (pairs - 2.0 if pairs > 3.0 else 2.0))
    for i in range(6):
        mean = pair[i] / length_s
        fourth = mean - 4.0 * past[i, 0] + 6.0 * past[i, 1] - 4.0 * past[i, 2] + past[i, 3]
        if pairs >= 4.0:
            density = fourth * fourth * (length_s / _DIFFERENCE_VARIANCE)
            sums["noise"][i] += share * (density - sums["noise"][i])
        past[i, 3], past[i, 2], past[i, 1], past[i, 0] = past[i, 2], past[i, 1], past[i, 0], mean
        pair[i] = 0.0
    sums["pair_s"] = 0.0
    sums["pairs"] += 1.0


@compiled
def mean_rate(sums: ImuSumsRecord) -> Vector3:
    """Return the rate [rad/s], smoothed over 0.1 s."""
    return read_vector(sums["rate_rad_s"], 0)


@compiled
def mean_force(sums: ImuSumsRecord) -> Vector3:
    """Return the specific force [m/s²], smoothed over 0.1 s."""
    return read_vector(sums["force_m_s2"], 0)


@compiled
def noise_of(sums: ImuSumsRecord) -> ImuNoise:
    """Return the noise that is measured of the sensor."""
    return ImuNoise(read_vector(sums["noise"], 0), read_vector(sums["noise"], 3))


@compiled
def take_step(sums: ImuSumsRecord, time_s: float) -> DeltaSample:
    """Return the accumulated step that ends at ``time_s``, and start the next one."""
    q, v = sums["rotation"], sums["velocity_m_s"]
    angle = rotation_vector(Quaternion(q[0], q[1], q[2], q[3]))
    velocity = read_vector(v, 0)
    _measure_noise(sums, sums["elapsed_s"], angle, velocity)
    sample = DeltaSample(
        time_s,
        sums["elapsed_s"],
        angle,
        velocity,
        sums["unknown_angle"],
        sums["unknown_velocity"],
    )
    sums["unknown_angle"], sums["unknown_velocity"] = 0.0, 0.0
    sums["elapsed_s"] = 0.0
    q[0], q[1], q[2], q[3] = 1.0, 0.0, 0.0, 0.0
    v[0], v[1], v[2] = 0.0, 0.0, 0.0
    return sample


@compiled
def write_step(row: StepRecord, sample: DeltaSample) -> None:
    """Write a step to a row of the IMU ring."""
    row["time_s"], row["dt_s"] = sample.time_s, sample.dt_s
    write_vector(row["angle_rad"], 0, sample.angle_rad)
    write_vector(row["velocity_m_s"], 0, sample.velocity_m_s)
    row["unknown_angle"], row["unknown_velocity"] = sample.unknown_angle, sample.unknown_velocity


@compiled
def read_step(row: StepRecord) -> DeltaSample:
    """Read a step from a row of the IMU ring."""
    return DeltaSample(
        row["time_s"],
        row["dt_s"],
        read_vector(row["angle_rad"], 0),
        read_vector(row["velocity_m_s"], 0),
        row["unknown_angle"],
        row["unknown_velocity"],
    )
