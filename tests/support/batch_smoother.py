"""Batch least-squares smoother of a short flight: the accuracy limit of an estimator with the same sensors.

Maximum a posteriori over all keyframes at once, by Gauss-Newton on sparse normal equations. Between keyframes the IMU
is preintegrated, with the residuals of Forster et al. 2017 (``preintegration``). The attitude error is on the right:
true attitude = attitude * exp(turn). It shares no code with ``flightstack.estimation``.

World frame NED, body frame FRD, SI units, gauss. A flight has n keyframes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu
from scipy.spatial.transform import Rotation

from flightstack.core.contract import FloatArray
from tests.support.preintegration import (
    ACCEL_ERRORS,
    GYRO_ERRORS,
    POSITION,
    TURN,
    VELOCITY,
    Flight,
    Preintegrated,
    by_rows,
    preintegrated,
    product,
    skew,
    transposed,
    turn_of,
    turned,
)

GRAVITY = np.array([0.0, 0.0, 9.80665])
GYRO_BIAS, ACCEL_BIAS, GNSS_DRIFT, BARO_BIAS = slice(9, 12), slice(12, 15), slice(15, 18), slice(18, 19)
SIZE = 19
"""Unknowns of a keyframe; those from 9 on are the slow errors of the sensors."""
GYRO_MATRIX, ACCEL_MATRIX, SOFT_IRON = slice(0, 9), slice(9, 18), slice(18, 27)
HARD_IRON, CURRENT_FIELD = slice(27, 30), slice(30, 33)
CONSTANTS = 33
"""Unknowns of the whole flight, matrices by rows: E of gyro and accelerometer in true = measured - E measured - bias,
and the magnetometer's S, h and c in measured = (I + S) field + h + c current."""
REST_VELOCITY_M_S, REST_TURN_RAD = 1e-3, 1e-5
"""Standard deviations of the motion of a vehicle at rest, from one keyframe to the next."""
_MOST_ITERATIONS = 20
_CONVERGED = 1e-4
"""Squared length of the last step, in standard deviations of the solution."""


class Noise(NamedTuple):
    """Model of the sensors: standard deviations; densities and walks over the square root of a time."""

    gyro: float
    accel: float
    """Noise densities [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)]."""
    mag: float
    altitude: float
    gnss_position: FloatArray
    gnss_velocity: FloatArray
    slow: FloatArray
    """Slow errors at the first keyframe, in the order of the unknowns from ``GYRO_BIAS`` on, shape (10,)."""
    slow_walk: FloatArray
    """Their random walks [unit/sqrt(s)], shape (10,)."""
    slow_time_s: FloatArray
    """Their correlation times; infinite for a random walk, shape (10,)."""
    constants: FloatArray
    """Constant errors, shape (33,)."""


class States(NamedTuple):
    """Values of all unknowns: rotation matrices (n, 3, 3), the other states (n, 16) from velocity on, constants."""

    attitude: FloatArray
    others: FloatArray
    constants: FloatArray


class Solution(NamedTuple):
    """States of the smoother, and what it claims of them."""

    states: States
    squares: float
    """Sum of the squared residuals at the solution, chi-square distributed for a true model."""
    freedom: int
    """Residuals less unknowns."""
    normal: SuperLU
    scale: FloatArray


Block: TypeAlias = tuple[FloatArray, FloatArray]
"""First column of each row's block, shape (k,), and derivatives, shape (k, r, c)."""


class Factor(NamedTuple):
    """Residuals in standard deviations, shape (k, r), and their derivatives by the unknowns."""

    residual: FloatArray
    blocks: list[Block]


def _columns(keyframes: FloatArray, part: slice) -> FloatArray:
    return keyframes * SIZE + part.start


def _inertial(states: States, imu: Preintegrated) -> Factor:
    """Residuals of turn, velocity and position of the IMU (Forster 2017, equation 45)."""
    count, dt = len(imu.turn), imu.time_s
    first, constant = np.arange(count), np.full(count, len(states.attitude) * SIZE)
    body = transposed(states.attitude[:-1])
    velocity, position = states.others[:, :3], states.others[:, 3:6]
    wandering, fixed = states.others[:-1, 6:12], np.tile(states.constants[:18], (count, 1))
    errors = np.column_stack(
        [wandering[:, :3], fixed[:, GYRO_MATRIX], wandering[:, 3:], fixed[:, ACCEL_MATRIX]]
    )
    change = product(imu.by_errors, errors)
    gained = product(body, velocity[1:] - velocity[:-1] - GRAVITY * dt)
    moved = product(body, position[1:] - position[:-1] - velocity[:-1] * dt - 0.5 * GRAVITY * dt * dt)
    relative = body @ states.attitude[1:]
    off = turn_of(transposed(imu.turn @ turned(change[:, TURN])) @ relative)
    residual = np.column_stack([off, gained - imu.velocity, moved - imu.position])
    residual[:, 3:] -= change[:, 3:]
    before, after = np.zeros((count, 9, 9)), np.zeros((count, 9, 9))
    before[:, TURN, TURN], after[:, TURN, TURN] = -transposed(relative), np.eye(3)
    before[:, VELOCITY, TURN], before[:, POSITION, TURN] = skew(gained), skew(moved)
    before[:, VELOCITY, VELOCITY], after[:, VELOCITY, VELOCITY] = -body, body
    before[:, POSITION, VELOCITY] = -body * dt
    before[:, POSITION, POSITION], after[:, POSITION, POSITION] = -body, body
    by_gyro, by_accel = (-imu.root @ imu.by_errors[..., part] for part in (GYRO_ERRORS, ACCEL_ERRORS))
    return Factor(
        product(imu.root, residual),
        [
            (_columns(first, TURN), imu.root @ before),
            (_columns(first + 1, TURN), imu.root @ after),
            (_columns(first, GYRO_BIAS), by_gyro[..., :3]),
            (_columns(first, ACCEL_BIAS), by_accel[..., :3]),
            (constant + GYRO_MATRIX.start, by_gyro[..., 3:]),
            (constant + ACCEL_MATRIX.start, by_accel[..., 3:]),
        ],
    )


