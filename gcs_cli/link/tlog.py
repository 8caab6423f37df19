"""Telemetry logs (tlog): each frame after its timestamp, as MAVProxy and QGroundControl write them.

A record is a big-endian uint64, µs since the Unix epoch, and one MAVLink frame as it was on the wire.
"""

from __future__ import annotations

import contextlib
import errno
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from flightstack.mavlink.frames import MAGIC_V1, MAGIC_V2, frame_size, message_id_of
from flightstack.mavlink.link import Link, Message

_TIME = struct.Struct(">Q")
_LINK_BITS = 3  # readers use the two lowest bits of the timestamp as the link number


class Record(NamedTuple):
    """One record; ``time_us`` is since the Unix epoch."""

    time_us: int
    message_id: int
    frame: bytes


def encode_record(time_us: int, frame: bytes | memoryview) -> bytes:
    """Return the record of one frame, received or sent at ``time_us`` since the Unix epoch."""
    return _TIME.pack(time_us & ~_LINK_BITS) + frame


def decode_records(data: bytes) -> Iterator[Record]:
    """Yield the records of a log up to its end or its first invalid byte.

    A truncated record at the end is left out. Checksums are not checked.
    """
    at = 0
    while len(data) - at > _TIME.size:
        start = at + _TIME.size
        size = frame_size(data, start) if data[start] in (MAGIC_V1, MAGIC_V2) else None
        if size is None or start + size > len(data):
            return
        frame = data[start : start + size]
        yield Record(_TIME.unpack_from(data, at)[0], message_id_of(frame), frame)
        at = start + size


class TlogFile:
    """Writes a tlog without buffering, so that a killed process leaves a readable file.

    A write error does not end the session: the first one is kept in ``error``, and the file ends with the last whole
    record.
    """

    def __init__(self, path: Path) -> None:
        """Create or replace the file at ``path``; raise OSError."""
        self._file = path.open("wb", buffering=0)
        self._size = 0
        self.error: OSError | None = None

    def write(self, time_us: int, frame: bytes | memoryview) -> None:
        """Write one frame, received or sent at ``time_us`` since the Unix epoch."""
        if self.error is not None:
            return
        record = encode_record(time_us, frame)
        try:
            if self._file.write(record) < len(record):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._size += len(record)
        except OSError as error:
            self.error = error
            with contextlib.suppress(OSError):  # a pipe cannot be truncated
                self._file.truncate(self._size)

    @property
    def is_closed(self) -> bool:
        """True after ``close``."""
        return self._file.closed

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._file.close()

    def __enter__(self) -> TlogFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_messages(path: Path, message_ids: frozenset[int]) -> Iterator[tuple[Record, Message]]:
    """Yield the messages of a tlog with one of the given ids; other messages are not decoded."""
    link = Link(0, 0)
    for record in decode_records(path.read_bytes()):
        if record.message_id in message_ids:
            for message in link.decode(record.frame):
                yield record, message
