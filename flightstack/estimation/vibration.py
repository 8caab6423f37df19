"""Vibration of an inertial sensor, from its last samples."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.estimation.imu_track import WINDOW, TrackArray


class Vibration(NamedTuple):
    """Vibration of an inertial sensor, by the measures of PX4's topic ``vehicle_imu_status``.

    Means over the window; zero before two samples.
    """

    coning_rad2: float
    """Size of the cross product of successive delta angles."""
    gyro_rad_s: float
    """Size of the change of the rates from one sample to the next."""
    accel_m_s2: float
    """The same of the specific force."""


@compiled
def _size(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


@compiled
def vibration_kernel(memory: TrackArray) -> Vibration:
    """Return the vibration in the samples of a track."""
    track = memory[0]
    rows, count = track["rows"], min(track["taken"], WINDOW)
    if count < 2:
        return Vibration(0.0, 0.0, 0.0)
    oldest = track["taken"] - count
    coning = gyro = accel = 0.0
    for k in range(oldest + 1, oldest + count):
        last, row = rows[(k - 1) % WINDOW], rows[k % WINDOW]
        a, b, da_s, db_s = last["rates_rad_s"], row["rates_rad_s"], last["dt_s"], row["dt_s"]
        f, g = last["force_m_s2"], row["force_m_s2"]
        ax, ay, az = a[0] * da_s, a[1] * da_s, a[2] * da_s
        bx, by, bz = b[0] * db_s, b[1] * db_s, b[2] * db_s
        coning += _size(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        gyro += _size(b[0] - a[0], b[1] - a[1], b[2] - a[2])
        accel += _size(g[0] - f[0], g[1] - f[1], g[2] - f[2])
    return Vibration(coning / (count - 1), gyro / (count - 1), accel / (count - 1))