def _slow_errors(states: States, noise: Noise, time_s: float) -> Iterable[Factor]:
    """Yield the slow errors from one keyframe to the next, at the first one, and the constants."""
    slow, count = states.others[:, 6:], len(states.attitude) - 1
    decay, spread = np.exp(-time_s / noise.slow_time_s), noise.slow_walk * np.sqrt(time_s)
    eye = np.tile(np.eye(len(decay)), (count, 1, 1))
    first = np.arange(count)
    yield Factor(
        (slow[1:] - decay * slow[:-1]) / spread,
        [
            (_columns(first, GYRO_BIAS), -eye * (decay / spread)[:, None]),
            (_columns(first + 1, GYRO_BIAS), eye / spread[:, None]),
        ],
    )
    for value, spread, column in (
        (slow[0], noise.slow, GYRO_BIAS.start),
        (states.constants, noise.constants, len(states.attitude) * SIZE),
    ):
        yield Factor((value / spread)[None], [(np.array([column]), np.diag(1.0 / spread)[None])])


def _gnss(states: States, flight: Flight, noise: Noise) -> Iterable[Factor]:
    """Yield the residuals of position, with its slow error, and velocity."""
    keyframes = np.arange(len(states.attitude))
    place, drift = states.others[:, 3:6], states.others[:, 12:15]
    by = np.tile(np.diag(1.0 / noise.gnss_position), (len(keyframes), 1, 1))
    yield Factor(
        (place + drift - flight.gnss_position) / noise.gnss_position,
        [(_columns(keyframes, POSITION), by), (_columns(keyframes, GNSS_DRIFT), by)],
    )
    by = np.tile(np.diag(1.0 / noise.gnss_velocity), (len(keyframes), 1, 1))
    residual = (states.others[:, :3] - flight.gnss_velocity) / noise.gnss_velocity
    yield Factor(residual, [(_columns(keyframes, VELOCITY), by)])


def _magnetometer(states: States, flight: Flight, imu: Preintegrated, noise: Noise) -> Factor:
    """Residuals of the mean field of each interval: (I + S) M R^T field + h + c I."""
    used = np.flatnonzero(imu.mag_count)
    fixed = len(states.attitude) * SIZE
    weight = np.sqrt(imu.mag_count[used]) / noise.mag
    iron = np.eye(3) + states.constants[SOFT_IRON].reshape(3, 3)
    field = product(transposed(states.attitude[used]), flight.earth_field)
    seen = product(imu.mag_turn[used], field)
    current = flight.current[used][:, None]
    offset = states.constants[HARD_IRON] + current * states.constants[CURRENT_FIELD]
    residual = product(iron, seen) + offset - imu.mag[used]
    each = weight[:, None, None]
    return Factor(
        residual * weight[:, None],
        [
            (_columns(used, TURN), iron @ imu.mag_turn[used] @ skew(field) * each),
            (np.full(len(used), fixed + SOFT_IRON.start), by_rows(seen) * each),
            (np.full(len(used), fixed + HARD_IRON.start), np.eye(3) * each),
            (np.full(len(used), fixed + CURRENT_FIELD.start), np.eye(3) * current[..., None] * each),
        ],
    )


def _barometer(states: States, imu: Preintegrated, noise: Noise) -> Factor:
    """Residuals of the mean altitude of each interval; its samples follow the keyframe by the preintegrated motion."""
    used = np.flatnonzero(imu.altitude_count)
    weight = np.sqrt(imu.altitude_count[used]) / noise.altitude
    age, square, moved = imu.altitude_age[used, 0], imu.altitude_age[used, 1], imu.altitude_age[used, 2:]
    attitude, others = states.attitude[used], states.others[used]
    down = others[:, 5] + others[:, 2] * age + 0.5 * GRAVITY[2] * square + product(attitude, moved)[:, 2]
    by = np.zeros((len(used), 1, SIZE))
    by[:, 0, TURN] = (attitude @ skew(moved))[:, 2]
    by[:, 0, VELOCITY.start + 2], by[:, 0, POSITION.start + 2], by[:, 0, BARO_BIAS] = -age, -1.0, 1.0
    residual = (others[:, 15] - down - imu.altitude[used]) * weight
    return Factor(residual[:, None], [(_columns(used, TURN), by * weight[:, None, None])])


