"""Kalman filters with arrays in NamedTuples, as an estimator is written: material for the generator."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import conjugate, normalised, quaternion_product, rotate, rotation_over

# ------------------------------------------------------------------ attitude and gyro bias, six states

ERRORS = 6


class AttitudeFilter(NamedTuple):
    """Attitude (w, x, y, z), gyro bias [rad/s], and covariance of the errors of both."""

    attitude: Annotated[FloatArray, 4]
    bias_rad_s: Annotated[FloatArray, 3]
    covariance: Annotated[FloatArray, ERRORS, ERRORS]
    health: float


class FilterNoise(NamedTuple):
    """Variances of gyro, its bias, and the accelerometer's direction."""

    gyro: float
    bias: float
    direction: float


@compiled
def quaternion_of(values: Annotated[FloatArray, 4]) -> Quaternion:
    return Quaternion(values[0], values[1], values[2], values[3])


@compiled
def _store_quaternion(values: Annotated[FloatArray, 4], q: Quaternion) -> None:
    values[0], values[1], values[2], values[3] = q


@compiled
def _transition(out: Annotated[FloatArray, ERRORS, ERRORS], rates: Vector3, dt_s: float) -> None:
    """Write I + F·dt: the error turns with the body, and grows with the error of the bias."""
    for row in range(ERRORS):
        for column in range(ERRORS):
            out[row, column] = 1.0 if row == column else 0.0
    out[0, 1], out[0, 2] = rates.z * dt_s, -rates.y * dt_s
    out[1, 0], out[1, 2] = -rates.z * dt_s, rates.x * dt_s
    out[2, 0], out[2, 1] = rates.y * dt_s, -rates.x * dt_s
    for axis in range(3):
        out[axis, axis + 3] = -dt_s


@compiled
def _sandwich(
    out: Annotated[FloatArray, ERRORS, ERRORS],
    left: Annotated[FloatArray, ERRORS, ERRORS],
    middle: Annotated[FloatArray, ERRORS, ERRORS],
) -> None:
    """Write left · middle · leftᵀ, of which one half is computed."""
    product = np.zeros((ERRORS, ERRORS))
    for row in range(ERRORS):
        for column in range(ERRORS):
            total = 0.0
            for k in range(ERRORS):
                total += left[row, k] * middle[k, column]
            product[row, column] = total
    for row in range(ERRORS):
        for column in range(row + 1):
            total = 0.0
            for k in range(ERRORS):
                total += product[row, k] * left[column, k]
            out[row, column] = total
            out[column, row] = total


@compiled
def predict(filter: AttitudeFilter, gyro_rad_s: Vector3, noise: FilterNoise, dt_s: float) -> None:
    """Turn the attitude by the gyro without its bias, and propagate the covariance."""
    bias, p = filter.bias_rad_s, filter.covariance
    rates = Vector3(gyro_rad_s.x - bias[0], gyro_rad_s.y - bias[1], gyro_rad_s.z - bias[2])
    turned = quaternion_product(quaternion_of(filter.attitude), rotation_over(rates, dt_s))
    _store_quaternion(filter.attitude, normalised(turned))
    step = np.zeros((ERRORS, ERRORS))
    old = np.empty((ERRORS, ERRORS))
    _transition(step, rates, dt_s)
    for row in range(ERRORS):
        for column in range(ERRORS):
            old[row, column] = p[row, column]
    _sandwich(p, step, old)
    for axis in range(3):
        filter.covariance[axis, axis] += noise.gyro * dt_s
        p[axis + 3, axis + 3] += noise.bias * dt_s


