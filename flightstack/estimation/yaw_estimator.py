"""Yaw from GNSS velocity: a bank of models that start at yaws all around, weighed by how well each predicts velocity.

A Gaussian sum filter as PX4's EKF-GSF. Each model is a Kalman filter of tilt, yaw and horizontal velocity with an
attitude of its own; tilt is a state, so that a long turn does not tilt it as a correction by the specific force would.
"""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import normalised, quaternion_product, rotate, rotation_over, wrap_pi
from flightstack.core.portable_math import atan2, exp, log, sin_cos
from flightstack.estimation.error_state import turn_between, turned

MODELS, MODEL_SIZE = 5, 32
"""Array form of a model: attitude (4), velocity north and east, covariance of tilt, yaw and velocity (25), weight."""
Models: TypeAlias = Annotated[FloatArray, MODELS, MODEL_SIZE]
_V, _P, _WEIGHT, _STATES = 4, 6, 31, 5
_SPACING_RAD = 1.2566370614359172
_TILT_RAD, _YAW_RAD = 0.05, 0.6283185307179586
_GYRO_NOISE, _ACCEL_NOISE = 0.01, 0.5
"""Noise densities [rad/√s, m/s/√s], with room for errors of the biases, vibration and drag."""
_LARGEST_SQUARE = 25.0
"""Squared innovation by its variance at which an update is clipped."""
_LEAST_WEIGHT = 1e-5


@compiled
def attitude_of(models: Models, number: int) -> Quaternion:
    """Return the attitude of a model."""
    return Quaternion(models[number, 0], models[number, 1], models[number, 2], models[number, 3])


@compiled
def tilt_variance(models: Models, number: int, axis: int) -> float:
    """Return the variance [rad²] of a model's tilt about north (0) or east (1)."""
    variance: float = models[number, _P + 6 * axis]
    return variance


@compiled
def _write_attitude(models: Models, number: int, q: Quaternion) -> None:
    models[number, 0], models[number, 1], models[number, 2], models[number, 3] = q.w, q.x, q.y, q.z


@compiled
def start_models(
    models: Models, attitude: Quaternion, north_m_s: float, east_m_s: float, variance: float
) -> None:
    """Start with the tilt of ``attitude``, yaws all around it, and a measured velocity."""
    for k in range(MODELS):
        for i in range(MODEL_SIZE):
            models[k, i] = 0.0
        _write_attitude(models, k, turned(attitude, Vector3(0.0, 0.0, _SPACING_RAD * k)))
        models[k, _V], models[k, _V + 1] = north_m_s, east_m_s
        models[k, _P], models[k, _P + 6] = _TILT_RAD * _TILT_RAD, _TILT_RAD * _TILT_RAD
        models[k, _P + 12] = _YAW_RAD * _YAW_RAD
        models[k, _P + 18], models[k, _P + 24] = variance, variance
        models[k, _WEIGHT] = 1.0 / MODELS


@compiled
def predict_models(models: Models, angle: Vector3, delta_velocity: Vector3, dt_s: float) -> None:
    """Move all models over a step: rotation vector and velocity change in the body frame, biases removed."""
    half, whole = rotation_over(angle, 0.5), rotation_over(angle, 1.0)
    for k in range(MODELS):
        q = attitude_of(models, k)
        a = rotate(quaternion_product(q, half), delta_velocity)
        _write_attitude(models, k, normalised(quaternion_product(q, whole)))
        models[k, _V] += a.x
        models[k, _V + 1] += a.y
        for j in range(_STATES):  # rows of velocity: δv' = δv + δθ × a
            tilt_n, tilt_e, yaw = models[k, _P + j], models[k, _P + 5 + j], models[k, _P + 10 + j]
            models[k, _P + 15 + j] += a.z * tilt_e - a.y * yaw
            models[k, _P + 20 + j] += a.x * yaw - a.z * tilt_n
        for i in range(_STATES):
            at = _P + _STATES * i
            models[k, at + 3] += a.z * models[k, at + 1] - a.y * models[k, at + 2]
            models[k, at + 4] += a.x * models[k, at + 2] - a.z * models[k, at]
        for i in range(_STATES):
            noise = _GYRO_NOISE if i < 3 else _ACCEL_NOISE
            models[k, _P + 6 * i] += noise * noise * dt_s