def _rest(states: States, flight: Flight) -> Iterable[Factor]:
    """Yield the velocity at rest, and the turn between two keyframes at rest, which are zero."""
    still = np.flatnonzero(flight.is_rest)
    by = np.tile(np.eye(3) / REST_VELOCITY_M_S, (len(still), 1, 1))
    yield Factor(states.others[still, :3] / REST_VELOCITY_M_S, [(_columns(still, VELOCITY), by)])
    pair = np.flatnonzero(flight.is_rest[1:] & flight.is_rest[:-1])
    relative = transposed(states.attitude[pair]) @ states.attitude[pair + 1]
    by = np.tile(np.eye(3) / REST_TURN_RAD, (len(pair), 1, 1))
    blocks = [(_columns(pair, TURN), -transposed(relative) / REST_TURN_RAD), (_columns(pair + 1, TURN), by)]
    yield Factor(turn_of(relative) / REST_TURN_RAD, blocks)


def _assembled(factors: Iterable[Factor], unknowns: int) -> tuple[FloatArray, sparse.csr_matrix]:
    """Return all residuals and their sparse Jacobian."""
    residuals, rows, columns, values, start = [], [], [], [], 0
    for factor in factors:
        count, size = factor.residual.shape
        row = start + np.arange(count * size).reshape(count, size, 1)
        for first, block in factor.blocks:
            column = first[:, None, None] + np.arange(block.shape[2])
            rows.append(np.broadcast_to(row, block.shape).ravel())
            columns.append(np.broadcast_to(column, block.shape).ravel())
            values.append(block.ravel())
        residuals.append(factor.residual.ravel())
        start += count * size
    places = np.concatenate(rows), np.concatenate(columns)
    matrix = sparse.csr_matrix((np.concatenate(values), places), shape=(start, unknowns))
    return np.concatenate(residuals), matrix


def started(flight: Flight, imu: Preintegrated) -> States:
    """Return the first guess: vertical and field of the first interval, then the gyro; motion is that of GNSS."""
    down, field = -flight.accel[0].mean(axis=0), imu.mag[0]
    measured, known = np.array([down, field]), np.array([GRAVITY, flight.earth_field])
    units = [rows / np.linalg.norm(rows, axis=1)[:, None] for rows in (known, measured)]
    attitude = [Rotation.align_vectors(*units, weights=[100.0, 1.0])[0].as_matrix()]
    for turn in imu.turn:
        attitude.append(attitude[-1] @ turn)
    slow = np.zeros((len(attitude), 10))
    slow[:, 9] = imu.altitude[0] + flight.gnss_position[0, 2]
    motion = np.column_stack([flight.gnss_velocity, flight.gnss_position, slow])
    return States(np.array(attitude), motion, np.zeros(CONSTANTS))


def smoothed(flight: Flight, noise: Noise, guess: States | None = None) -> Solution:
    """Return the states of largest posterior probability, from a first guess if there is one.

    Raise ArithmeticError if they are not found.
    """
    imu = preintegrated(flight, noise.gyro, noise.accel)
    states, count = guess or started(flight, imu), len(flight.gnss_position)
    for _ in range(_MOST_ITERATIONS):
        factors = [
            _inertial(states, imu), *_slow_errors(states, noise, imu.time_s), *_gnss(states, flight, noise),
            _magnetometer(states, flight, imu, noise), _barometer(states, imu, noise), *_rest(states, flight),
        ]  # fmt: skip
        residual, jacobian = _assembled(factors, count * SIZE + CONSTANTS)
        scale = 1.0 / np.sqrt(np.asarray(jacobian.multiply(jacobian).sum(axis=0)).ravel())
        scaled = jacobian @ sparse.diags(scale)
        normal = splu((scaled.T @ scaled).tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)
        slope = scaled.T @ residual
        step = -normal.solve(slope)
        if -step @ slope < _CONVERGED:
            return Solution(states, float(residual @ residual), len(residual) - len(step), normal, scale)
        states = _moved(states, step * scale)
    raise ArithmeticError(f"the smoother did not converge in {_MOST_ITERATIONS} iterations")


def _moved(states: States, step: FloatArray) -> States:
    each = step[:-CONSTANTS].reshape(-1, SIZE)
    attitude = states.attitude @ turned(each[:, TURN])
    return States(attitude, states.others + each[:, 3:], states.constants + step[-CONSTANTS:])


def covariance(solution: Solution, first: int, size: int = SIZE) -> FloatArray:
    """Return the covariance of ``size`` unknowns from column ``first`` on, such as ``SIZE`` times a keyframe."""
    chosen = np.zeros((len(solution.scale), size))
    chosen[first : first + size] = np.eye(size)
    scale = solution.scale[first : first + size]
    inverse = solution.normal.solve(chosen)[first : first + size]
    return scale[:, None] * inverse * scale
