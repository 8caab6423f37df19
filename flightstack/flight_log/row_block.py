"""Bulk conversion of trace rows to ULog data messages: one message of each topic per row."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.flight_log import ulog
from flightstack.flight_log.topics import Bit, Derived, Field, Topic
from flightstack.mavlink.fields import STRUCT_CODES

TimeArray: TypeAlias = np.ndarray[Any, np.dtype[np.uint64]]
_Records: TypeAlias = np.ndarray[Any, Any]

_TIMESTAMP = "Q"


def content_size(topic: Topic) -> int:
    """Return the size [bytes] of a data message: subscription id, timestamp and fields."""
    return 2 + 8 + sum(_field_dtype(field).itemsize for field in topic.fields)


def _field_dtype(field: Field) -> np.dtype[Any]:
    code = "<" + STRUCT_CODES[field.type]
    return np.dtype((code, (field.length,))) if field.length else np.dtype(code)


def _joined(fields: Iterable[Field]) -> Iterator[Field]:
    """Yield the fields, as one array where flags or columns follow each other: writing one takes microseconds."""
    for column, run in groupby(fields, lambda field: getattr(field.source, "column", None)):
        if column is None:
            yield from _joined_columns(run)
        else:
            flags = list(run)
            yield flags[0]._replace(length=len(flags), source=_bits(column, flags))


def _joined_columns(fields: Iterable[Field]) -> Iterator[Field]:
    """Yield the fields, those of one type from successive columns as one array."""
    last: Field | None = None
    for field in fields:
        if last is None:
            last = field
        elif isinstance(last.source, int) and (field.type, field.source) == (
            last.type,
            last.source + _width(last),
        ):
            last = last._replace(length=_width(last) + _width(field))
        else:
            yield last
            last = field
    if last is not None:
        yield last


def _width(field: Field) -> int:
    return max(1, field.length)


def _bits(column: int, flags: Iterable[Field]) -> Derived:
    """Return a function of the rows: for each flag 1 where it is set in the column."""
    masks = np.array([field.source.flag for field in flags if isinstance(field.source, Bit)])
    return lambda rows: rows[:, column, np.newaxis].astype(np.int64) & masks != 0


class RowBlock:
    """Converts rows in a preallocated buffer of packed records; constants are written once."""

    def __init__(
        self,
        topics: Sequence[Topic],
        first_message_id: int,
        capacity: int,
        constants: Mapping[str, float] | None = None,
    ) -> None:
        """Lay out ``capacity`` rows. ``constants`` are values of fields without a source, by name."""
        joined = [(topic, list(_joined(topic.fields))) for topic in topics]
        columns: list[tuple[str, Any]] = []
        for topic, fields in joined:
            columns.append((f"{topic.name}.header", "V5"))
            columns.append((f"{topic.name}.timestamp", "<u8"))
            columns.extend((f"{topic.name}.{field.name}", _field_dtype(field)) for field in fields)
        records = np.zeros(capacity, np.dtype(columns))
        self._stamps: list[_Records] = []
        self._copies: list[tuple[_Records, slice | int]] = []
        self._derived: list[tuple[_Records, Derived]] = []
        for message_id, (topic, fields) in enumerate(joined, first_message_id):
            header = ulog.DATA_HEADER.pack(content_size(topic), ulog.DATA_TYPE, message_id)
            records[f"{topic.name}.header"] = np.void(header)
            self._stamps.append(records[f"{topic.name}.timestamp"])
            for field in fields:
                self._bind(records[f"{topic.name}.{field.name}"], field, constants or {})
        self.row_size = records.dtype.itemsize
        self._bytes = records.view(np.uint8).data

    def _bind(self, column: _Records, field: Field, constants: Mapping[str, float]) -> None:
        if field.source is None:
            column[:] = constants.get(field.name, field.default)
        elif not isinstance(field.source, int):
            assert not isinstance(field.source, Bit)  # they are joined
            self._derived.append((column, field.source))
        elif field.length:
            self._copies.append((column, slice(field.source, field.source + field.length)))
        else:
            self._copies.append((column, field.source))

    def encode(self, times_us: TimeArray, rows: FloatArray) -> memoryview:
        """Return the messages of ``rows``, shape (n, columns), n ≤ capacity; valid until the next call.

        Out-of-range values become infinite (floats) or undefined (integers) and raise no error.
        """
        count = len(rows)
        with np.errstate(over="ignore", invalid="ignore"):
            for column in self._stamps:
                column[:count] = times_us
            for column, source in self._copies:
                column[:count] = rows[:, source]
            for column, derive in self._derived:
                column[:count] = derive(rows)
        return self._bytes[: count * self.row_size]
