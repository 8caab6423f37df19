"""A flight in closed form, with errors of the sensors drawn from the smoother's own model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from flightstack.core.contract import FloatArray
from tests.support.batch_smoother import GRAVITY, Noise, States
from tests.support.preintegration import Flight, product, transposed, turn_of

STEP_S, SAMPLES, KEYFRAME_S = 0.0025, 40, 0.1
EARTH = np.array([0.215, 0.013, 0.43])
REST_S, GROWS_S = 2.0, 4.0
REST_KEYFRAMES = round(REST_S / KEYFRAME_S)
_MAG_EVERY, _BARO_EVERY = 4, 8


class Drawn(NamedTuple):
    """Measurements of a flight, and the true values of the smoother's unknowns."""

    flight: Flight
    truth: States


def _share(time_s: FloatArray) -> FloatArray:
    """Rise from 0 to 1 after the rest, with continuous third derivative."""
    s = np.clip((time_s - REST_S) / GROWS_S, 0.0, 1.0)
    return s**4 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))


def position(time_s: FloatArray) -> FloatArray:
    """Return the position [m], shape (k, 3)."""
    waves = [8.0 * np.sin(0.8 * time_s), 6.0 * np.sin(0.5 * time_s + 1.0), -3.0 + np.sin(0.4 * time_s)]
    return np.column_stack(waves) * _share(time_s)[:, None]


def velocity(time_s: FloatArray) -> FloatArray:
    """Return the velocity [m/s], shape (k, 3)."""
    return (position(time_s + 1e-4) - position(time_s - 1e-4)) / 2e-4


def attitude(time_s: FloatArray) -> FloatArray:
    """Return the rotation matrices body to world, shape (k, 3, 3)."""
    waves = [0.9 * np.sin(0.5 * time_s), 0.2 * np.sin(0.9 * time_s), 0.25 * np.sin(1.1 * time_s)]
    angles = np.column_stack(waves) * _share(time_s)[:, None] + [0.4, 0.02, -0.03]
    matrices: FloatArray = Rotation.from_euler("ZYX", angles).as_matrix()
    return matrices


def drawn(noise: Noise, keyframes: int, seed: int) -> Drawn:
    """Draw the errors of a flight."""
    rng = np.random.default_rng(seed)
    eye, count = np.eye(3), keyframes - 1
    at = KEYFRAME_S * np.arange(keyframes)
    slow, constants = _slow_errors(noise, keyframes, rng), noise.constants * rng.normal(size=33)
    gyro_matrix, accel_matrix, soft_iron = constants[:27].reshape(3, 3, 3)
    edges = STEP_S * np.arange(count * SAMPLES + 1)
    turns, speeds, ends = attitude(edges), velocity(edges), edges[1:]
    middle = attitude(0.5 * (edges[1:] + edges[:-1]))
    rate = turn_of(transposed(turns[:-1]) @ turns[1:]) / STEP_S
    force = product(transposed(middle), np.diff(speeds, axis=0) / STEP_S - GRAVITY)
    held = np.repeat(slow[:-1], SAMPLES, axis=0)
    densities = noise.gyro / np.sqrt(STEP_S), noise.accel / np.sqrt(STEP_S)
    gyro = (rate + held[:, :3] + rng.normal(0.0, densities[0], rate.shape)) @ np.linalg.inv(
        eye - gyro_matrix
    ).T
    accel = (force + held[:, 3:6] + rng.normal(0.0, densities[1], force.shape)) @ np.linalg.inv(
        eye - accel_matrix
    ).T
    field = product(transposed(turns[1:]), EARTH) @ (eye + soft_iron).T + constants[27:30]
    current = 0.4 + 15.0 * _share(at[:-1]) + 3.0 * np.sin(at[:-1])
    field = field + np.outer(np.repeat(current, SAMPLES), constants[30:])
    mag = np.where(_every(_MAG_EVERY, ends)[:, None], field + rng.normal(0.0, noise.mag, field.shape), np.nan)
    altitude = held[:, 9] - position(ends)[:, 2] + rng.normal(0.0, noise.altitude, len(ends))
    places, motion = position(at), velocity(at)
    flight = Flight(
        STEP_S,
        gyro.reshape(count, SAMPLES, 3),
        accel.reshape(count, SAMPLES, 3),
        mag.reshape(count, SAMPLES, 3),
        current,
        np.where(_every(_BARO_EVERY, ends), altitude, np.nan).reshape(count, SAMPLES),
        places + slow[:, 6:9] + noise.gnss_position * rng.normal(size=places.shape),
        motion + noise.gnss_velocity * rng.normal(size=motion.shape),
        np.arange(keyframes) < REST_KEYFRAMES,
        EARTH,
    )
    return Drawn(flight, States(attitude(at), np.column_stack([motion, places, slow]), constants))


def _every(steps: int, ends: FloatArray) -> FloatArray:
    has: FloatArray = np.arange(1, len(ends) + 1) % steps == 0
    return has


def _slow_errors(noise: Noise, keyframes: int, rng: np.random.Generator) -> FloatArray:
    decay, spread = np.exp(-KEYFRAME_S / noise.slow_time_s), noise.slow_walk * np.sqrt(KEYFRAME_S)
    rows = [noise.slow * rng.normal(size=10)]
    for _ in range(keyframes - 1):
        rows.append(decay * rows[-1] + spread * rng.normal(size=10))
    return np.array(rows)
