"""How parameter values travel: in the bits of a float, as PX4 and the MAVLink specification have it.

A REAL32 parameter is the float itself, an INT32 parameter its four bytes in the float's place (not its value).
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
"""Integers up to this size survive every codec: the bits of some beyond it are a signalling NaN, which
a codec that passes through a 64-bit float (pymavlink's, on x86) changes."""

HASH_NAME = "_HASH_CHECK"
"""Name under which PX4 sends the digest of all parameters; QGroundControl then uses those that it remembers."""
NO_INDEX = 65535
"""Index of a PARAM_VALUE outside of the list."""

_FLOAT, _INT, _UNSIGNED = struct.Struct("<f"), struct.Struct("<i"), struct.Struct("<I")
_ALL_ONES = 0xFFFFFFFF


class Parameter(NamedTuple):
    """One parameter as it was told by a vehicle."""

    name: str
    value: float
    is_integer: bool
    place: int
    """Its index in the vehicle's list."""
    total: int
    """Number of parameters that the vehicle has."""


def type_of(is_integer: bool) -> int:
    """Return the MAV_PARAM_TYPE of a parameter."""
    return INT32 if is_integer else REAL32


def wire_value(value: float, is_integer: bool) -> float:
    """Return what goes into the field ``param_value``; ``value`` is finite and fits its type."""
    if is_integer:
        return float(_FLOAT.unpack(_INT.pack(int(value)))[0])
    return value


def integer_of(param_value: float) -> int:
    """Return the signed integer whose bits ``param_value`` holds."""
    return int(_INT.unpack(_FLOAT.pack(param_value))[0])


def unsigned_of(param_value: float) -> int:
    """Return the unsigned integer whose bits ``param_value`` holds."""
    return int(_UNSIGNED.unpack(_FLOAT.pack(param_value))[0])


def value_message(name: str, value: float, is_integer: bool, index: int, count: int) -> Message:
    """Return the PARAM_VALUE of a parameter."""
    return mavlink.MAVLink_param_value_message(
        name.encode("ascii"), wire_value(value, is_integer), type_of(is_integer), count, index
    )


def parse_value(message: Message) -> Parameter | None:
    """Return the parameter of a PARAM_VALUE; None for a type that no vehicle of ours or PX4's has.

    Smaller integers (ArduPilot's) are cast and not bytewise; 64-bit types do not fit at all.
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
    """Return the digest of (name, value, is integer) in the order of names, as PX4 and QGroundControl count it.

    It is CRC-32 over names and 4-byte values, without the usual inversion at its beginning and end.
    """
    state = _ALL_ONES  # zlib inverts at both ends: undone by inverting again here and below
    for name, value, is_integer in parameters:
        state = zlib.crc32(name.encode("ascii"), state)
        state = zlib.crc32(_INT.pack(int(value)) if is_integer else _FLOAT.pack(value), state)
    return state ^ _ALL_ONES


def digest_message(value: int, count: int) -> Message:
    """Return the PARAM_VALUE that carries the digest of ``count`` parameters.

    One digest in 512 is a signalling NaN and arrives changed (see ``LARGEST_INTEGER``): the ground station
    then asks for the list.
    """
    bits = float(_FLOAT.unpack(_UNSIGNED.pack(value))[0])
    return mavlink.MAVLink_param_value_message(HASH_NAME.encode(), bits, UINT32, count, NO_INDEX)
