"""IMU preintegrated between keyframes, for the batch smoother, with the slower sensors between them.

Forster, Carlone, Dellaert and Scaramuzza, "On-Manifold Preintegration for Real-Time Visual-Inertial Odometry", IEEE
Transactions on Robotics 33(1), 2017. The error of the turn is on its right: true turn = turn * exp(error). World frame
NED, body frame FRD, SI units, gauss. A flight has n keyframes, and n - 1 intervals of m IMU samples each.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from flightstack.core.contract import FloatArray

TURN, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)
"""Errors of the motion."""
GYRO_ERRORS, ACCEL_ERRORS = slice(0, 12), slice(12, 24)
"""Errors of the IMU: bias, then the matrix of scale and alignment, row by row."""


class Flight(NamedTuple):
    """Measurements of a flight, each at the time when it was taken."""

    step_s: float
    """Time between two IMU samples."""
    gyro: FloatArray
    """Mean rates of each IMU step [rad/s], shape (n - 1, m, 3)."""
    accel: FloatArray
    """Mean specific force of each step [m/s^2], shape (n - 1, m, 3)."""
    mag: FloatArray
    """Field at the end of a step [gauss], NaN without a measurement, shape (n - 1, m, 3)."""
    current: FloatArray
    """Mean current of the battery in each interval [A], shape (n - 1,)."""
    altitude: FloatArray
    """Altitude of the barometer [m] at the end of a step, NaN without a measurement, shape (n - 1, m)."""
    gnss_position: FloatArray
    """Position of GNSS at each keyframe [m], shape (n, 3)."""
    gnss_velocity: FloatArray
    """Velocity of GNSS at each keyframe [m/s], shape (n, 3)."""
    is_rest: npt.NDArray[np.bool_]
    """True for a keyframe of a vehicle at rest, shape (n,)."""
    earth_field: FloatArray
    """Earth's field, which is known [gauss], shape (3,)."""


class Preintegrated(NamedTuple):
    """IMU between two keyframes in the body frame of the first, and the slower sensors in it, by interval."""

    time_s: float
    turn: FloatArray
    velocity: FloatArray
    position: FloatArray
    by_errors: FloatArray
    """Change of turn, velocity and position by gyro bias, gyro matrix, accel bias and accel matrix, (n - 1, 9, 24)."""
    root: FloatArray
    """Square root of the information, shape (n - 1, 9, 9)."""
    mag_turn: FloatArray
    """Mean matrix from the first body frame to that of the magnetometer's samples, shape (n - 1, 3, 3)."""
    mag: FloatArray
    mag_count: FloatArray
    altitude_age: FloatArray
    """Means of time, squared time, and preintegrated position, at the barometer's samples, shape (n - 1, 5)."""
    altitude: FloatArray
    altitude_count: FloatArray


def skew(vectors: FloatArray) -> FloatArray:
    """Return the matrices of the cross product, shape (..., 3, 3)."""
    zero = np.zeros(vectors.shape[:-1])
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vectors.shape, 3)


def turned(vectors: FloatArray) -> FloatArray:
    """Return the rotation matrices of rotation vectors, shape (k, 3, 3)."""
    matrices: FloatArray = Rotation.from_rotvec(vectors).as_matrix()
    return matrices


def turn_of(matrices: FloatArray) -> FloatArray:
    """Return the rotation vectors of rotation matrices, shape (k, 3)."""
    vectors: FloatArray = Rotation.from_matrix(matrices).as_rotvec()
    return vectors


