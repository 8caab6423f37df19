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

from flightstack.mavlink.link import Link, Message

_TIME = struct.Struct(">Q")
_LINK_BITS = 3  # readers use the two lowest bits of the timestamp as the link number
_MAGIC_V1, _MAGIC_V2 = 0xFE, 0xFD
_SIGNED = 0x01
_SIGNATURE_SIZE = 13


class Record(NamedTuple):
    """One record; ``time_us`` is since the Unix epoch."""

    time_us: int
    message_id: int
    frame: bytes


def encode_record(time_us: int, frame: bytes | memoryview) -> bytes:
    """Return the record of one frame, received or sent at ``time_us`` since the Unix epoch."""
    return _TIME.pack(time_us & ~_LINK_BITS) + frame


def _frame_size_and_id(data: memoryview) -> tuple[int, int] | None:
    if len(data) < 10:  # only a v1 frame of 8 bytes at the end
        return (data[1] + 8, data[5]) if len(data) >= 8 and data[0] == _MAGIC_V1 else None
    if data[0] == _MAGIC_V2:
        signature = _SIGNATURE_SIZE if data[2] & _SIGNED else 0
        return data[1] + 12 + signature, data[7] | data[8] << 8 | data[9] << 16
    if data[0] == _MAGIC_V1:
        return data[1] + 8, data[5]
    return None


def decode_records(data: bytes) -> Iterator[Record]:
    """Yield the records of a log up to its end or its first invalid byte.

    A truncated record at the end is left out. Checksums are not checked.
    """
    view = memoryview(data)
    at = 0
    while len(view) - at > _TIME.size:
        found = _frame_size_and_id(view[at + _TIME.size : at + _TIME.size + 10])
        if found is None or at + _TIME.size + found[0] > len(view):
            return
        size, message_id = found
        start = at + _TIME.size
        yield Record(_TIME.unpack_from(view, at)[0], message_id, bytes(view[start : start + size]))
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
