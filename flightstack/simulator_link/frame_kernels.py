"""The frames of the lockstep exchange in compiled code.

They are those of ``hot_frames``, ``sensor_frames`` and ``battery_frame``: a frame that is not exactly as expected is
left to them. A module of its own, with few imports: the key of a kernel in the cache depends on all of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.record_types import dtype_of

HEADER, CHECKSUM = 10, 2
"""Bytes before and after the payload."""
VALUES_AT, FIELDS_AT, NUMBER_AT = 8, 60, 64
"""Places in the payload of HIL_SENSOR: measurements, bits of the new ones, and number of the sensor."""


_STRIDE = 8
"""Bytes that go into a checksum at once: one by one, each waits for the result of the last."""


def _tables() -> np.ndarray[Any, np.dtype[np.int32]]:
    """Return the checksums (CRC-16/MCRF4XX) of single bytes that k zeros follow, in row k, shape (8, 256).

    That of several bytes is the exclusive or of theirs.
    """
    first = np.arange(256, dtype=np.int32)
    for _ in range(8):
        first = (first >> 1) ^ np.where(first & 1, np.int32(0x8408), np.int32(0))
    rows = [first]
    while len(rows) < _STRIDE:
        rows.append((rows[-1] >> 8) ^ first[rows[-1] & 0xFF])
    return np.array(rows)


_CHECKSUMS = _tables()


class SensorNews(NamedTuple):
    """What a simulator sends besides the inertial sensors: 1 for a new measurement."""

    has_mag: int
    has_baro: int
    has_gnss: int


SENSOR_NEWS = dtype_of(SensorNews)


class Shape(NamedTuple):
    """What identifies a message, and where its payload ends."""

    size: int
    """Of the payload, not truncated."""
    extra: int
    """CRC_EXTRA, the last byte that goes into the checksum."""
    first_id: int
    """Bytes of the message id."""
    second_id: int
    third_id: int


SHAPE = dtype_of(Shape)


@compiled
def checksum_of(data: Any, begin: int, end: int, extra: int) -> int:
    """Return the checksum of the bytes from ``begin`` to before ``end``, and of ``extra``."""
    total, at = 0xFFFF, begin
    while at + _STRIDE <= end:
        first, second = (total ^ data[at]) & 0xFF, ((total >> 8) ^ data[at + 1]) & 0xFF
        total = int(_CHECKSUMS[_STRIDE - 1, first] ^ _CHECKSUMS[_STRIDE - 2, second])
        for i in range(2, _STRIDE):
            total ^= int(_CHECKSUMS[_STRIDE - 1 - i, data[at + i]])
        at += _STRIDE
    for i in range(at, end):
        total = (total >> 8) ^ int(_CHECKSUMS[0, (total ^ data[i]) & 0xFF])
    return (total >> 8) ^ int(_CHECKSUMS[0, (total ^ extra) & 0xFF])


@compiled
def read_bytes(data: Any, at: int, count: int) -> int:
    """Return an unsigned number of ``count`` bytes, little-endian."""
    value = 0
    for i in range(count):
        value |= int(data[at + i]) << (8 * i)
    return value


@compiled
def write_bytes(data: Any, at: int, count: int, value: int) -> None:
    """Write an unsigned number as ``count`` bytes, little-endian."""
    for i in range(count):
        data[at + i] = (value >> (8 * i)) & 0xFF


@compiled
def frame_size(data: Any, at: int, end: int, shape: Any) -> int:
    """Return the size of the intact frame of the message at ``at``, within ``end``; 0 if there is none."""
    if end - at < HEADER + CHECKSUM + 1 or data[at] != 0xFD or data[at + 2] != 0:
        return 0
    size, shape = int(data[at + 1]), shape[0]
    crc_at = at + HEADER + size
    if size == 0 or size > shape["size"] or crc_at + CHECKSUM > end:
        return 0
    if (
        data[at + 7] != shape["first_id"]
        or data[at + 8] != shape["second_id"]
        or data[at + 9] != shape["third_id"]
    ):
        return 0
    if checksum_of(data, at + 1, crc_at, shape["extra"]) != read_bytes(data, crc_at, CHECKSUM):
        return 0
    return HEADER + size + CHECKSUM


@compiled
def seal_payload(frame: Any, size: int, extra: int) -> int:
    """Complete the frame around a payload of ``size`` bytes; return the size of the frame."""
    frame[1] = size
    frame[4] = (frame[4] + 1) & 0xFF
    write_bytes(frame, HEADER + size, CHECKSUM, checksum_of(frame, 1, HEADER + size, extra))
    return HEADER + size + CHECKSUM


@compiled
def seal(frame: Any, time_us: int, size: int, extra: int) -> int:
    """Complete the frame around a payload of ``size`` bytes that begins with the time; return the size of the frame."""
    write_bytes(frame, HEADER, 8, time_us)
    return seal_payload(frame, size, extra)
