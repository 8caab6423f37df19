"""Bytes of a ULog file to pyulog's view of them, with the data rows gathered here.

pyulog takes 3 µs for each message of data, two thirds of the time of a short flight's report. It gets the log with few
rows of each subscription, which define everything but the arrays; the arrays are made of all rows at once. Logs that
are damaged, or have features that this does not cover, are left to pyulog alone.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from pyulog import ULog, ULogException

from flightstack.core.errors import ConfigError
from flightstack.flight_log.ulog import DATA_HEADER, HEADER_SIZE, MESSAGE_HEADER
from flightstack.flight_log.ulog_scan import Messages, Words, scan_messages

IndexArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]

DAMAGE = (ULogException, struct.error, ValueError, KeyError, IndexError, OverflowError, TypeError)
"""Exceptions for a damaged log, raised by pyulog or by code that reads its result."""
NO_DATA = "the log has no data"
_ID_SIZE, _TIME_SIZE = 2, 8
_ROW_AT = DATA_HEADER.size
"""Offset of the row in a message of data: behind size, type and subscription id."""
_SHORT = 1 << 8
_SUBSCRIPTION_TYPE, _FLAG_TYPE = ord("A"), ord("B")
_INCOMPATIBLE_AT = 11
"""Offset in the message of flag bits of the incompatible flags, and of the offsets of appended data."""


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
        found = scan_messages(content)
        self.fill_file = found.end == len(content)
        """True if messages of known types fill the file to its last byte.

        The format has no end mark and no checksums: damage inside a message is not detected.
        """
        self.are_regular = self.fill_file
        """True if also no subscription id is used twice, each row has a time, and no data is appended."""
        if self.are_regular:
            self._gather(found)

    def _gather(self, found: Messages) -> None:
        """Sort the wanted rows by subscription."""
        rows, sizes, numbers, self._others, _ = found
        unwanted = self._unwanted(found)
        if unwanted:
            wanted = ~np.isin(numbers, list(unwanted))
            rows, sizes, numbers = rows[wanted], sizes[wanted], numbers[wanted]
        self._rows = rows
        self._of = _grouped(numbers, rows, sizes)
        self.are_regular &= not np.any(sizes < _ID_SIZE + _TIME_SIZE)

    def _unwanted(self, found: Messages) -> set[int]:
        """Return the ids of subscriptions to other topics, and check all messages that are not data."""
        unwanted: set[int] = set()
        for at in found.others.tolist():
            message = self._message(at)
            _size, kind = MESSAGE_HEADER.unpack_from(message)
            if kind == _SUBSCRIPTION_TYPE:
                number = int.from_bytes(message[4:6], "little")
                has_rows = number in found.numbers[: np.searchsorted(found.rows, at)]
                self.are_regular &= number not in unwanted and not has_rows
                if self._topics is not None and message[6:] not in self._topics:
                    unwanted.add(number)
            elif kind == _FLAG_TYPE:
                self.are_regular &= not any(message[_INCOMPATIBLE_AT:])
        return unwanted

    def _message(self, at: int) -> bytes:
        size, _kind = MESSAGE_HEADER.unpack_from(self._content, at)
        return self._content[at : at + MESSAGE_HEADER.size + size]

    def _unaligned(self, kind: Any, at: IndexArray) -> np.ndarray[Any, Any]:
        """Return the values of a type of fixed size at the given positions, which it need not be aligned to."""
        size = np.dtype(kind).itemsize
        return np.ndarray((len(self._content) - size + 1,), kind, self._content, strides=(1,))[at]

    def short_log(self) -> bytes:
        """Return the log with the first row of each subscription, and the latest ones before other messages.

        A change of a parameter has the largest time before it, and so has the end of the log.
        """
        firsts = (int(rows[0]) for rows, _ in self._of.values())
        kept = {*self._others.tolist(), *firsts, *self._latest()}
        return self._content[:HEADER_SIZE] + b"".join(map(self._message, sorted(kept)))

    def _latest(self) -> Iterator[int]:
        """Yield the positions of the rows with the largest time before another message, or before the end."""
        times = self._unaligned("<u8", self._rows + _ROW_AT)
        ends = np.searchsorted(self._rows, self._others).tolist()
        largest = -1
        for first, end in itertools.pairwise(sorted({0, *ends, len(times)})):
            row = first + int(times[first:end].argmax())
            if times[row] > largest:
                largest = int(times[row])
                yield int(self._rows[row])

    def fill(self, log: Any) -> bool:
        """Replace the arrays of ``log`` by those of all rows; return False if pyulog alone must read the log.

        That is so for rows of other sizes than defined, and topics that do not begin with their time.
        """
        if log.file_corruption:
            return False
        for item in log.data_list:
            row = np.dtype([(name, values.dtype) for name, values in item.data.items()])
            rows, sizes = self._of[item.msg_id]
            if np.any(sizes != _ID_SIZE + row.itemsize) or item.timestamp_idx != 0:
                return False
            item.data = _Columns(partial(self._unaligned, f"V{row.itemsize}", rows + _ROW_AT), row)
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


def _grouped(numbers: Words, *values: np.ndarray[Any, Any]) -> dict[int, tuple[np.ndarray[Any, Any], ...]]:
    """Return the values of each number, in their order."""
    if numbers.size and numbers.max() < _SHORT:  # sorted in half the time
        numbers = numbers.astype(np.uint8)
    order, counts = np.argsort(numbers, kind="stable"), np.bincount(numbers)
    found = np.flatnonzero(counts)
    ends = np.cumsum(counts[found])[:-1]
    groups = zip(*(np.split(each[order], ends) for each in values), strict=True)
    return dict(zip(found.tolist(), groups, strict=False))  # without rows there is one empty group