@compiled
def _update_model(models: Models, k: int, north_m_s: float, east_m_s: float, variance: float) -> float:
    """Fuse a velocity; return the squared innovation by its variance plus the logarithm's share of that variance."""
    p = models[k]
    s00, s01, s11 = p[_P + 18] + variance, p[_P + 19], p[_P + 24] + variance
    scale = 1.0 / (s00 * s11 - s01 * s01)
    i00, i01, i11 = s11 * scale, -s01 * scale, s00 * scale
    north, east = north_m_s - p[_V], east_m_s - p[_V + 1]
    square = north * (i00 * north + i01 * east) + east * (i01 * north + i11 * east)
    share = math.sqrt(_LARGEST_SQUARE / square) if square > _LARGEST_SQUARE else 1.0
    gain, column = np.zeros((_STATES, 2)), np.zeros((_STATES, 2))
    for i in range(_STATES):
        column[i, 0], column[i, 1] = p[_P + 5 * i + 3], p[_P + 5 * i + 4]
        gain[i, 0] = column[i, 0] * i00 + column[i, 1] * i01
        gain[i, 1] = column[i, 0] * i01 + column[i, 1] * i11
    for i in range(_STATES):
        for j in range(_STATES):
            p[_P + 5 * i + j] -= gain[i, 0] * column[j, 0] + gain[i, 1] * column[j, 1]
    north *= share
    east *= share
    turn = Vector3(
        gain[0, 0] * north + gain[0, 1] * east,
        gain[1, 0] * north + gain[1, 1] * east,
        gain[2, 0] * north + gain[2, 1] * east,
    )
    _write_attitude(models, k, turned(attitude_of(models, k), turn))
    p[_V] += gain[3, 0] * north + gain[3, 1] * east
    p[_V + 1] += gain[4, 0] * north + gain[4, 1] * east
    cost: float = min(square, 2.0 * _LARGEST_SQUARE) - log(scale)
    return cost


@compiled
def update_models(models: Models, north_m_s: float, east_m_s: float, variance: float) -> None:
    """Fuse a velocity with all models, and multiply the weight of each by its likelihood."""
    costs, least, total = np.zeros(MODELS), math.inf, 0.0
    for k in range(MODELS):
        costs[k] = _update_model(models, k, north_m_s, east_m_s, variance)
        least = min(least, costs[k])
    for k in range(MODELS):
        weight = max(models[k, _WEIGHT] * exp(0.5 * (least - costs[k])), _LEAST_WEIGHT)
        models[k, _WEIGHT] = weight
        total += weight
    for k in range(MODELS):
        models[k, _WEIGHT] /= total


@compiled
def mean_turn(models: Models, attitude: Quaternion) -> float:
    """Return the angle [rad] about the vertical from ``attitude`` to the weighted mean of the models."""
    x, y = 0.0, 0.0
    for k in range(MODELS):
        sine, cosine = sin_cos(turn_between(attitude, attitude_of(models, k)))
        x += models[k, _WEIGHT] * cosine
        y += models[k, _WEIGHT] * sine
    return atan2(y, x)


@compiled
def variance_of(models: Models, attitude: Quaternion, turn_rad: float) -> float:
    """Return the variance [rad²] of the models' yaw about ``turn_rad``."""
    total = 0.0
    for k in range(MODELS):
        off = wrap_pi(turn_between(attitude, attitude_of(models, k)) - turn_rad)
        total += models[k, _WEIGHT] * (models[k, _P + 12] + off * off)
    return total


@compiled
def likeliest(models: Models) -> int:
    """Return the number of the model with the largest weight."""
    best = 0
    for k in range(MODELS):
        if models[k, _WEIGHT] > models[best, _WEIGHT]:
            best = k
    return best
