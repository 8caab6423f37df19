"""Yaw from GNSS velocity: a bank of models that start at yaws all around, weighed by how well each predicts velocity.

A Gaussian sum filter as PX4's EKF-GSF. Each model is a Kalman filter of tilt, yaw and horizontal velocity with an
attitude of its own; tilt is a state, so that a long turn does not tilt it as a correction by the specific force would.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.array_items import local_zeros
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, RecordArray, Vector3
from flightstack.core.geometry import normalised, quaternion_product, rotate, rotation_over, wrap_pi
from flightstack.core.portable_math import atan2, exp, log, sin_cos
from flightstack.estimation.error_state import turn_between, turned

MODELS = 5
_STATES = 5
"""Tilt about north and east, yaw, velocity north and east."""
_SPACING_RAD = 1.2566370614359172
_TILT_RAD, _YAW_RAD = 0.05, 0.6283185307179586
_GYRO_NOISE, _ACCEL_NOISE = 0.01, 0.5
"""Noise densities [rad/√s, m/s/√s], with room for errors of the biases, vibration and drag."""
_LARGEST_SQUARE = 25.0
"""Squared innovation by its variance at which an update is clipped."""
_LEAST_WEIGHT = 1e-5


class YawModel(NamedTuple):
    """A Kalman filter of the bank."""

    attitude: Annotated[FloatArray, 4]
    north_m_s: float
    """Velocity."""
    east_m_s: float
    covariance: Annotated[FloatArray, _STATES, _STATES]
    """Of tilt about north and east, yaw, velocity north and east."""
    weight: float


class YawBank(NamedTuple):
    """All models; the sum of their weights is 1."""

    models: Annotated[RecordArray, YawModel, MODELS]


YawModelRecord: TypeAlias = Annotated[Record, YawModel]
YawBankRecord: TypeAlias = Annotated[Record, YawBank]


@compiled
def attitude_of(model: YawModelRecord) -> Quaternion:
    """Return the attitude of a model."""
    q = model["attitude"]
    return Quaternion(q[0], q[1], q[2], q[3])


@compiled
def tilt_variance(model: YawModelRecord, axis: int) -> float:
    """Return the variance [rad²] of a model's tilt about north (0) or east (1)."""
    variance: float = model["covariance"][axis, axis]
    return variance


@compiled
def _write_attitude(model: YawModelRecord, attitude: Quaternion) -> None:
    q = model["attitude"]
    q[0], q[1], q[2], q[3] = attitude.w, attitude.x, attitude.y, attitude.z


@compiled
def start_models(
    bank: YawBankRecord, attitude: Quaternion, north_m_s: float, east_m_s: float, variance: float
) -> None:
    """Start with the tilt of ``attitude``, yaws all around it, and a measured velocity."""
    for k in range(MODELS):
        model = bank["models"][k]
        _write_attitude(model, turned(attitude, Vector3(0.0, 0.0, _SPACING_RAD * k)))
        model["north_m_s"], model["east_m_s"] = north_m_s, east_m_s
        p = model["covariance"]
        for i in range(_STATES):
            for j in range(_STATES):
                p[i, j] = 0.0
        p[0, 0], p[1, 1], p[2, 2] = _TILT_RAD * _TILT_RAD, _TILT_RAD * _TILT_RAD, _YAW_RAD * _YAW_RAD
        p[3, 3], p[4, 4] = variance, variance
        model["weight"] = 1.0 / MODELS


@compiled
def predict_models(bank: YawBankRecord, angle: Vector3, delta_velocity: Vector3, dt_s: float) -> None:
    """Move all models over a step: rotation vector and velocity change in the body frame, biases removed."""
    half, whole = rotation_over(angle, 0.5), rotation_over(angle, 1.0)
    for k in range(MODELS):
        model = bank["models"][k]
        q = attitude_of(model)
        a = rotate(quaternion_product(q, half), delta_velocity)
        _write_attitude(model, normalised(quaternion_product(q, whole)))
        model["north_m_s"] += a.x
        model["east_m_s"] += a.y
        p = model["covariance"]
        for j in range(_STATES):  # rows of velocity: δv' = δv + δθ × a
            tilt_n, tilt_e, yaw = p[0, j], p[1, j], p[2, j]
            p[3, j] += a.z * tilt_e - a.y * yaw
            p[4, j] += a.x * yaw - a.z * tilt_n
        for i in range(_STATES):
            p[i, 3] += a.z * p[i, 1] - a.y * p[i, 2]
            p[i, 4] += a.x * p[i, 2] - a.z * p[i, 0]
        for i in range(_STATES):
            noise = _GYRO_NOISE if i < 3 else _ACCEL_NOISE
            p[i, i] += noise * noise * dt_s


