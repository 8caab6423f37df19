"""Ring buffers of rows of floats, for measurements that wait until the delayed horizon reaches their time."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record

GNSS_ROWS, MAG_ROWS, BARO_ROWS, RANGE_ROWS, IMU_ROWS = 8, 32, 32, 32, 64
GNSS_RING, MAG_RING, BARO_RING, RANGE_RING, IMU_RING, RINGS = 0, 1, 2, 3, 4, 5
IMU_COLUMNS, TRACK_COLUMNS = 10, 11
_MOST_VALUES = 4
_ROUNDING_S = 2.5e-4
"""Means of samples end at the time of a step: the rounding of a float32 must not decide in which step they count."""

Cursors: TypeAlias = "Annotated[np.ndarray[tuple[int, int], np.dtype[np.int64]], RINGS, 2]"
"""For each ring the slot of its oldest row, and the number of its rows."""


class Rings(NamedTuple):
    """Measurements in the order of their arrival; the first column of each row is the time."""

    gnss: Annotated[FloatArray, GNSS_ROWS, 10]
    mag: Annotated[FloatArray, MAG_ROWS, 4]
    baro: Annotated[FloatArray, BARO_ROWS, 2]
    range: Annotated[FloatArray, RANGE_ROWS, 2]
    imu: Annotated[FloatArray, IMU_ROWS, IMU_COLUMNS]
    track: Annotated[FloatArray, IMU_ROWS, TRACK_COLUMNS]
    """The output at the time of each row of ``imu``: time, attitude, velocity, position."""
    cursors: Cursors


class Mean(NamedTuple):
    """Mean of samples. Equal samples have exactly their value as mean."""

    sums: Annotated[FloatArray, _MOST_VALUES]
    """Of the differences of the samples to the first one."""
    number: float
    pushed_s: float
    """Time of the last row."""
    last_s: float
    """Time of the last sample."""
    first: Annotated[FloatArray, _MOST_VALUES]
    """The first sample."""


@compiled
def slot_of(rings: Rings, ring: int, size: int, number: int) -> int:
    """Return the slot of row ``number``, counted from the oldest."""
    slot: int = rings.cursors[ring, 0] + number
    return slot - size if slot >= size else slot


@compiled
def count_of_measurements(rings: Rings) -> int:
    """Return the number of rows that wait in all rings but that of the IMU."""
    total: int = 0
    for ring in range(IMU_RING):
        total += rings.cursors[ring, 1]
    return total


@compiled
def is_due(rings: Rings, ring: int, row_s: float, now_s: float) -> bool:
    """Return True if the ring has rows and its oldest one, measured at ``row_s``, is not in the future."""
    count: int = rings.cursors[ring, 1]
    return count > 0 and row_s <= now_s + _ROUNDING_S


@compiled
def push(rings: Rings, ring: int, size: int) -> int:
    """Return the slot for a new row; the oldest row of a full ring is dropped."""
    if rings.cursors[ring, 1] >= size:
        pop(rings, ring, size)
    slot = slot_of(rings, ring, size, rings.cursors[ring, 1])
    rings.cursors[ring, 1] += 1
    return slot


@compiled
def pop(rings: Rings, ring: int, size: int) -> None:
    """Remove the oldest row."""
    rings.cursors[ring, 0] = slot_of(rings, ring, size, 1)
    rings.cursors[ring, 1] -= 1


@compiled
def take_mean(mean: Annotated[Record, Mean], row: FloatArray, period_s: float) -> bool:
    """Add a sample to a mean; return True, with the mean in ``row``, if ``period_s`` passed since the last one."""
    if row[0] - mean["last_s"] > period_s:  # a gap: the older samples are outdated
        mean["number"] = 0.0
    mean["last_s"] = row[0]
    for i in range(row.size):
        if mean["number"] == 0.0:
            mean["first"][i], mean["sums"][i] = row[i], 0.0
        mean["sums"][i] += row[i] - mean["first"][i]
    mean["number"] += 1.0
    if row[0] - mean["pushed_s"] < 0.9 * period_s:
        return False
    mean["pushed_s"] = row[0]
    for i in range(row.size):
        row[i] = mean["first"][i] + mean["sums"][i] / mean["number"]
    mean["number"] = 0.0
    return True


@compiled
def newest_fix_time(rings: Rings) -> float:
    """Return the time of the newest row of GNSS, or minus infinity."""
    count: int = rings.cursors[GNSS_RING, 1]
    if count == 0:
        return -math.inf
    newest_s: float = rings.gnss[slot_of(rings, GNSS_RING, GNSS_ROWS, count - 1), 0]
    return newest_s


@compiled
def read_row(row: FloatArray, values: FloatArray) -> None:
    """Copy a row to the first of ``values``."""
    for column in range(row.size):
        values[column] = row[column]


@compiled
def write_row(row: FloatArray, values: FloatArray) -> None:
    """Copy the first ``values`` to a row."""
    for column in range(row.size):
        row[column] = values[column]
