"""Vibration of an inertial sensor, by the measures of PX4's topic ``vehicle_imu_status``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from flightstack.estimation.sensor_samples import ImuSample

WINDOW = 100
"""Samples that a measure averages, the length of PX4's filter."""


class Vibration(NamedTuple):
    """Means over the window; zero before two samples."""

    coning_rad2: float = 0.0
    """Size of the cross product of successive delta angles."""
    gyro_rad_s: float = 0.0
    """Size of the change of the rates from one sample to the next."""
    accel_m_s2: float = 0.0
    """The same of the specific force."""


STILL = Vibration()


def vibration_of(samples: Iterable[ImuSample]) -> Vibration:
    """Return the vibration in successive samples."""
    rows = np.array([(s.dt_s, *s.gyro_frd_rad_s, *s.accel_frd_m_s2) for s in samples])
    if len(rows) < 2:
        return STILL
    with np.errstate(all="ignore"):  # absurd measurements
        angles = rows[:, 1:4] * rows[:, :1]
        change = np.diff(rows[:, 1:], axis=0)
        coning = np.linalg.norm(np.cross(angles[:-1], angles[1:]), axis=1)
        gyro, accel = (np.linalg.norm(part, axis=1) for part in (change[:, :3], change[:, 3:]))
        return Vibration(float(coning.mean()), float(gyro.mean()), float(accel.mean()))
