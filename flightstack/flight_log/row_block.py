"""Bulk conversion of trace rows to ULog data messages: one message of each topic per row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from struct import calcsize, pack_into
from typing import NamedTuple

import numpy as np

from flightstack.core.compiled import IS_DISABLED, direct
from flightstack.core.contract import FloatArray
from flightstack.flight_log import ulog
from flightstack.flight_log.row_kernel import (
    DOUBLE,
    FLAG,
    HEADING,
    OPPOSITE,
    PART,
    SINGLE,
    TIME,
    WHOLE,
    Part,
    TimeArray,
    put_rows,
)
from flightstack.flight_log.topics import Bit, Field, Heading, Opposite, Topic
from flightstack.mavlink.fields import RANGES, STRUCT_CODES

_TIME_SIZE = 8
_FLOATS = {"f": SINGLE, "d": DOUBLE}
_RUNS = (SINGLE, OPPOSITE, DOUBLE, WHOLE)
"""Kinds that may have several numbers."""
_put_rows = np.errstate(over="ignore")(put_rows) if IS_DISABLED else put_rows
"""Compiled code does not warn of a number that is infinite in float32."""
_LARGEST_WHOLE = 2.0**53
"""Above it a float64 does not hold every whole number: 285 years in microseconds."""


def _size(field: Field) -> int:
    """Return the size of a number [bytes]."""
    return calcsize("<" + STRUCT_CODES[field.type])


def _width(field: Field) -> int:
    return max(1, field.length)


def content_size(topic: Topic) -> int:
    """Return the size [bytes] of a data message: subscription id, timestamp and fields."""
    return 2 + _TIME_SIZE + sum(_size(field) * _width(field) for field in topic.fields)


def _part(field: Field, source: int | Bit | Opposite | Heading, offset: int) -> Part:
    """Return how the kernel writes a field."""
    code = STRUCT_CODES[field.type]
    low, high = RANGES.get(code, (0, 0))
    kinds = {int: _FLOATS.get(code, WHOLE), Opposite: OPPOSITE, Heading: HEADING, Bit: FLAG}
    flag = source.flag if isinstance(source, Bit) else 0
    largest = _LARGEST_WHOLE if flag else min(high, _LARGEST_WHOLE)
    column = source if isinstance(source, int) else source.column
    return Part(kinds[type(source)], column, _width(field), offset, _size(field), flag, low, largest)


def _goes_on(last: Part, part: Part) -> bool:
    """Return True if the numbers of a part follow those of the last one, in the row and in its bytes."""
    end = {"source": last.source + last.number, "offset": last.offset + last.number * last.size}
    return last.kind in _RUNS and part == last._replace(**end, number=part.number)


def _joined(parts: Iterable[Part]) -> list[Part]:
    """Return the parts, those that go on as one."""
    joined: list[Part] = []
    for part in parts:
        if joined and _goes_on(joined[-1], part):
            joined[-1] = joined[-1]._replace(number=joined[-1].number + part.number)
        else:
            joined.append(part)
    return joined


class _Layout(NamedTuple):
    """A data message without its header."""

    parts: tuple[Part, ...]
    content: bytes
    """Default values."""
    constants: tuple[tuple[str, str, int], ...]
    """Name, code and offset of the fields without a source."""


@cache
def _layout(topic: Topic) -> _Layout:
    """Return the layout of a data message."""
    parts, content, constants = [Part(TIME, 0, 1, 0, _TIME_SIZE)], bytearray(_TIME_SIZE), []
    for field in topic.fields:
        code, offset = "<" + STRUCT_CODES[field.type], len(content)
        if field.source is None:
            constants.append((field.name, code, offset))
            content += np.full(_width(field), field.default, code).tobytes()
        else:
            parts.append(_part(field, field.source, offset))
            content += bytes(_size(field) * _width(field))
    return _Layout(tuple(_joined(parts)), bytes(content), tuple(constants))


def _content(layout: _Layout, constants: Mapping[str, float]) -> bytes:
    """Return the message with these values of constant numbers, by name."""
    content = bytearray(layout.content)
    for name, code, offset in layout.constants:
        if name in constants:
            pack_into(code, content, offset, constants[name])
    return bytes(content)


class RowBlock:
    """Converts rows in a buffer that grows with the largest number of them; headers and constants stay in it."""

    def __init__(
        self, topics: Sequence[Topic], first_message_id: int, constants: Mapping[str, float] | None = None
    ) -> None:
        """``constants`` are values of fields without a source, by name."""
        row, parts = bytearray(), list[Part]()
        for message_id, topic in enumerate(topics, first_message_id):
            layout = _layout(topic)
            row += ulog.DATA_HEADER.pack(content_size(topic), ulog.DATA_TYPE, message_id)
            parts += (part._replace(offset=len(row) + part.offset) for part in layout.parts)
            row += _content(layout, constants or {})
        self.row_size = len(row)
        self._row, self._parts = np.frombuffer(row, np.uint8), np.array(parts, PART)
        self._bytes = self._row.copy()
        self._put = direct(_put_rows, self._bytes, 0, self._parts, np.zeros(0, np.uint64), np.zeros((0, 1)))

    def encode(self, times_us: TimeArray, rows: FloatArray) -> memoryview:
        """Return the messages of ``rows``, shape (n, columns); valid until the next call.

        Out-of-range values become infinite (floats) or the next value in range (integers), and raise no error.
        """
        size = len(rows) * self.row_size
        if size > len(self._bytes):
            self._bytes = np.tile(self._row, len(rows))
        self._put(self._bytes, self.row_size, self._parts, times_us, rows)
        return self._bytes.data[:size]
