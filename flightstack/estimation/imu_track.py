"""The last samples of an inertial sensor, as rows: a row costs a tenth of an ``ImuSample``."""

from __future__ import annotations

import math
import struct
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, Record, RecordArray, SingleArray, Vector3
from flightstack.core.record_types import dtype_of
from flightstack.estimation.sensor_samples import ImuSample

IMU_SIZE = 8
"""Array form of an IMU sample: time, duration, rate (3), specific force (3)."""
WINDOW = 100
"""Samples that are kept, of which the vibration is computed; the length of PX4's filter."""
IMU_MISSING_S = 0.04
"""Age of the newest sample at which the sensor is missing; before it, the rotor speeds are not yet held."""
RECORD_SIZE = 7
"""Recorded form of a sample: duration [µs], rate (3), specific force (3)."""
_pack = struct.Struct(f"={IMU_SIZE}d").pack_into


class ImuRow(NamedTuple):
    """An ``ImuSample``, whose array form is the row."""

    time_s: float
    dt_s: float
    rates_rad_s: Annotated[FloatArray, 3]
    force_m_s2: Annotated[FloatArray, 3]


class Track(NamedTuple):
    """A ring of samples, of which the next one follows the newest."""

    taken: int
    """Number of samples so far."""
    repeats: int
    """Number of successive samples whose rates or forces equal those before."""
    rows: Annotated[RecordArray, ImuRow, WINDOW]


TRACK = dtype_of(Track)
TrackRecord: TypeAlias = Annotated[Record, Track]
TrackArray: TypeAlias = Annotated[RecordArray, Track]
"""An array of one track, shape (1,)."""
_Axes: TypeAlias = Annotated[FloatArray, 3]


@compiled
def _equals(a: _Axes, b: _Axes) -> bool:
    return bool(a[0] == b[0] and a[1] == b[1] and a[2] == b[2])


@compiled
def _is_zero(a: _Axes) -> bool:
    return bool(a[0] == 0.0 and a[1] == 0.0 and a[2] == 0.0)


@compiled
def _count(track: TrackRecord) -> None:
    """Count the sample in the next row, and whether it repeats the one before.

    An ideal sensor at rest repeats zero rates and a constant force, and is not stuck.
    """
    taken = track["taken"]
    if taken > 0:
        row, last = track["rows"][taken % WINDOW], track["rows"][(taken - 1) % WINDOW]
        rates, force = row["rates_rad_s"], row["force_m_s2"]
        same_rates = _equals(rates, last["rates_rad_s"])
        same_force = _equals(force, last["force_m_s2"])
        is_ideal = same_rates and same_force and _is_zero(rates) and not _is_zero(force)
        track["repeats"] = track["repeats"] + 1 if (same_rates or same_force) and not is_ideal else 0
    track["taken"] = taken + 1


@compiled
def count_sample(memory: TrackArray) -> None:
    """Count the sample that was written to the next row of a track."""
    _count(memory[0])


@compiled
def take_wire(memory: TrackArray, wire: SingleArray, time_s: float, step_us: int, record: FloatArray) -> None:
    """Store a sample from the values of HIL_SENSOR: specific force, rates, … Fill ``record``, (7,)."""
    track = memory[0]
    row = track["rows"][track["taken"] % WINDOW]
    row["time_s"], row["dt_s"], record[0] = time_s, step_us * 1e-6, step_us
    for i in range(3):
        row["rates_rad_s"][i] = record[1 + i] = wire[3 + i]
        row["force_m_s2"][i] = record[4 + i] = wire[i]
    _count(track)


@compiled
def mean_since(memory: TrackArray, time_s: float, mean: FloatArray) -> int:
    """Write the mean rates and specific force of the samples after ``time_s`` to ``mean``, (6,); return their number.

    The track has the last 100 samples.
    """
    track = memory[0]
    for i in range(6):
        mean[i] = 0.0
    count = 0
    for age in range(1, min(track["taken"], WINDOW) + 1):
        row = track["rows"][(track["taken"] - age) % WINDOW]
        if row["time_s"] <= time_s:
            break
        count += 1
        for i in range(3):
            mean[i] += row["rates_rad_s"][i]
            mean[3 + i] += row["force_m_s2"][i]
    for i in range(6):
        mean[i] /= max(count, 1)
    return count


class ImuTrack:
    """A ring of rows, and the number of samples that repeated the one before."""

    def __init__(self) -> None:
        self.memory: RecordArray = np.zeros(1, TRACK)
        """The track, shape (1,)."""
        self.ring: FloatArray = self.memory["rows"][0].view(np.float64).reshape(WINDOW, IMU_SIZE)
        """Its rows in their array form, shape (100, 8)."""
        self.taken = self.memory["taken"]
        """Number of samples so far, shape (1,)."""
        self._each: list[tuple[FloatArray, memoryview]] = [(row, row.data) for row in self.ring]
        # a number of an array takes four times as long to read
        self._taken, self._repeats = self.taken.data, self.memory["repeats"].data
        self._count_sample: Any = None
        self._take_wire: Any = None
        self._mean_since: Any = None
        self._mean: FloatArray = np.zeros(6)

    @property
    def repeats(self) -> int:
        """Number of successive samples whose rates or forces equal those before."""
        return self._repeats[0]

    def take(
        self, time_s: float, dt_s: float, rates: tuple[float, ...], forces: tuple[float, ...]
    ) -> FloatArray:
        """Store a sample, as ``ImuSample``; return its row, shape (8,), valid until 99 more were taken."""
        if self._count_sample is None:
            self._count_sample = direct(count_sample, self.memory)
        row, memory = self._each[self._taken[0] % WINDOW]
        _pack(memory, 0, time_s, dt_s, *rates, *forces)  # a third of the time of an assignment
        self._count_sample(self.memory)
        return row

    def take_wire(self, time_s: float, step_us: int, wire: SingleArray, record: FloatArray) -> FloatArray:
        """Store a sample from the values of HIL_SENSOR, and in ``record``, shape (7,); return its row as ``take``."""
        if self._take_wire is None:
            self._take_wire = direct(take_wire, self.memory, wire, time_s, step_us, record)
        row = self._each[self._taken[0] % WINDOW][0]
        self._take_wire(self.memory, wire, time_s, step_us, record)
        return row

    def mean_since(self, time_s: float) -> tuple[Vector3, Vector3] | None:
        """Return the mean rates and specific force of the samples after ``time_s``, the last 100 at most, or None."""
        if self._mean_since is None:
            self._mean_since = direct(mean_since, self.memory, time_s, self._mean)
        if not self._mean_since(self.memory, time_s, self._mean):
            return None
        values = self._mean.tolist()
        return Vector3(*values[:3]), Vector3(*values[3:])

    @property
    def newest_s(self) -> float:
        """Time of the newest sample; minus infinity before the first one."""
        count = self._taken[0]
        return float(self._each[(count - 1) % WINDOW][1][0]) if count else -math.inf

    @property
    def newest(self) -> ImuSample | None:
        """The newest sample; None before the first one."""
        count = self._taken[0]
        if not count:
            return None
        time_s, dt_s, *values = self.ring[(count - 1) % WINDOW].tolist()
        return ImuSample(time_s, dt_s, Vector3(*values[:3]), Vector3(*values[3:]))
