"""Encoding of parameter values in the bits of a float, as in PX4 and MAVLink's specification.

REAL32 is the float itself; INT32 is the bit pattern of the integer, not its value.
https://mavlink.io/en/services/parameter.html#parameter-encoding
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from typing import NamedTuple

from flightstack.core.float32 import shortest
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message

INT32: int = mavlink.MAV_PARAM_TYPE_INT32
REAL32: int = mavlink.MAV_PARAM_TYPE_REAL32
UINT32: int = mavlink.MAV_PARAM_TYPE_UINT32

LARGEST_INTEGER = 2**22
"""Largest integer that every codec preserves: some beyond it have the bits of a signalling NaN, which codecs that
convert to a 64-bit float (pymavlink on x86) change."""

HASH_NAME = "_HASH_CHECK"
"""Name of PX4's digest of all parameters, by which QGroundControl validates its parameter cache."""
NO_INDEX = 65535
"""Index of a PARAM_VALUE that is not in the list."""

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


def parse_value(message: Message) -> Parameter | None:
    """Return the parameter of a PARAM_VALUE, or None for an unsupported type.

    Unsupported are smaller integers, which ArduPilot casts instead of copying bits, and 64-bit types.
    """
    if message.param_type == REAL32:
        value = shortest(message.param_value)
    elif message.param_type == INT32:
        value = float(integer_of(message.param_value))
    elif message.param_type == UINT32:
        value = float(unsigned_of(message.param_value))
    else:
        return None
    is_integer = message.param_type != REAL32
    return Parameter(message.param_id, value, is_integer, message.param_index, message.param_count)


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
