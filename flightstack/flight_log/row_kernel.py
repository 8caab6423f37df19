"""Bytes of rows of numbers, by one compiled call from a table of their parts.

A log has a row for each tick. By NumPy, a part at a time, their bytes take three times as long, and twenty times as
long for the few rows of a slow sensor.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.array_items import put
from flightstack.core.compiled import compiled
from flightstack.core.contract import ByteArray, FloatArray, Quaternion, Record, RecordArray
from flightstack.core.geometry import heading
from flightstack.core.portable_math import whole_within
from flightstack.core.record_types import dtype_of

TimeArray: TypeAlias = np.ndarray[Any, np.dtype[np.uint64]]

TIME, SINGLE, OPPOSITE, DOUBLE, WHOLE, FLAG, HEADING = range(7)
"""Kinds of parts: time of the row, float32, float32 with the opposite sign, float64, whole number, one byte for a flag,
and the heading of an attitude [rad] as float32."""


class Part(NamedTuple):
    """``number`` columns from ``source`` on, of ``size`` bytes each from ``offset`` in the bytes of a row.

    Whole numbers are rounded and limited to [low, high]; one that is not finite is 0. A flag is set if the whole number
    has a bit of ``flag``. A heading is that of the quaternion in four columns.
    """

    kind: int
    source: int
    number: int
    offset: int
    size: int
    flag: int = 0
    low: float = 0.0
    high: float = 0.0


PART = dtype_of(Part)


@compiled
def _put_whole(out: ByteArray, at: int, size: int, number: int) -> None:
    if size == 1:
        put(out, at, np.uint8(number & 0xFF))
    elif size == 2:
        put(out, at, np.uint16(number & 0xFFFF))
    elif size == 4:
        put(out, at, np.uint32(number & 0xFFFFFFFF))
    else:
        put(out, at, np.int64(number))


@compiled
def _put_number(out: ByteArray, at: int, part: Record, value: float) -> None:
    """Write a number of another kind."""
    if part["kind"] == OPPOSITE:
        put(out, at, np.float32(-value))
    elif part["kind"] == DOUBLE:
        put(out, at, np.float64(value))
    else:
        number = whole_within(value, part["low"], part["high"])
        _put_whole(out, at, part["size"], number if part["kind"] == WHOLE else min(1, number & part["flag"]))


@compiled
def _put_part(out: ByteArray, row_size: int, part: Record, times_us: TimeArray, rows: FloatArray) -> None:
    """Write one part of all rows."""
    kind, source, count, at, size = part["kind"], part["source"], part["number"], part["offset"], part["size"]
    for index in range(len(rows)):
        row = rows[index]
        if kind == TIME:
            put(out, at, times_us[index])
        elif kind == HEADING:
            attitude = Quaternion(row[source], row[source + 1], row[source + 2], row[source + 3])
            put(out, at, np.float32(heading(attitude)))
        elif kind == SINGLE:
            for k in range(count):
                put(out, at + 4 * k, np.float32(row[source + k]))
        else:
            for k in range(count):
                _put_number(out, at + size * k, part, row[source + k])
        at += row_size


@compiled
def put_rows(
    out: ByteArray, row_size: int, parts: RecordArray, times_us: TimeArray, rows: FloatArray
) -> None:
    """Write the ``parts`` of ``rows``, shape (n, columns), to ``out``, ``row_size`` bytes for each row."""
    for index in range(len(parts)):
        _put_part(out, row_size, parts[index], times_us, rows)
