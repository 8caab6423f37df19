"""Find MAVLink frames in bytes: bounded in memory and in work, whatever arrives. Pure.

pymavlink's own search keeps every octet it has seen as long as one frame is incomplete, and drops a whole
would-be frame on a fault, with the good ones inside it. This one holds less than one frame, and looks again right
behind the faulty start.
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
"""So many false starts in one piece of data, and the rest of it is not worth looking at."""

# a frame begins here: of version 2 only with flags that the specification lets us understand (0x01: signed)
_BEGINNING = re.compile(rb"\xfd.[\x00\x01]|\xfe|\xfd.?\Z", re.DOTALL)


def checksum(body: bytes, crc_extra: int) -> bytes:
    """Return the checksum of a frame's bytes between magic and checksum, as two bytes."""
    return crc16.mcrf4xx(b"%b%c" % (body, crc_extra)).to_bytes(CHECKSUM_SIZE, "little")


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
    """One frame as it was received."""

    data: bytes
    message_id: int
    known: bool
    """Whether the dialect has the message. The checksum of an unknown one cannot be verified."""


class FrameReader:
    """Cuts a stream, or datagrams, into frames."""

    def __init__(self) -> None:
        self._rest = b""
        self.faults = 0
        """Runs of octets that are no frame."""

    @property
    def partial_size(self) -> int:
        """Bytes kept of a frame whose rest has not come; less than one frame."""
        return len(self._rest)

    @property
    def has_partial(self) -> bool:
        """Tell whether the beginning of a frame is held."""
        return bool(self._rest)

    def feed(self, data: bytes | bytearray | memoryview) -> list[Frame]:
        """Return the frames that ``data`` completes."""
        new = bytes(data)
        if self._rest and _begins_with_frame(new):
            self._rest = b""  # a frame does not go on after another one: what is held was none
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
    """Return the size of the frame that begins at ``start``; None while its header is too short to tell."""
    if start + 3 > len(buffer):
        return None
    if buffer[start] == MAGIC_V1:
        return HEADER_V1 + buffer[start + 1] + CHECKSUM_SIZE
    signature = SIGNATURE_SIZE if buffer[start + 2] & mavlink.MAVLINK_IFLAG_SIGNED else 0
    return HEADER_V2 + buffer[start + 1] + CHECKSUM_SIZE + signature


def checked(data: bytes) -> Frame | None:
    """Return the frame that ``data`` is, or None when its checksum is wrong.

    Unknown messages are frames in version 2 only, where two octets of the header have to fit.
    """
    message_id = message_id_of(data)
    end = (HEADER_V1 if data[0] == MAGIC_V1 else HEADER_V2) + data[1]
    kind = mavlink.mavlink_map.get(message_id)
    if data[0] == MAGIC_V1 and (kind is None or data[1] > kind.unpacker.size):
        return None  # one in 256 octets of noise begins such a frame: only a checksum may speak for it
    if kind is None:
        return Frame(data, message_id, known=False)
    if checksum(data[1:end], kind.crc_extra) != data[end : end + CHECKSUM_SIZE]:
        return None
    return Frame(data, message_id, known=True)


def _begins_with_frame(data: bytes) -> bool:
    """Tell whether ``data`` begins with a whole frame whose checksum was verified."""
    if not _BEGINNING.match(data):
        return False
    size = frame_size(data, 0)
    if size is None or size > len(data):
        return False
    frame = checked(data[:size])
    return frame is not None and frame.known


class FrameFinder:
    """Cuts a stream into known frames whose checksum is right; all other bytes are junk.

    It keeps at most the beginning of one frame.
    """

    def __init__(self) -> None:
        self._held = b""
        self.junk = 0
        """Stretches of bytes that were no frame."""

    @property
    def partial_size(self) -> int:
        """Bytes kept of a frame whose rest has not come; less than one frame."""
        return len(self._held)

    def find(self, data: bytes | memoryview) -> list[bytes]:
        """Take ``data`` and return the frames that are complete now."""
        stream = self._held + bytes(data)
        frames: list[bytes] = []
        decided, at = 0, 0
        incomplete: int | None = None  # the first beginning whose rest has not come
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