@compiled
def _fuse_axis(
    filter: AttitudeFilter, h: Annotated[FloatArray, 3], innovation: float, variance: float
) -> float:
    """Fuse a scalar that depends on the attitude error; return the test ratio. Joseph's form is not needed here."""
    gain = np.zeros(ERRORS)
    total = variance
    for row in range(ERRORS):
        for k in range(3):
            gain[row] += filter.covariance[row, k] * h[k]
    for k in range(3):
        total += h[k] * gain[k]
    if not total > 0.0:
        return math.inf
    for row in range(ERRORS):
        for column in range(row + 1):
            change = gain[row] * gain[column] / total
            filter.covariance[row, column] -= change
            if column != row:
                filter.covariance[column, row] = filter.covariance[row, column]
    ratio = innovation / total
    error = Vector3(gain[0] * ratio, gain[1] * ratio, gain[2] * ratio)
    q = quaternion_product(quaternion_of(filter.attitude), rotation_over(error, 1.0))
    _store_quaternion(filter.attitude, normalised(q))
    for axis in range(3):
        filter.bias_rad_s[axis] += gain[axis + 3] * ratio
    return innovation * ratio


@compiled
def attitude_filter_step(
    filter: AttitudeFilter, gyro_rad_s: Vector3, specific_force: Vector3, noise: FilterNoise, dt_s: float
) -> float:
    """Run an extended Kalman filter of attitude and gyro bias for a tick; return the largest test ratio."""
    predict(filter, gyro_rad_s, noise, dt_s)
    force = math.sqrt(specific_force.x * specific_force.x + specific_force.y * specific_force.y
                      + specific_force.z * specific_force.z)  # fmt: skip
    if not force > 1e-3:
        return 0.0
    down = rotate(conjugate(quaternion_of(filter.attitude)), Vector3(0.0, 0.0, 1.0))
    expected, measured = np.zeros(3), np.zeros(3)
    expected[0], expected[1], expected[2] = down
    measured[0] = -specific_force.x / force
    measured[1] = -specific_force.y / force
    measured[2] = -specific_force.z / force
    slope = np.zeros((3, 3))
    slope[0, 1], slope[0, 2] = -down.z, down.y
    slope[1, 0], slope[1, 2] = down.z, -down.x
    slope[2, 0], slope[2, 1] = -down.y, down.x
    worst = 0.0
    for axis in range(3):
        ratio = _fuse_axis(filter, slope[axis], measured[axis] - expected[axis], noise.direction)
        worst = max(worst, ratio)
    return worst


# ------------------------------------------------------------------ covariance of 24 states

STATES = 24


class Covariance(NamedTuple):
    """Covariance of 24 states, and room for a product."""

    p: Annotated[FloatArray, STATES, STATES]
    scratch: Annotated[FloatArray, STATES, STATES]


class NavigationFilter(NamedTuple):
    """States, covariance and the time since the last reset [s]."""

    x: Annotated[FloatArray, STATES]
    covariance: Covariance


@compiled
def propagate(filter: NavigationFilter, f: Annotated[FloatArray, STATES, STATES], variance: float) -> None:
    """Propagate the covariance in place, P = F·P·Fᵀ + q·I, and keep it symmetric."""
    p, product = filter.covariance.p, filter.covariance.scratch
    for row in range(p.shape[0]):
        for column in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += f[row, k] * p[k, column]
            product[row, column] = total
    for row in range(STATES):
        for column in range(row, STATES):
            total = variance if row == column else 0.0
            for k in range(STATES):
                total += product[row, k] * f[column, k]
            p[row, column] = total
            p[column, row] = total


@compiled
def fuse(filter: NavigationFilter, index: int, measured: float, variance: float) -> float:
    """Fuse a measurement of one state, found by its index; return the test ratio."""
    p, ratio = filter.covariance.p, 0.0
    gain = np.zeros(STATES)
    for state in range(STATES):
        if state != index:
            continue
        total = p[state, state] + variance
        innovation = measured - filter.x[state]
        ratio = innovation * innovation / total
        for row in range(STATES):
            gain[row] = p[row, state] / total
        for row in range(STATES):
            filter.x[row] += gain[row] * innovation
            for column in range(row + 1):
                p[row, column] -= gain[row] * gain[column] * total
                p[column, row] = p[row, column]
    return ratio


FILTERS = {"attitude filter": attitude_filter_step, "covariance of 24 states": propagate, "fusion": fuse}
