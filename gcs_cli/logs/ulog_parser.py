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
from typing import Any, NamedTuple

import numpy as np
from pyulog import ULog, ULogException

from flightstack.core.errors import ConfigError
from flightstack.flight_log.ulog import DATA_TYPE, HEADER_SIZE, MESSAGE_HEADER, MESSAGE_TYPES

DAMAGE = (ULogException, struct.error, ValueError, KeyError, IndexError, OverflowError, TypeError)
"""Exceptions for a damaged log, raised by pyulog or by code that reads its result."""
_ROW_AT = 5
"""Offset of the row in a message of data: behind size, type and subscription id."""
_SUBSCRIPTION_TYPE, _FLAG_TYPE = ord("A"), ord("B")
_INCOMPATIBLE_AT = 8
"""Offset in the flag bits of the incompatible flags, and of the offsets of appended data."""


class ParsedLog(NamedTuple):
    """A log as pyulog shows it."""

    log: Any
    damaged: bool
    """True if the file is cut off, or damage was found."""


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
    rows = _Rows(topics)
    is_whole = rows.gather(content)
    try:
        # pyulog reports damage on stdout, which belongs to the command's own output
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(LogBytes(rows.short_log(content)), topics) if is_whole and rows.are_regular else None
            if log is None or not rows.fill(log):
                log = ULog(LogBytes(content), topics)
    except DAMAGE as error:
        raise ConfigError(source, "", f"is not a readable flight log: {error}") from error
    return ParsedLog(log, bool(log.file_corruption) or not is_whole)


class _Rows:
    """The rows of each subscription to the given topics, and the messages that define all the rest."""

    def __init__(self, topics: list[str] | None) -> None:
        self._topics = None if topics is None else {topic.encode() for topic in topics}
        self._others: set[int] = set()  # subscriptions to other topics
        self.are_regular = True
        """True if no subscription id is used twice, and no data is appended."""
        self._rows: dict[int, list[bytes]] = {}
        self._kept: set[tuple[int, int]] = set()  # begin and end of messages that pyulog reads

    def gather(self, content: bytes) -> bool:
        """Return True if messages of known types fill the file to its last byte.

        The format has no end mark and no checksums: damage inside a message is not detected.
        """
        at, end, rows, latest, latest_time = HEADER_SIZE, len(content), self._rows, (0, 0), b""
        while at + MESSAGE_HEADER.size <= end:
            after = at + MESSAGE_HEADER.size + (content[at] | content[at + 1] << 8)
            kind = content[at + 2]
            if after > end or (kind == DATA_TYPE and after < at + _ROW_AT):
                return False
            if kind == DATA_TYPE:
                number = content[at + 3] | content[at + 4] << 8
                if number in self._others:
                    at = after
                    continue
                row = content[at + _ROW_AT : after]
                time = row[7::-1]  # big-endian, so that bytes compare as numbers do
                if time > latest_time:
                    latest, latest_time = (at, after), time
                if number in rows:
                    rows[number].append(row)
                else:
                    rows[number] = [row]
                    self._kept.add((at, after))
            elif kind in MESSAGE_TYPES:
                self._kept |= {latest, (at, after)}  # a change of a parameter has the largest time before it
                self._check(kind, content[at + MESSAGE_HEADER.size : after])
            else:
                return False
            at = after
        self._kept.add(latest)
        return at == end

    def _check(self, kind: int, message: bytes) -> None:
        if kind == _SUBSCRIPTION_TYPE:
            number = int.from_bytes(message[1:3], "little")
            self.are_regular &= number not in self._rows and number not in self._others
            if self._topics is not None and message[3:] not in self._topics:
                self._others.add(number)
        elif kind == _FLAG_TYPE:
            self.are_regular &= not any(message[_INCOMPATIBLE_AT:])

    def short_log(self, content: bytes) -> bytes:
        """Return the log with the first row of each subscription, and the latest ones before other messages."""
        return content[:HEADER_SIZE] + b"".join(content[at:after] for at, after in sorted(self._kept))

    def fill(self, log: Any) -> bool:
        """Replace the arrays of ``log`` by those of all rows; return False if pyulog alone must read the log.

        That is so for rows of other sizes than defined, and topics that do not begin with their time.
        """
        if log.file_corruption:
            return False
        for item in log.data_list:
            row = np.dtype([(name, values.dtype) for name, values in item.data.items()])
            rows = self._rows[item.msg_id]
            if set(map(len, rows)) != {row.itemsize} or item.timestamp_idx != 0:
                return False
            table = np.frombuffer(b"".join(rows), row)
            item.data = {name: table[name] for name in row.names or ()}
        return True
