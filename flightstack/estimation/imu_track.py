"""The last samples of an inertial sensor, as rows: a row costs a tenth of a sample of named values."""

from __future__ import annotations

import struct

import numpy as np

from flightstack.core.contract import FloatArray, Vector3
from flightstack.estimation.sensor_samples import ImuSample

IMU_SIZE = 8
"""Array form of an IMU sample: time, duration, rate (3), specific force (3)."""
WINDOW = 100
"""Samples that are kept, of which the vibration is computed; the length of PX4's filter."""
IMU_MISSING_S = 0.04
"""Age of the newest sample at which the sensor is missing; before it, the rotor speeds are not yet held."""
_pack = struct.Struct(f"={IMU_SIZE}d").pack_into


class ImuTrack:
    """A ring of rows, and the number of samples that repeated the one before."""

    def __init__(self) -> None:
        self.repeats = 0
        """Number of successive samples whose rates or forces equal those before."""
        self._rows = np.zeros((WINDOW, IMU_SIZE))
        self._each = [(row, row.data) for row in self._rows]
        self._count = 0
        self._rates: tuple[float, ...] = ()
        self._forces: tuple[float, ...] = ()

    def take(
        self, time_s: float, dt_s: float, rates: tuple[float, ...], forces: tuple[float, ...]
    ) -> FloatArray:
        """Store a sample, as ``ImuSample``; return its row, shape (8,), valid until 99 more were taken."""
        repeats = rates == self._rates or forces == self._forces
        self.repeats = self.repeats + 1 if repeats else 0
        self._rates, self._forces = rates, forces
        row, memory = self._each[self._count % WINDOW]
        _pack(memory, 0, time_s, dt_s, *rates, *forces)  # a third of the time of an assignment
        self._count += 1
        return row

    @property
    def newest(self) -> ImuSample | None:
        """The newest sample; None before the first one."""
        if not self._count:
            return None
        time_s, dt_s, *values = self._rows[(self._count - 1) % WINDOW].tolist()
        return ImuSample(time_s, dt_s, Vector3(*values[:3]), Vector3(*values[3:]))

    @property
    def rows(self) -> FloatArray:
        """The last samples, oldest first, shape (n, 8)."""
        if self._count <= WINDOW:
            return self._rows[: self._count]
        return np.roll(self._rows, -(self._count % WINDOW), axis=0)
