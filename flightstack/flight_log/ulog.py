"""Encoding of ULog messages, version 1 of PX4's ULog file format. Pure.

A file has a header, definitions (flag bits, formats, info, parameters) and a data section (subscriptions, data, logged
strings). A message is uint16 size, uint8 type, content, little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

from flightstack.mavlink.fields import fitted, int32

MAGIC = b"ULog\x01\x12\x35"
VERSION = 1

MESSAGE_HEADER = struct.Struct("<HB")
"""Header of a message: size of the content, type."""
_SUBSCRIPTION = struct.Struct("<BH")
_LOGGED_STRING = struct.Struct("<BQ")
_FLAG_BITS = bytes(40)  # no flags, no appended data
_MAX_CONTENT = 0xFFFF

HEADER_SIZE = len(MAGIC) + 1 + 8
"""Bytes of the file header, before the first message."""
DEFINITION_TYPES = frozenset(b"BFIMPQA")
"""Message types of the definitions; the first message of another type starts the data section."""
MESSAGE_TYPES = DEFINITION_TYPES | frozenset(b"DRLCSO")
DATA_HEADER = struct.Struct("<HBH")  # size, type 'D', subscription id
DATA_TYPE = ord("D")


def _message(kind: str, content: bytes) -> bytes:
    if len(content) > _MAX_CONTENT:
        raise ValueError(f"a ULog message holds at most {_MAX_CONTENT} bytes, this one has {len(content)}")
    return MESSAGE_HEADER.pack(len(content), ord(kind)) + content


def file_header(time_us: int) -> bytes:
    """Return the file header and the flag bits; ``time_us`` is the start of the log."""
    return MAGIC + struct.pack("<BQ", VERSION, time_us) + _message("B", _FLAG_BITS)


def whole_messages(data: bytes | memoryview, count: int, begin: int = 0) -> int:
    """Return how many of the first ``count`` bytes are complete messages after ``begin`` header bytes."""
    end = begin
    while end + MESSAGE_HEADER.size <= count:
        after = end + MESSAGE_HEADER.size + MESSAGE_HEADER.unpack_from(data, end)[0]
        if after > count:
            break
        end = after
    return end if end <= count else 0


def format_definition(name: str, fields: Iterable[tuple[str, int, str]]) -> bytes:
    """Define a topic from its fields (type, length of the array or 0, name), in the order of its data."""
    text = "".join(f"{kind}{f'[{length}]' if length else ''} {field};" for kind, length, field in fields)
    return _message("F", f"{name}:{text}".encode())


def _keyed(kind: str, key: str, value: bytes) -> bytes:
    name = key.encode()
    return _message(kind, bytes([len(name)]) + name + value)


def binary_information(key: str, value: bytes) -> bytes:
    """Return a multi-information message of one part: tools do not print its value, as they do an information's."""
    name = f"uint8_t[{len(value)}] {key}".encode()
    return _message("M", bytes([0, len(name)]) + name + value)


def information(key: str, value: str | int | float) -> bytes:
    """Return an information message; an int is stored as int32_t if it fits, else int64_t, a float as double."""
    if isinstance(value, str):
        text = value.encode()
        return _keyed("I", f"char[{len(text)}] {key}", text)
    if isinstance(value, float):
        return _keyed("I", f"double {key}", struct.pack("<d", value))
    if -(2**31) <= value < 2**31:
        return _keyed("I", f"int32_t {key}", struct.pack("<i", value))
    return _keyed("I", f"int64_t {key}", struct.pack("<q", value))


def parameter(name: str, value: float) -> bytes:
    """Return a parameter, as int32_t or float."""
    if isinstance(value, int):
        return _keyed("P", f"int32_t {name}", struct.pack("<i", int32(value)))
    return _keyed("P", f"float {name}", struct.pack("<f", fitted(value, "f", wraps=False)))


def subscription(message_id: int, name: str) -> bytes:
    """Bind ``message_id`` to the topic ``name`` (its only instance)."""
    return _message("A", _SUBSCRIPTION.pack(0, message_id) + name.encode())


def logged_string(time_us: int, level: int, text: str) -> bytes:
    """Return a text message; ``level`` is 0 (emergency) to 7 (debug), as in syslog and MAVLink."""
    return _message("L", _LOGGED_STRING.pack(ord("0") + level, time_us) + text.encode())
