"""Ring buffers of rows of floats, for measurements that wait until the delayed horizon reaches their time."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, RecordArray

GNSS_ROWS, MAG_ROWS, BARO_ROWS, RANGE_ROWS, IMU_ROWS = 8, 32, 32, 32, 64
GNSS_RING, MAG_RING, BARO_RING, RANGE_RING, IMU_RING, RINGS = 0, 1, 2, 3, 4, 5
TRACK_COLUMNS = 11
_MOST_VALUES = 4
_ROUNDING_S = 2.5e-4
"""Means of samples end at the time of a step: the rounding of a float32 must not decide in which step they count."""


class Cursor(NamedTuple):
    """Rows of a ring that are in use."""

    oldest: int
    """Slot of the oldest row."""
    rows: int
    """Number of rows from it on."""


class StepRow(NamedTuple):
    """A ``DeltaSample``."""

    time_s: float
    dt_s: float
    angle_rad: Annotated[FloatArray, 3]
    velocity_m_s: Annotated[FloatArray, 3]
    unknown_angle: float
    unknown_velocity: float


StepRecord: TypeAlias = Annotated[Record, StepRow]


class Rings(NamedTuple):
    """Measurements in the order of their arrival; the first column of each row of floats is the time."""

    gnss: Annotated[FloatArray, GNSS_ROWS, 10]
    mag: Annotated[FloatArray, MAG_ROWS, 4]
    baro: Annotated[FloatArray, BARO_ROWS, 2]
    range: Annotated[FloatArray, RANGE_ROWS, 2]
    imu: Annotated[RecordArray, StepRow, IMU_ROWS]
    track: Annotated[FloatArray, IMU_ROWS, TRACK_COLUMNS]
    """The output at the time of each row of ``imu``: time, attitude, velocity, position."""
    cursors: Annotated[RecordArray, Cursor, RINGS]


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
    slot: int = rings.cursors[ring]["oldest"] + number
    return slot - size if slot >= size else slot


@compiled
def oldest_slot(rings: Rings, ring: int) -> int:
    """Return the slot of the oldest row."""
    slot: int = rings.cursors[ring]["oldest"]
    return slot


@compiled
def count_of(rings: Rings, ring: int) -> int:
    """Return the number of rows that wait."""
    count: int = rings.cursors[ring]["rows"]
    return count


@compiled
def is_due(rings: Rings, ring: int, oldest: FloatArray, now_s: float) -> bool:
    """Return True if the ring has rows and ``oldest``, its oldest one, was not measured in the future."""
    return count_of(rings, ring) > 0 and oldest[0] <= now_s + _ROUNDING_S


@compiled
def push(rings: Rings, ring: int, size: int) -> int:
    """Return the slot for a new row; the oldest row of a full ring is dropped."""
    cursor = rings.cursors[ring]
    if cursor["rows"] >= size:
        pop(rings, ring, size)
    slot = slot_of(rings, ring, size, cursor["rows"])
    cursor["rows"] += 1
    return slot


@compiled
def pop(rings: Rings, ring: int, size: int) -> None:
    """Remove the oldest row."""
    cursor = rings.cursors[ring]
    cursor["oldest"] = slot_of(rings, ring, size, 1)
    cursor["rows"] -= 1


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
    count = count_of(rings, GNSS_RING)
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
