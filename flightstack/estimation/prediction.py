"""Prediction of the filter's state and covariance with one accumulated IMU sample."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geometry import conjugate, cross, normalised, quaternion_product, rotate, rotation_over
from flightstack.estimation.derived_generated import predict_covariance
from flightstack.estimation.error_state import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_BIAS,
    BODY_FIELD,
    EARTH_FIELD,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    WIND,
    Covariance,
    Nominal,
    read_nominal,
    read_vector,
    sum_of,
    write_nominal,
    write_vector,
)
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.kalman import BEHIND_SIZE, Filter

_REMEMBERED_S = 5.0
"""Time constant with which rotations and drag are forgotten."""
_GUST_S, _LEAST_S = 1.0, 1e-3
"""Time for which a change of the airspeed lasts, and the least step."""
_WIND_M_S = 2.0
"""Wind with which changes of the airspeed are counted: it is not known."""
_MOST_PRESSURE = 0.01
"""Variance [m²] that a step can add by it: an impact is no wind."""
_MOST_ANGLE, _MOST_VELOCITY = 0.3**2, 5.0**2
"""Variances [rad²], [m²/s²] beyond which unknown motion adds nothing: other sensors are believed by then."""


class DeltaSample(NamedTuple):
    """Rotation vector and velocity change over ``dt_s``, in the body frame at its start, biases included.

    The unknown parts are the variances [rad²] and [m²/s²] of each axis of what the sensor could not measure: in time
    without samples, and beyond its range.
    """

    time_s: float
    dt_s: float
    angle_rad: Vector3
    velocity_m_s: Vector3
    unknown_angle: float
    unknown_velocity: float


class ImuNoise(NamedTuple):
    """Densities of the white noise that is measured of each axis, [rad²/s] and [m²/s³]."""

    gyro: Vector3
    accel: Vector3


class Motion(NamedTuple):
    """Attitude, velocity and position."""

    attitude: Quaternion
    velocity_ned_m_s: Vector3
    position_ned_m: Vector3


@compiled
def less_bias(v: Vector3, bias: Vector3, dt_s: float) -> Vector3:
    """Return a delta angle or velocity without the bias of its rate."""
    return Vector3(v.x - bias.x * dt_s, v.y - bias.y * dt_s, v.z - bias.z * dt_s)


@compiled
def moved(start: Motion, angle: Vector3, delta_velocity: Vector3, dt_s: float, gravity: float) -> Motion:
    """Integrate one step: ``angle`` and ``delta_velocity`` in the body frame at the start, velocity by trapezoids."""
    dv = rotate(start.attitude, delta_velocity)
    v = start.velocity_ned_m_s
    end = Vector3(v.x + dv.x, v.y + dv.y, v.z + dv.z + gravity * dt_s)
    p, half = start.position_ned_m, 0.5 * dt_s
    return Motion(
        normalised(quaternion_product(start.attitude, rotation_over(angle, 1.0))),
        end,
        Vector3(p.x + half * (v.x + end.x), p.y + half * (v.y + end.y), p.z + half * (v.z + end.z)),
    )


@compiled
def motion_of(n: Nominal) -> Motion:
    """Return the part of the nominal state that moves."""
    return Motion(n.attitude, n.velocity_ned_m_s, n.position_ned_m)


@compiled
def with_motion(n: Nominal, motion: Motion) -> Nominal:
    """Return the nominal state with another motion."""
    return Nominal(
        motion.attitude,
        motion.velocity_ned_m_s,
        motion.position_ned_m,
        n.gyro_bias_rad_s,
        n.accel_bias_m_s2,
        n.earth_field_ned_gauss,
        n.body_field_frd_gauss,
        n.wind_north_m_s,
        n.wind_east_m_s,
        n.baro_bias_m,
        n.gnss_bias_ned_m,
    )


@compiled
def _add(p: Covariance, at: int, count: int, variance: float) -> None:
    for i in range(at, at + count):
        p[i, i] += variance


@compiled
def _add_body_noise(p: Covariance, at: int, axis: Vector3, variance: float) -> None:
    """Add the noise of one axis of the body, a unit vector in the world frame."""
    p[at, at] += variance * axis.x * axis.x
    p[at, at + 1] += variance * axis.x * axis.y
    p[at, at + 2] += variance * axis.x * axis.z
    p[at + 1, at + 1] += variance * axis.y * axis.y
    p[at + 1, at + 2] += variance * axis.y * axis.z
    p[at + 2, at + 2] += variance * axis.z * axis.z


@compiled
def _turn_variances(f: Filter, angle: Vector3, dt_s: float, params: EstimatorParams) -> Vector3:
    """Return the variances about the body's axes by errors of scale and alignment of the gyro in a step.

    An error e gives e φ after a rotation φ, and nothing any more after the rotation back. A process with the deviation
    e φ, of the rotation of the last T, has noise of the density 2 (e φ)² / T. Rotation about the body's z axis moves
    the tilt too, in step with the heading: ``_keep_misaligned`` counts that.
    """
    turn, share = f.turn, min(dt_s / _REMEMBERED_S, 1.0)
    turn[0] += angle.x - share * turn[0]
    turn[1] += angle.y - share * turn[1]
    turn[2] += angle.z - share * turn[2]
    density = 2.0 * params.gyro_scale_error * params.gyro_scale_error * share
    tilted = density * (turn[0] * turn[0] + turn[1] * turn[1])
    return Vector3(tilted, tilted, tilted + density * turn[2] * turn[2])


@compiled
def _keep_misaligned(p: Covariance, at: int, axis: Vector3, params: EstimatorParams) -> None:
    """Keep a horizontal bias of the accelerometer as uncertain as the alignment of the gyro leaves it.

    A yaw rate ω measured along an axis that is off by e turns the tilt by e in step with the heading, which gives the
    same velocity as a bias g e of the accelerometer. No other measurement tells them apart: what is added is a bias
    along ``axis``, a unit vector in the world frame, with the tilt that hides it from the velocity of level flight.
    """
    gravity = params.gravity_m_s2
    bias = gravity * params.gyro_scale_error
    lacking = max(bias * bias - p[at, at], 0.0)
    about_north, about_east = axis.y / gravity, -axis.x / gravity
    p[ATTITUDE, ATTITUDE] += lacking * about_north * about_north
    p[ATTITUDE, ATTITUDE + 1] += lacking * about_north * about_east
    p[ATTITUDE + 1, ATTITUDE + 1] += lacking * about_east * about_east
    p[ATTITUDE, at] += lacking * about_north
    p[ATTITUDE + 1, at] += lacking * about_east
    p[at, at] += lacking


@compiled
def _keep_inclined(f: Filter, force: Vector3, dt_s: float, params: EstimatorParams) -> None:
    """Keep the accelerometer's vertical bias as uncertain as the alignment of its axes leaves it.

    Drag d along the body shows in a vertical axis that is off by e as a bias of d e. A filter that learns it holds it
    for the sensor's own, so that the variance stays that of both: 2 (d e)², with the mean drag of the last T. ``force``
    is the velocity change in the body frame.
    """
    p, drag, share = f.covariance, f.drag, min(dt_s / _REMEMBERED_S, 1.0)
    drag[0] += force.x / _REMEMBERED_S - share * drag[0]
    drag[1] += force.y / _REMEMBERED_S - share * drag[1]
    square = params.gyro_scale_error * params.gyro_scale_error * (drag[0] * drag[0] + drag[1] * drag[1])
    p[ACCEL_BIAS + 2, ACCEL_BIAS + 2] = max(p[ACCEL_BIAS + 2, ACCEL_BIAS + 2], 2.0 * square)


@compiled
def _pressure_variance(f: Filter, change: Vector3, dt_s: float, params: EstimatorParams) -> float:
    """Return the variance that a change of the airspeed in a step adds to the barometer's bias.

    The port feels a share of the dynamic pressure: an altitude of share u² / 2 g for the airspeed u, which changes by
    share u du / g, as white noise. The wind is not known.
    """
    north, east = f.nominal[4], f.nominal[5]
    square = north * north + east * east + _WIND_M_S * _WIND_M_S
    share, lasting = params.baro_dynamic_share / params.gravity_m_s2, _GUST_S / max(dt_s, _LEAST_S)
    variance: float = share * share * square * (change.x * change.x + change.y * change.y) * lasting
    return min(variance, _MOST_PRESSURE)


@compiled
def _add_process_noise(
    f: Filter,
    q: Quaternion,
    angle: Vector3,
    change: Vector3,
    force: Vector3,
    dt_s: float,
    noise: ImuNoise,
    params: EstimatorParams,
) -> None:
    p, share = f.covariance, f.clock[1]
    gyro, accel = params.gyro_noise, params.accel_noise
    x = rotate(q, Vector3(1.0, 0.0, 0.0))
    y = rotate(q, Vector3(0.0, 1.0, 0.0))
    z = cross(x, y)
    turns = _turn_variances(f, angle, dt_s, params)
    _add_body_noise(p, ATTITUDE, x, turns.x + max(gyro * gyro, share * noise.gyro.x) * dt_s)
    _add_body_noise(p, ATTITUDE, y, turns.y + max(gyro * gyro, share * noise.gyro.y) * dt_s)
    _add_body_noise(p, ATTITUDE, z, turns.z + max(gyro * gyro, share * noise.gyro.z) * dt_s)
    _add_body_noise(p, VELOCITY, x, max(accel * accel, share * noise.accel.x) * dt_s)
    _add_body_noise(p, VELOCITY, y, max(accel * accel, share * noise.accel.y) * dt_s)
    _add_body_noise(p, VELOCITY, z, max(accel * accel, share * noise.accel.z) * dt_s)
    _add(p, POSITION, 3, 1e-8 * dt_s)
    _add(p, GYRO_BIAS, 3, params.gyro_bias_walk * params.gyro_bias_walk * dt_s)
    _add(p, ACCEL_BIAS, 3, params.accel_bias_walk * params.accel_bias_walk * dt_s)
    _keep_misaligned(p, ACCEL_BIAS, x, params)
    _keep_misaligned(p, ACCEL_BIAS + 1, y, params)
    _keep_inclined(f, force, dt_s, params)
    _add(p, EARTH_FIELD, 3, params.earth_field_walk * params.earth_field_walk * dt_s)
    _add(p, BODY_FIELD, 3, params.body_field_walk * params.body_field_walk * dt_s)
    _add(p, WIND, 2, params.wind_walk * params.wind_walk * dt_s)
    pressure = _pressure_variance(f, change, dt_s, params)
    _add(p, BARO_BIAS, 1, params.baro_walk * params.baro_walk * dt_s + pressure)


@compiled
def predict(f: Filter, sample: DeltaSample, params: EstimatorParams) -> None:
    """Propagate the state over the sample. The covariance is behind it until ``predict_errors``."""
    n, behind = read_nominal(f.nominal), f.behind
    angle = less_bias(sample.angle_rad, n.gyro_bias_rad_s, sample.dt_s)
    delta_velocity = less_bias(sample.velocity_m_s, n.accel_bias_m_s2, sample.dt_s)
    middle = quaternion_product(n.attitude, rotation_over(angle, 0.5))
    change = rotate(middle, delta_velocity)
    behind[0] += sample.dt_s
    write_vector(behind, 1, sum_of(read_vector(behind, 1), angle))
    write_vector(behind, 4, sum_of(read_vector(behind, 4), change))
    after = moved(motion_of(n), angle, delta_velocity, sample.dt_s, params.gravity_m_s2)
    write_nominal(f.nominal, with_motion(n, after))
    f.clock[0] = sample.time_s


@compiled
def predict_errors(f: Filter, noise: ImuNoise, params: EstimatorParams) -> None:
    """Propagate the covariance to the time of the state, over all samples since it was last.

    The errors then move with the attitude in the middle of that time.
    """
    dt_s, angle, change = f.behind[0], read_vector(f.behind, 1), read_vector(f.behind, 4)
    attitude = Quaternion(f.nominal[0], f.nominal[1], f.nominal[2], f.nominal[3])
    middle = quaternion_product(attitude, rotation_over(angle, -0.5))
    force = rotate(conjugate(middle), change)
    predict_covariance(f.covariance, middle, force, dt_s)
    _add_process_noise(f, middle, angle, change, force, dt_s, noise, params)
    for i in range(BEHIND_SIZE):
        f.behind[i] = 0.0


@compiled
def add_unknown(f: Filter, step: DeltaSample) -> None:
    """Add the uncertainty of what the sensor could not measure in a step; the position has half of the velocity's."""
    p, half_s = f.covariance, 0.5 * step.dt_s
    for axis in range(3):
        turn, speed, place = ATTITUDE + axis, VELOCITY + axis, POSITION + axis
        p[turn, turn] += min(step.unknown_angle, max(_MOST_ANGLE - p[turn, turn], 0.0))
        variance = min(step.unknown_velocity, max(_MOST_VELOCITY - p[speed, speed], 0.0))
        p[speed, speed] += variance
        p[speed, place] += half_s * variance
        p[place, place] += half_s * half_s * variance
