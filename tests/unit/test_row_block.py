"""Bytes of the log's rows against ``struct``, a field at a time."""

from __future__ import annotations

import math
import struct
from itertools import chain

import numpy as np
import pytest

from flightstack.core.contract import FloatArray, LoopRow, Quaternion
from flightstack.core.geometry import heading
from flightstack.flight_log import ulog
from flightstack.flight_log.flight_log import DEFAULT_CAPACITY
from flightstack.flight_log.local_position import SENSED_OUTER
from flightstack.flight_log.row_block import RowBlock, content_size
from flightstack.flight_log.row_kernel import TimeArray
from flightstack.flight_log.sensor_recorder import SENSOR_GROUPS
from flightstack.flight_log.topics import (
    BATTERY_GROUP,
    OUTER_GROUP,
    Bit,
    Field,
    Group,
    Heading,
    Opposite,
    Topic,
    inner_topics,
)
from flightstack.mavlink.fields import RANGES, STRUCT_CODES

GROUPS = (
    Group("inner", LoopRow.SIZE, inner_topics(4)), OUTER_GROUP, SENSED_OUTER, BATTERY_GROUP, *SENSOR_GROUPS,
)  # fmt: skip
ORIGIN = {"ref_lat": 47.1, "ref_lon": -8.4, "ref_alt": 488.0}
FIRST_ID = 7


def values_of(field: Field, row: FloatArray) -> list[float]:
    """Return the values of a field by the definition of its source."""
    count, source = max(1, field.length), field.source
    if source is None:
        return [ORIGIN.get(field.name, field.default)] * count
    if isinstance(source, Bit):
        return [bool(round(max(0.0, row[source.column])) & source.flag)]
    if isinstance(source, Heading):
        return [heading(Quaternion(*row[source.column : source.column + 4].tolist()))]
    if isinstance(source, Opposite):
        return [-value for value in row[source.column : source.column + count].tolist()]
    values: list[float] = row[source : source + count].tolist()
    return values


def message(topic: Topic, message_id: int, time_us: int, row: FloatArray) -> bytes:
    data = ulog.DATA_HEADER.pack(content_size(topic), ulog.DATA_TYPE, message_id) + struct.pack("<Q", time_us)
    for field in topic.fields:
        code = STRUCT_CODES[field.type]
        for value in values_of(field, row):
            if code in RANGES:
                low, high = RANGES[code]
                data += struct.pack(f"<{code}", round(min(max(value, low), high)))
            else:
                data += struct.pack(f"<{code}", value)
    return data


def random_rows(columns: int, count: int) -> tuple[TimeArray, FloatArray]:
    """Return rows of positive and negative numbers, some whole, some beyond the range of a byte."""
    random = np.random.default_rng(columns)
    rows = random.normal(0.0, 1e4, (count, columns))
    rows[::2] = np.round(rows[::2])
    return random.integers(0, 2**62, count, dtype=np.uint64), rows


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.name)
def test_rows_have_the_bytes_of_their_fields(group: Group) -> None:
    times_us, rows = random_rows(group.columns, 9)
    block = RowBlock(group.topics, FIRST_ID, ORIGIN)
    expected = [
        b"".join(
            message(topic, number, int(time_us), row) for number, topic in enumerate(group.topics, FIRST_ID)
        )
        for time_us, row in zip(times_us, rows, strict=True)
    ]
    assert block.encode(times_us, rows) == b"".join(expected)
    assert block.row_size == len(expected[0])


def test_a_call_with_more_rows_than_before_has_headers_and_constants_in_each() -> None:
    times_us, rows = random_rows(OUTER_GROUP.columns, DEFAULT_CAPACITY)
    block = RowBlock(OUTER_GROUP.topics, FIRST_ID, ORIGIN)
    few = bytes(block.encode(times_us[:2], rows[:2]))
    every = bytes(block.encode(times_us, rows))
    assert every[: len(few)] == few == block.encode(times_us[:2], rows[:2])
    last = chain(
        *(message(t, n, int(times_us[-1]), rows[-1]) for n, t in enumerate(OUTER_GROUP.topics, FIRST_ID))
    )
    assert every.endswith(bytes(last))


@pytest.mark.parametrize(
    ("kind", "value", "stored"),
    [
        ("uint8_t", 255.4, 255), ("uint8_t", 300.0, 255), ("int8_t", -200.0, -128), ("uint16_t", -1.0, 0),
        ("uint32_t", 2.0**40, 2**32 - 1), ("int32_t", math.nan, 0), ("uint64_t", math.inf, 0), ("bool", 2.0, 1),
        ("int64_t", -3.0, -3), ("uint64_t", 2.0**53, 2**53),
    ],
)  # fmt: skip
def test_whole_numbers_are_limited_to_their_range(kind: str, value: float, stored: int) -> None:
    block = RowBlock((Topic("t", (Field(kind, "x", 0, 0),)),), 0)
    data = bytes(block.encode(np.zeros(1, np.uint64), np.full((1, 1), value)))
    code = f"<{STRUCT_CODES[kind]}"
    assert struct.unpack(code, data[-struct.calcsize(code) :]) == (stored,)
