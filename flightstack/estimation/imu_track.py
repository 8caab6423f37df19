"""The last samples of an inertial sensor, as rows: a row costs a tenth of a sample of named values."""

from __future__ import annotations

import struct
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, Vector3
from flightstack.estimation.sensor_samples import ImuSample

IMU_SIZE = 8
"""Array form of an IMU sample: time, duration, rate (3), specific force (3)."""
WINDOW = 100
"""Samples that are kept, of which the vibration is computed; the length of PX4's filter."""
IMU_MISSING_S = 0.04
"""Age of the newest sample at which the sensor is missing; before it, the rotor speeds are not yet held."""
RECORD_SIZE = 7
"""Recorded form of a sample: duration [µs], rate (3), specific force (3)."""
_COUNT, _REPEATS, _COUNTERS = 0, 1, 2
_RATE, _FORCE = 2, 5
_pack = struct.Struct(f"={IMU_SIZE}d").pack_into

Counters: TypeAlias = np.ndarray[tuple[int], np.dtype[np.int64]]
SingleArray: TypeAlias = np.ndarray[Any, np.dtype[np.float32]]


@compiled
def _equals(a: FloatArray, b: FloatArray, at: int) -> bool:
    return bool(a[at] == b[at] and a[at + 1] == b[at + 1] and a[at + 2] == b[at + 2])


@compiled
def _is_zero(a: FloatArray, at: int) -> bool:
    return bool(a[at] == 0.0 and a[at + 1] == 0.0 and a[at + 2] == 0.0)


@compiled
def count_sample(rows: FloatArray, counters: Counters) -> None:
    """Count the sample in the next row of the ring, and whether it repeats the one before.

    An ideal sensor at rest repeats zero rates and a constant force, and is not stuck.
    """
    count = counters[_COUNT]
    if count > 0:
        row, last = rows[count % WINDOW], rows[(count - 1) % WINDOW]
        rates, forces = _equals(row, last, _RATE), _equals(row, last, _FORCE)
        is_ideal = rates and forces and _is_zero(row, _RATE) and not _is_zero(row, _FORCE)
        counters[_REPEATS] = counters[_REPEATS] + 1 if (rates or forces) and not is_ideal else 0
    counters[_COUNT] = count + 1


@compiled
def take_wire(
    rows: FloatArray, counters: Counters, wire: SingleArray, time_s: float, step_us: int, record: FloatArray
) -> None:
    """Store a sample from the values of HIL_SENSOR, of which the first are specific force and rates; fill ``record``.

    ``rows`` (100, 8) and ``counters`` (2,) are those of a track.
    """
    row = rows[counters[_COUNT] % WINDOW]
    row[0], row[1], record[0] = time_s, step_us * 1e-6, step_us
    for i in range(3):
        row[_RATE + i] = record[1 + i] = wire[3 + i]
        row[_FORCE + i] = record[4 + i] = wire[i]
    count_sample(rows, counters)


@compiled
def mean_since(rows: FloatArray, counters: Counters, time_s: float, mean: FloatArray) -> int:
    """Write the mean rates and specific force of the samples after ``time_s`` to ``mean``, (6,); return their number.

    The track has the last 100 samples.
    """
    for i in range(6):
        mean[i] = 0.0
    count = 0
    for age in range(1, min(counters[_COUNT], WINDOW) + 1):
        row = rows[(counters[_COUNT] - age) % WINDOW]
        if row[0] <= time_s:
            break
        count += 1
        for i in range(6):
            mean[i] += row[_RATE + i]
    for i in range(6):
        mean[i] /= max(count, 1)
    return count


class ImuTrack:
    """A ring of rows, and the number of samples that repeated the one before."""

    def __init__(self) -> None:
        self.ring = np.zeros((WINDOW, IMU_SIZE))
        """The samples, of which the next one follows the newest, as ``take_wire`` counts them."""
        self._each = [(row, row.data) for row in self.ring]
        self.counters: Counters = np.zeros(_COUNTERS, np.int64)
        """Samples so far, and repeats."""
        self._numbers = self.counters.data  # a number of an array takes four times as long to read
        self._take_wire: Any = None
        self._mean_since: Any = None
        self._mean: FloatArray = np.zeros(6)

    @property
    def repeats(self) -> int:
        """Number of successive samples whose rates or forces equal those before."""
        return self._numbers[_REPEATS]

    def take(
        self, time_s: float, dt_s: float, rates: tuple[float, ...], forces: tuple[float, ...]
    ) -> FloatArray:
        """Store a sample, as ``ImuSample``; return its row, shape (8,), valid until 99 more were taken."""
        row, memory = self._each[self._numbers[_COUNT] % WINDOW]
        _pack(memory, 0, time_s, dt_s, *rates, *forces)  # a third of the time of an assignment
        count_sample(self.ring, self.counters)
        return row

    def take_wire(self, time_s: float, step_us: int, wire: SingleArray, record: FloatArray) -> FloatArray:
        """Store a sample from the values of HIL_SENSOR, and in ``record``, shape (7,); return its row as ``take``."""
        if self._take_wire is None:
            self._take_wire = direct(take_wire, self.ring, self.counters, wire, time_s, step_us, record)
        row = self._each[self._numbers[_COUNT] % WINDOW][0]
        self._take_wire(self.ring, self.counters, wire, time_s, step_us, record)
        return row

    def mean_since(self, time_s: float) -> tuple[Vector3, Vector3] | None:
        """Return the mean rates and specific force of the samples after ``time_s``, the last 100 at most, or None."""
        if self._mean_since is None:
            self._mean_since = direct(mean_since, self.ring, self.counters, time_s, self._mean)
        if not self._mean_since(self.ring, self.counters, time_s, self._mean):
            return None
        values = self._mean.tolist()
        return Vector3(*values[:3]), Vector3(*values[3:])

    @property
    def newest(self) -> ImuSample | None:
        """The newest sample; None before the first one."""
        count = self._numbers[_COUNT]
        if not count:
            return None
        time_s, dt_s, *values = self.ring[(count - 1) % WINDOW].tolist()
        return ImuSample(time_s, dt_s, Vector3(*values[:3]), Vector3(*values[3:]))

    @property
    def rows(self) -> FloatArray:
        """The last samples, oldest first, shape (n, 8)."""
        count = self._numbers[_COUNT]
        if count <= WINDOW:
            return self.ring[:count]
        return np.roll(self.ring, -(count % WINDOW), axis=0)