def product(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return the products of matrices and vectors, one by one."""
    products: FloatArray = np.einsum("...ij,...j->...i", matrices, vectors)
    return products


def transposed(matrices: FloatArray) -> FloatArray:
    """Return the transposed matrices."""
    return np.swapaxes(matrices, -1, -2)


def by_rows(vectors: FloatArray) -> FloatArray:
    """Return the derivative of E u by the rows of E, shape (k, 3, 9)."""
    return np.einsum("ij,kl->kijl", np.eye(3), vectors).reshape(len(vectors), 3, 9)


def preintegrated(flight: Flight, gyro_noise: float, accel_noise: float) -> Preintegrated:
    """Integrate the IMU over all intervals at once (equations 37 and 38; covariance as in its appendix)."""
    count, samples = flight.gyro.shape[:2]
    dt = flight.step_s
    turn, velocity, position = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), np.zeros((count, 3))
    by_errors, covariance = np.zeros((count, 9, 24)), np.zeros((count, 9, 9))
    densities = np.repeat([gyro_noise**2, accel_noise**2], 3) / dt
    turns, places = [], []
    for rate, force in zip(flight.gyro.swapaxes(0, 1), flight.accel.swapaxes(0, 1), strict=True):
        middle = turn @ turned(0.5 * dt * rate)
        push = product(middle, force)
        transition, gain = _step_derivatives(rate, force, middle, dt)
        errors = np.zeros((count, 6, 24))
        errors[:, :3, GYRO_ERRORS] = -_by_bias_and_rows(rate)
        errors[:, 3:, ACCEL_ERRORS] = -_by_bias_and_rows(force)
        by_errors = transition @ by_errors + gain @ errors
        covariance = transition @ covariance @ transposed(transition) + (gain * densities) @ transposed(gain)
        position = position + velocity * dt + 0.5 * push * dt * dt
        velocity = velocity + push * dt
        turn = turn @ turned(dt * rate)
        turns.append(turn)
        places.append(position)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    slower = (*_mean_mag(flight, np.array(turns)), *_mean_altitude(flight, np.array(places)))
    return Preintegrated(samples * dt, turn, velocity, position, by_errors, root, *slower)


def _by_bias_and_rows(vectors: FloatArray) -> FloatArray:
    """Return the derivative of b + E u by b and the rows of E, shape (k, 3, 12)."""
    return np.concatenate([np.tile(np.eye(3), (len(vectors), 1, 1)), by_rows(vectors)], axis=2)


def _step_derivatives(
    rate: FloatArray, force: FloatArray, middle: FloatArray, dt: float
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of a step by the errors before it, (k, 9, 9), and by rate and force, (k, 9, 6)."""
    eye, count = np.eye(3), len(rate)
    by_turn = -middle @ skew(force) * dt
    transition, gain = np.tile(np.eye(9), (count, 1, 1)), np.zeros((count, 9, 6))
    transition[:, TURN, TURN] = transposed(turned(dt * rate))
    transition[:, VELOCITY, TURN] = by_turn @ transposed(turned(0.5 * dt * rate))
    gain[:, TURN, :3] = eye * dt
    gain[:, VELOCITY, :3], gain[:, VELOCITY, 3:] = 0.5 * dt * by_turn, middle * dt
    transition[:, POSITION, TURN] = 0.5 * dt * transition[:, VELOCITY, TURN]
    transition[:, POSITION, VELOCITY] = eye * dt
    gain[:, POSITION] = 0.5 * dt * gain[:, VELOCITY]
    return transition, gain


def _mean_mag(flight: Flight, turns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean matrices, mean field and number of samples; ``turns`` by step and interval."""
    has = np.isfinite(flight.mag[..., 0])
    count = has.sum(axis=1)
    least = np.maximum(count, 1)
    matrix = np.einsum("ks,skij->kji", has.astype(float), turns) / least[:, None, None]
    return matrix, np.nansum(flight.mag, axis=1) / least[:, None], count


def _mean_altitude(flight: Flight, places: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean times and preintegrated positions, mean altitude and number of samples."""
    has = np.isfinite(flight.altitude)
    count = has.sum(axis=1)
    least = np.maximum(count, 1)
    age = flight.step_s * np.arange(1, has.shape[1] + 1)
    columns = (has @ age, has @ age**2, np.einsum("ks,ski->ki", has.astype(float), places))
    return np.column_stack(columns) / least[:, None], np.nansum(flight.altitude, axis=1) / least, count
