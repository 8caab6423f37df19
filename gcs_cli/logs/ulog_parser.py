"""Bytes of a ULog file to pyulog's view of them, with the data rows gathered here.

pyulog takes 3 µs for each message of data, two thirds of the time of a short flight's report. It gets the log with few
rows of each subscription, which define everything but the arrays; the arrays are made of all rows at once. Logs that
are damaged, or have features that this does not cover, are left to pyulog alone.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from pyulog import ULog, ULogException

from flightstack.core.errors import ConfigError
from flightstack.flight_log.ulog import HEADER_SIZE, MESSAGE_HEADER
from flightstack.flight_log.ulog_scan import scan_messages

IndexArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]

DAMAGE = (ULogException, struct.error, ValueError, KeyError, IndexError, OverflowError, TypeError)
"""Exceptions for a damaged log, raised by pyulog or by code that reads its result."""
NO_DATA = "the log has no data"
_ROW_AT = 5
"""Offset of the row in a message of data: behind size, type and subscription id."""
_TIME_SIZE = 8
_SHORT = 1 << 8
_SUBSCRIPTION_TYPE, _FLAG_TYPE = ord("A"), ord("B")
_INCOMPATIBLE_AT = 8
"""Offset in the flag bits of the incompatible flags, and of the offsets of appended data."""


class ParsedLog(NamedTuple):
    """A log as pyulog shows it."""

    log: Any
    damaged: bool
    """True if the file is cut off, or damage was found."""

    @property
    def has_data(self) -> bool:
        """True if a topic has a sample; damaged definitions may lack the times."""
        return any(len(item.data.get("timestamp", ())) for item in self.log.data_list)


class LogBytes(io.BytesIO):
    """A log in memory for pyulog, which seeks back by a message's size even where the file ended before.

    It would go back further each time, and never end. ``seek`` goes back by no more than the last ``read`` has read.
    """

    _missing = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """Return up to ``size`` bytes."""
        data = super().read(size)
        self._missing = max(0, (size or 0) - len(data))
        return data

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """Move; return the position."""
        if whence == os.SEEK_CUR and offset < 0:
            offset = min(0, offset + self._missing)
        return super().seek(offset, whence)


def parse_ulog(content: bytes, source: object, topics: list[str] | None = None) -> ParsedLog:
    """Parse the bytes of a ULog file, complete or cut off: all ``topics`` by default.

    Raise ConfigError, which names ``source``.
    """
    try:
        rows = _Rows(content, topics)
        # pyulog reports damage on stdout, which belongs to the command's own output
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(LogBytes(rows.short_log()), topics) if rows.are_regular else None
            if log is None or not rows.fill(log):
                log = ULog(LogBytes(content), topics)
    except DAMAGE as error:
        raise ConfigError(source, "", f"is not a readable flight log: {error}") from error
    return ParsedLog(log, bool(log.file_corruption) or not rows.fill_file)


class _Rows:
    """The rows of each subscription to the given topics, and the messages that define all the rest."""

    def __init__(self, content: bytes, topics: list[str] | None) -> None:
        self._content = content
        self._topics = None if topics is None else {topic.encode() for topic in topics}
        positions, numbers = scan_messages(content)
        self._begins, self._ends = positions[:-1], positions[1:]
        self.fill_file = bool(positions[-1] == len(content))
        """True if messages of known types fill the file to its last byte.

        The format has no end mark and no checksums: damage inside a message is not detected.
        """
        self.are_regular = self.fill_file
        """True if also no subscription id is used twice, each row has a time, and no data is appended."""
        if self.are_regular:
            self._gather(numbers)

    def _gather(self, numbers: IndexArray) -> None:
        """Find the wanted rows, and the messages that are not data; ``numbers`` are those of ``scan_messages``."""
        is_row = numbers >= 0
        self._rows, self._others = np.flatnonzero(is_row), np.flatnonzero(~is_row)
        numbers = numbers[is_row].astype(np.uint16)
        if numbers.size and numbers.max() < _SHORT:  # sorted in half the time
            numbers = numbers.astype(np.uint8)
        self._of = _grouped(self._rows, numbers)
        unwanted = self._unwanted()
        if unwanted:
            self._rows = self._rows[~np.isin(numbers, list(unwanted))]
            self._of = {number: rows for number, rows in self._of.items() if number not in unwanted}
        sizes = self._ends[self._rows] - self._begins[self._rows]
        self.are_regular &= bool(np.all(sizes >= _ROW_AT + _TIME_SIZE))

    def _unwanted(self) -> set[int]:
        """Return the ids of subscriptions to other topics, and check all messages that are not data."""
        unwanted: set[int] = set()
        for index in self._others.tolist():
            at, after = self._begins[index], self._ends[index]
            _size, kind = MESSAGE_HEADER.unpack_from(self._content, at)
            message = self._content[at + MESSAGE_HEADER.size : after]
            if kind == _SUBSCRIPTION_TYPE:
                number = int.from_bytes(message[1:3], "little")
                has_rows = number in self._of and self._of[number][0] < index
                self.are_regular &= number not in unwanted and not has_rows
                if self._topics is not None and message[3:] not in self._topics:
                    unwanted.add(number)
            elif kind == _FLAG_TYPE:
                self.are_regular &= not any(message[_INCOMPATIBLE_AT:])
        return unwanted

    def _unaligned(self, kind: Any, at: IndexArray) -> np.ndarray[Any, Any]:
        """Return the values of a type of fixed size at the given positions, which it need not be aligned to."""
        size = np.dtype(kind).itemsize
        return np.ndarray((len(self._content) - size + 1,), kind, self._content, strides=(1,))[at]

    def short_log(self) -> bytes:
        """Return the log with the first row of each subscription, and the latest ones before other messages.

        A change of a parameter has the largest time before it, and so has the end of the log.
        """
        kept = {*self._others.tolist(), *(int(rows[0]) for rows in self._of.values())}
        if len(self._rows):
            times = self._unaligned("<u8", self._begins[self._rows] + _ROW_AT)
            largest = np.maximum.accumulate(times)
            before = np.searchsorted(self._rows, [*self._others, len(self._begins)])
            latest = np.searchsorted(largest, largest[before[before > 0] - 1])
            kept.update(self._rows[latest].tolist())
        begins, ends = self._begins, self._ends
        messages = (self._content[begins[index] : ends[index]] for index in sorted(kept))
        return self._content[:HEADER_SIZE] + b"".join(messages)

    def fill(self, log: Any) -> bool:
        """Replace the arrays of ``log`` by those of all rows; return False if pyulog alone must read the log.

        That is so for rows of other sizes than defined, and topics that do not begin with their time.
        """
        if log.file_corruption:
            return False
        for item in log.data_list:
            row = np.dtype([(name, values.dtype) for name, values in item.data.items()])
            rows = self._of[item.msg_id]
            begins = self._begins[rows] + _ROW_AT
            if np.any(self._ends[rows] - begins != row.itemsize) or item.timestamp_idx != 0:
                return False
            item.data = _Columns(partial(self._unaligned, f"V{row.itemsize}", begins), row)
        return True


class _Columns(Mapping[str, np.ndarray[Any, Any]]):
    """Arrays of a topic by field. They are gathered when the first one is read: few topics of a log are."""

    def __init__(self, gather: Callable[[], np.ndarray[Any, Any]], row: np.dtype[Any]) -> None:
        self._gather, self._row = gather, row

    @cached_property
    def _table(self) -> np.ndarray[Any, Any]:
        return self._gather().view(self._row)

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        if name not in self:
            raise KeyError(name)
        return self._table[name]

    def __contains__(self, name: object) -> bool:
        return name in (self._row.names or ())

    def __iter__(self) -> Iterator[str]:
        return iter(self._row.names or ())

    def __len__(self) -> int:
        return len(self._row.names or ())


def _grouped(rows: IndexArray, numbers: np.ndarray[Any, Any]) -> dict[int, IndexArray]:
    """Return the rows of each number, in their order."""
    counts = np.bincount(numbers)
    found = np.flatnonzero(counts)
    groups = np.split(rows[np.argsort(numbers, kind="stable")], np.cumsum(counts[found])[:-1])
    return dict(zip(found.tolist(), groups, strict=False))  # without rows there is one empty group
