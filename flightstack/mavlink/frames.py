"""MAVLink frames: packing, and parsing of byte streams with bounded memory and work. Pure.

pymavlink's parser keeps all received bytes while a frame is incomplete, and on an error drops a whole apparent frame
with the good frames inside it. The parsers here hold less than one frame and resume right after a false start.
"""

from __future__ import annotations

import re
import struct
from typing import NamedTuple

from fastcrc import crc16

from flightstack.mavlink.dialect import mavlink

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
HEADER_V1, HEADER_V2 = 6, 10
"""Bytes before the payload."""
HEADER = struct.Struct("<BBBBBBBHB")
"""Header of version 2: magic, payload length, incompatible and compatible flags, sequence, system, component, and
the message id as 16 and 8 bits."""
CHECKSUM_SIZE, SIGNATURE_SIZE = 2, 13
LARGEST_FRAME = HEADER_V2 + 255 + CHECKSUM_SIZE + SIGNATURE_SIZE
MAX_FAULTS = 32
"""False starts in one piece of data after which the rest of it is dropped."""

# start of a frame; version 2 only with known incompatibility flags (0x01: signed)
_BEGINNING = re.compile(rb"\xfd.[\x00\x01]|\xfe|\xfd.?\Z", re.DOTALL)


_BYTES = [bytes((value,)) for value in range(256)]


def checksum(body: bytes, crc_extra: int) -> bytes:
    """Return the checksum of a frame's bytes between magic and checksum, as two bytes."""
    return crc16.mcrf4xx(b"%b%c" % (body, crc_extra)).to_bytes(CHECKSUM_SIZE, "little")


def has_checksum(frame: bytes, start: int, crc_extra: int) -> bool:
    """Return True if the checksum of a complete frame is right; its payload begins at ``start``."""
    end = start + frame[1]
    computed: int = crc16.mcrf4xx(frame[1:end] + _BYTES[crc_extra])
    return computed == frame[end] | frame[end + 1] << 8


def pack_frame(
    message_id: int, payload: bytes, crc_extra: int, sequence: int, system_id: int, component_id: int
) -> bytes:
    """Return an unsigned MAVLink 2 frame; ``payload`` has no trailing zeros."""
    body = HEADER.pack(
        MAGIC_V2, len(payload), 0, 0, sequence, system_id, component_id, message_id & 0xFFFF, message_id >> 16
    )
    frame = body + payload
    return frame + checksum(frame[1:], crc_extra)


def message_id_of(frame: bytes) -> int:
    """Return the message id in the header of a frame of either version."""
    return int.from_bytes(frame[7:HEADER_V2], "little") if frame[0] == MAGIC_V2 else frame[5]


class Frame(NamedTuple):
    """A received frame."""

    data: bytes
    message_id: int
    known: bool
    """True if the dialect has the message. The checksum of an unknown one cannot be verified."""


class FrameReader:
    """Splits a byte stream or datagrams into frames."""

    def __init__(self) -> None:
        self._rest = b""
        self.faults = 0
        """Runs of bytes that are no frame."""

    @property
    def partial_size(self) -> int:
        """Bytes held of an incomplete frame."""
        return len(self._rest)

    @property
    def has_partial(self) -> bool:
        """True if an incomplete frame is held."""
        return bool(self._rest)

    def feed(self, data: bytes | bytearray | memoryview) -> list[Frame]:
        """Return the frames that ``data`` completes."""
        new = bytes(data)
        if self._rest and _begins_with_frame(new):
            self._rest = b""  # a frame does not continue after another one: the held bytes were none
            self.faults += 1
        buffer = self._rest + new
        frames: list[Frame] = []
        at, most, in_junk = 0, self.faults + MAX_FAULTS, False
        while self.faults < most:
            beginning = _BEGINNING.search(buffer, at)
            start = len(buffer) if beginning is None else beginning.start()
            if start > at and not in_junk:
                self.faults += 1
            size = frame_size(buffer, start)
            if size is None or start + size > len(buffer):
                self._rest = buffer[start:]
                return frames
            frame = checked(buffer[start : start + size])
            if frame is None:
                self.faults += 1
                at, in_junk = start + 1, True
            else:
                frames.append(frame)
                at, in_junk = start + size, False
        self._rest = b""
        return frames


def frame_size(buffer: bytes, start: int) -> int | None:
    """Return the size of the frame at ``start``, or None if its header is incomplete."""
    if start + 3 > len(buffer):
        return None
    if buffer[start] == MAGIC_V1:
        return HEADER_V1 + buffer[start + 1] + CHECKSUM_SIZE
    signature = SIGNATURE_SIZE if buffer[start + 2] & mavlink.MAVLINK_IFLAG_SIGNED else 0
    return HEADER_V2 + buffer[start + 1] + CHECKSUM_SIZE + signature


def checked(data: bytes) -> Frame | None:
    """Return the frame in ``data``, or None for a wrong checksum.

    Unknown messages are accepted in version 2 only, where two more header bytes must match.
    """
    message_id = message_id_of(data)
    start = HEADER_V1 if data[0] == MAGIC_V1 else HEADER_V2
    kind = mavlink.mavlink_map.get(message_id)
    if data[0] == MAGIC_V1 and (kind is None or data[1] > kind.unpacker.size):
        return None  # one in 256 noise bytes starts such a frame: only a checksum can confirm it
    if kind is None:
        return Frame(data, message_id, known=False)
    if not has_checksum(data, start, kind.crc_extra):
        return None
    return Frame(data, message_id, known=True)


def _begins_with_frame(data: bytes) -> bool:
    """Return True if ``data`` begins with a complete frame with a verified checksum."""
    if not _BEGINNING.match(data):
        return False
    size = frame_size(data, 0)
    if size is None or size > len(data):
        return False
    frame = checked(data[:size])
    return frame is not None and frame.known


class FrameFinder:
    """Finds all intact frames of the simulator link among any other bytes.

    ``FrameReader`` waits for the rest of an apparent frame and gives up after many false starts, which suits ground
    links, where lost messages are resent. In lockstep a frame held back would stop both sides, so this parser also
    searches behind an incomplete frame. It keeps at most one incomplete frame.
    """

    def __init__(self) -> None:
        self._held = b""
        self.junk = 0
        """Runs of bytes that are no frame."""

    @property
    def partial_size(self) -> int:
        """Bytes held of an incomplete frame."""
        return len(self._held)

    def find(self, data: bytes | memoryview) -> list[bytes]:
        """Return the frames that ``data`` completes."""
        stream = self._held + bytes(data)
        frames: list[bytes] = []
        decided, at = 0, 0
        incomplete: int | None = None  # start of the first incomplete frame
        while (match := _BEGINNING.search(stream, at)) is not None:
            start = match.start()
            size = frame_size(stream, start)
            at = start + 1
            if size is None or start + size > len(stream):
                incomplete = start if incomplete is None else incomplete
                continue
            frame = checked(stream[start : start + size])
            if frame is None or not frame.known:
                continue
            self.junk += start > decided
            frames.append(frame.data)
            decided = at = start + size
            incomplete = None
        keep_from = len(stream) if incomplete is None else incomplete
        self.junk += keep_from > decided
        self._held = stream[keep_from:]
        return frames
