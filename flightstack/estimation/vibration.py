"""Vibration of an inertial sensor, by the measures of PX4's topic ``vehicle_imu_status``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray


class Vibration(NamedTuple):
    """Means over the window; zero before two samples."""

    coning_rad2: float = 0.0
    """Size of the cross product of successive delta angles."""
    gyro_rad_s: float = 0.0
    """Size of the change of the rates from one sample to the next."""
    accel_m_s2: float = 0.0
    """The same of the specific force."""


STILL = Vibration()


def vibration_of(rows: FloatArray) -> Vibration:
    """Return the vibration in successive samples, shape (n, 8): time, duration, rates, specific force."""
    if len(rows) < 2:
        return STILL
    with np.errstate(all="ignore"):  # absurd measurements
        angles = rows[:, 2:5] * rows[:, 1:2]
        change = np.diff(rows[:, 2:], axis=0)
        coning = _cross(angles[:-1], angles[1:])
        return Vibration(*(_mean_size(part) for part in (coning, change[:, :3], change[:, 3:])))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross products of rows; unlike NumPy's, with equal bits on every processor."""
    turned, back = (1, 2, 0), (2, 0, 1)
    product: FloatArray = a[:, turned] * b[:, back] - a[:, back] * b[:, turned]
    return product


def _mean_size(rows: FloatArray) -> float:
    x, y, z = rows.T
    return float(sum(np.sqrt(x * x + y * y + z * z).tolist()) / len(rows))
