"""Encoding of parameter values in the bits of a float, as in PX4 and MAVLink's specification.

REAL32 is the float itself; INT32 is the bit pattern of the integer, not its value.
https://mavlink.io/en/services/parameter.html#parameter-encoding
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterable
from typing import NamedTuple

from flightstack.core.float32 import as_float32, shortest
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message

INT32: int = mavlink.MAV_PARAM_TYPE_INT32
REAL32: int = mavlink.MAV_PARAM_TYPE_REAL32
UINT32: int = mavlink.MAV_PARAM_TYPE_UINT32

LARGEST_INTEGER = 2**22
"""Largest integer that every codec preserves: some beyond it have the bits of a signalling NaN, which codecs that
convert to a 64-bit float (pymavlink on x86) change."""

LARGEST_CAST_INTEGER = 2**24
"""Largest integer that a float holds with all smaller ones."""

HASH_NAME = "_HASH_CHECK"
"""Name of PX4's digest of all parameters, by which QGroundControl validates its parameter cache."""
NO_INDEX = 65535
"""Index of a PARAM_VALUE that is not in the list."""

_INTEGERS = {
    mavlink.MAV_PARAM_TYPE_UINT8: struct.Struct("<Bxxx"),
    mavlink.MAV_PARAM_TYPE_INT8: struct.Struct("<bxxx"),
    mavlink.MAV_PARAM_TYPE_UINT16: struct.Struct("<Hxx"),
    mavlink.MAV_PARAM_TYPE_INT16: struct.Struct("<hxx"),
    mavlink.MAV_PARAM_TYPE_UINT32: struct.Struct("<I"),
    mavlink.MAV_PARAM_TYPE_INT32: struct.Struct("<i"),
}
"""Bytes of the integer types in the field ``param_value``."""
_FLOAT, _INT, _UNSIGNED = struct.Struct("<f"), struct.Struct("<i"), struct.Struct("<I")
_ALL_ONES = 0xFFFFFFFF


class Parameter(NamedTuple):
    """A parameter received from a vehicle."""

    name: str
    value: float
    is_integer: bool
    place: int
    """Index in the vehicle's list."""
    total: int
    """Number of parameters of the vehicle."""
    kind: int | None = None
    """The MAV_PARAM_TYPE on the wire; None if it was not received."""


def type_of(is_integer: bool) -> int:
    """Return the MAV_PARAM_TYPE of a parameter."""
    return INT32 if is_integer else REAL32


def wire_value(value: float, is_integer: bool) -> float:
    """Return the field ``param_value``; ``value`` is finite and in the range of its type."""
    if is_integer:
        return float(_FLOAT.unpack(_INT.pack(int(value)))[0])
    return value


def integer_of(param_value: float) -> int:
    """Return the signed integer with the bits of ``param_value``."""
    return int(_INT.unpack(_FLOAT.pack(param_value))[0])


def unsigned_of(param_value: float) -> int:
    """Return the unsigned integer with the bits of ``param_value``."""
    return int(_UNSIGNED.unpack(_FLOAT.pack(param_value))[0])


def value_message(name: str, value: float, is_integer: bool, index: int, count: int) -> Message:
    """Return the PARAM_VALUE of a parameter."""
    return mavlink.MAVLink_param_value_message(
        name.encode("ascii"), wire_value(value, is_integer), type_of(is_integer), count, index
    )


def parse_value(message: Message, *, casts: bool = False) -> Parameter | None:
    """Return the parameter of a PARAM_VALUE, or None for a type of 64 bits or an integer that is not finite.

    ``casts``: integers are sent as the float of their value, as ArduPilot does, not in the bits of the float.
    """
    kind = message.param_type
    if kind == REAL32:
        value = shortest(message.param_value)
    elif kind not in _INTEGERS:
        return None
    elif casts:
        if not math.isfinite(message.param_value):
            return None
        value = float(round(message.param_value))
    else:
        value = float(_INTEGERS[kind].unpack(_FLOAT.pack(message.param_value))[0])
    return Parameter(message.param_id, value, kind != REAL32, message.param_index, message.param_count, kind)


def set_value(value: float, kind: int, *, casts: bool = False) -> float | None:
    """Return the field ``param_value`` of a PARAM_SET; None if ``value`` is outside the range of the type."""
    if kind == REAL32:
        return as_float32(value)
    layout = _INTEGERS[kind]
    try:
        packed = layout.pack(int(value))
    except struct.error:
        return None
    return float(int(value)) if casts else float(_FLOAT.unpack(packed)[0])


def digest(parameters: Iterable[tuple[str, float, bool]]) -> int:
    """Return the digest of (name, value, is integer) in the order of names, as PX4 and QGroundControl compute it.

    It is CRC-32 over names and 4-byte values without inversion at start and end.
    """
    state = _ALL_ONES  # zlib inverts at start and end: undone here and below
    for name, value, is_integer in parameters:
        state = zlib.crc32(name.encode("ascii"), state)
        state = zlib.crc32(_INT.pack(int(value)) if is_integer else _FLOAT.pack(value), state)
    return state ^ _ALL_ONES


def digest_message(value: int, count: int) -> Message:
    """Return the PARAM_VALUE with the digest of ``count`` parameters.

    One digest in 512 is a signalling NaN and may arrive changed (see ``LARGEST_INTEGER``); the ground station then
    requests the list.
    """
    bits = float(_FLOAT.unpack(_UNSIGNED.pack(value))[0])
    return mavlink.MAVLink_param_value_message(HASH_NAME.encode(), bits, UINT32, count, NO_INDEX)