@compiled
def _update_model(model: YawModelRecord, north_m_s: float, east_m_s: float, variance: float) -> float:
    """Fuse a velocity; return the squared innovation by its variance plus the logarithm's share of that variance."""
    p = model["covariance"]
    s00, s01, s11 = p[3, 3] + variance, p[3, 4], p[4, 4] + variance
    scale = 1.0 / (s00 * s11 - s01 * s01)
    i00, i01, i11 = s11 * scale, -s01 * scale, s00 * scale
    north, east = north_m_s - model["north_m_s"], east_m_s - model["east_m_s"]
    square = north * (i00 * north + i01 * east) + east * (i01 * north + i11 * east)
    share = math.sqrt(_LARGEST_SQUARE / square) if square > _LARGEST_SQUARE else 1.0
    gain, column = local_zeros(_STATES, 2), local_zeros(_STATES, 2)
    for i in range(_STATES):
        column[i, 0], column[i, 1] = p[i, 3], p[i, 4]
        gain[i, 0] = column[i, 0] * i00 + column[i, 1] * i01
        gain[i, 1] = column[i, 0] * i01 + column[i, 1] * i11
    for i in range(_STATES):
        for j in range(_STATES):
            p[i, j] -= gain[i, 0] * column[j, 0] + gain[i, 1] * column[j, 1]
    north *= share
    east *= share
    turn = Vector3(
        gain[0, 0] * north + gain[0, 1] * east,
        gain[1, 0] * north + gain[1, 1] * east,
        gain[2, 0] * north + gain[2, 1] * east,
    )
    _write_attitude(model, turned(attitude_of(model), turn))
    model["north_m_s"] += gain[3, 0] * north + gain[3, 1] * east
    model["east_m_s"] += gain[4, 0] * north + gain[4, 1] * east
    cost: float = min(square, 2.0 * _LARGEST_SQUARE) - log(scale)
    return cost


@compiled
def update_models(bank: YawBankRecord, north_m_s: float, east_m_s: float, variance: float) -> None:
    """Fuse a velocity with all models, and multiply the weight of each by its likelihood."""
    models = bank["models"]
    costs, least, total = local_zeros(MODELS), math.inf, 0.0
    for k in range(MODELS):
        costs[k] = _update_model(models[k], north_m_s, east_m_s, variance)
        least = min(least, costs[k])
    for k in range(MODELS):
        weight = max(models[k]["weight"] * exp(0.5 * (least - costs[k])), _LEAST_WEIGHT)
        models[k]["weight"] = weight
        total += weight
    for k in range(MODELS):
        models[k]["weight"] /= total


@compiled
def mean_turn(bank: YawBankRecord, attitude: Quaternion) -> float:
    """Return the angle [rad] about the vertical from ``attitude`` to the weighted mean of the models."""
    x, y = 0.0, 0.0
    for k in range(MODELS):
        model = bank["models"][k]
        sine, cosine = sin_cos(turn_between(attitude, attitude_of(model)))
        x += model["weight"] * cosine
        y += model["weight"] * sine
    return atan2(y, x)


@compiled
def variance_of(bank: YawBankRecord, attitude: Quaternion, turn_rad: float) -> float:
    """Return the variance [rad²] of the models' yaw about ``turn_rad``."""
    total = 0.0
    for k in range(MODELS):
        model = bank["models"][k]
        off = wrap_pi(turn_between(attitude, attitude_of(model)) - turn_rad)
        total += model["weight"] * (model["covariance"][2, 2] + off * off)
    return total


@compiled
def likeliest(bank: YawBankRecord) -> int:
    """Return the number of the model with the largest weight."""
    models, best = bank["models"], 0
    for k in range(MODELS):
        if models[k]["weight"] > models[best]["weight"]:
            best = k
    return best
