"""Packets of MAVLink FTP in FILE_TRANSFER_PROTOCOL, per https://mavlink.io/en/services/ftp.html.

Little-endian: uint16 sequence number, uint8 session, opcode, size, requested opcode, burst complete, padding,
uint32 offset, then up to 239 bytes of data.
"""

from __future__ import annotations

import struct
import zlib
from enum import IntEnum
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message

MAX_DATA = 239
MAX_SEQUENCE = 0xFFFF
MAX_OFFSET = 0xFFFF_FFFF
_HEADER = struct.Struct("<HBBBBBxI")
_PAYLOAD = 251
_CRC_START = 0xFFFF_FFFF
UINT32 = struct.Struct("<I")


class Opcode(IntEnum):
    """Request or response code of a packet."""

    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


class FtpError(IntEnum):
    """Error code: the first data byte of a NAK."""

    NONE = 0
    FAIL = 1
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_EXISTS = 8
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


ERROR_TEXTS: dict[int, str] = {
    FtpError.FAIL: "it failed",
    FtpError.FAIL_ERRNO: "its file system failed",
    FtpError.INVALID_DATA_SIZE: "the request has a wrong size",
    FtpError.INVALID_SESSION: "the session is not open",
    FtpError.NO_SESSIONS_AVAILABLE: "too many files are open",
    FtpError.END_OF_FILE: "the end of the file was reached",
    FtpError.UNKNOWN_COMMAND: "it does not know the request",
    FtpError.FILE_EXISTS: "the file exists",
    FtpError.FILE_PROTECTED: "the file is protected",
    FtpError.FILE_NOT_FOUND: "there is no such file",
}


class Packet(NamedTuple):
    """One request or response. ``opcode`` and ``request`` are plain integers: any value may be received."""

    sequence: int
    session: int
    opcode: int
    size: int
    """Bytes in ``data``, or bytes requested."""
    request: int = 0
    """Opcode of the request that this packet answers."""
    burst_complete: bool = False
    offset: int = 0
    data: bytes = b""

    @property
    def path(self) -> str | None:
        """The path in ``data``, up to its first NUL; None if it is not UTF-8."""
        try:
            return self.data.split(b"\x00", 1)[0].decode()
        except UnicodeDecodeError:
            return None

    def pack(self) -> bytes:
        """Return the payload of FILE_TRANSFER_PROTOCOL, without trailing zeros."""
        return (
            _HEADER.pack(
                self.sequence,
                self.session,
                self.opcode,
                self.size,
                self.request,
                self.burst_complete,
                self.offset,
            )
            + self.data
        )


def next_sequence(sequence: int, steps: int = 1) -> int:
    """Return the sequence number ``steps`` after ``sequence``."""
    return (sequence + steps) & MAX_SEQUENCE


def read_packet(message: Message) -> Packet:
    """Return the packet of a FILE_TRANSFER_PROTOCOL message, without data if its size is invalid.

    ``size`` of a read request is the number of bytes requested.
    """
    payload = bytes(message.payload)
    sequence, session, opcode, size, request, burst_complete, offset = _HEADER.unpack_from(payload)
    if size > MAX_DATA:
        return Packet(sequence, session, opcode, size, request, bool(burst_complete), offset)
    data = payload[_HEADER.size : _HEADER.size + size]
    return Packet(sequence, session, opcode, size, request, bool(burst_complete), offset, data)


def ftp_message(target: Address, packet: Packet) -> Message:
    """Return the message with ``packet`` for ``target``."""
    return mavlink.MAVLink_file_transfer_protocol_message(0, *target, packet.pack().ljust(_PAYLOAD, b"\x00"))


def mavlink_crc32(data: bytes, crc: int = 0) -> int:
    """Return MAVLink's CRC-32 of ``data``, continued from ``crc``: polynomial 0xEDB88320, start and end 0.

    zlib's starts with all ones and inverts the result.
    """
    return zlib.crc32(data, crc ^ _CRC_START) ^ _CRC_START
