"""Telemetry logs (tlog) as bytes: each frame behind its time, as MAVProxy and QGroundControl write them.

A record is a big-endian uint64, µs since the Unix epoch, and one MAVLink frame as it was on the wire.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

_TIME = struct.Struct(">Q")
_LINK_BITS = 3  # readers take the time's lowest two bits for the number of the link
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
    if len(data) < 10:  # a v1 frame may be as short as 8, but then no frame follows it either
        return (data[1] + 8, data[5]) if len(data) >= 8 and data[0] == _MAGIC_V1 else None
    if data[0] == _MAGIC_V2:
        signature = _SIGNATURE_SIZE if data[2] & _SIGNED else 0
        return data[1] + 12 + signature, data[7] | data[8] << 8 | data[9] << 16
    if data[0] == _MAGIC_V1:
        return data[1] + 8, data[5]
    return None


def decode_records(data: bytes) -> Iterator[Record]:
    """Yield the records of a log up to its end or to the first byte that is no record.

    A killed writer leaves a cut record at the end; that one is left out. Checksums are not checked.
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
