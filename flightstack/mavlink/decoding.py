"""Decoding of received frames into pymavlink's message objects, in 0.6 of the time that its decoder takes. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import TEXT_FIELDS
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER, HEADER_V1, HEADER_V2, MAGIC_V1, checksum

_Values = tuple[Any, ...]


class _Recipe(NamedTuple):
    """How messages of a class are made."""

    size: int
    """Bytes of a whole payload; zeros at its end are not sent."""
    unpack: Callable[[bytes], _Values]
    fields_of: Callable[[_Values], dict[str, Any]]
    """Returns the fields of the unpacked values."""
    attributes: dict[str, Any]
    """What the constructor sets besides the fields."""


def decoded(frame: bytes, kind: Any) -> Any:
    """Return the message in a frame of either version; None for a wrong checksum.

    ``kind`` is its class, one without text fields. The message equals that of ``mavlink.MAVLink.decode``, but its
    buffers are ``bytes``.
    """
    if frame[0] == MAGIC_V1:
        start, (_, length, sequence, system, component, message_id) = HEADER_V1, frame[:HEADER_V1]
        incompatible = compatible = 0
    else:
        start = HEADER_V2
        _, length, incompatible, compatible, sequence, system, component, low, high = HEADER.unpack_from(
            frame
        )
        message_id = low | high << 16
    end = start + length
    received = frame[end : end + CHECKSUM_SIZE]
    if checksum(frame[1:end], kind.crc_extra) != received:
        return None
    size, unpack, fields_of, attributes = _RECIPES[kind]
    payload = frame[start : min(end, start + size)]
    message = kind.__new__(kind)
    message.__dict__ = {
        **attributes,
        **fields_of(unpack(payload.ljust(size, b"\0"))),
        "_header": mavlink.MAVLink_header(
            message_id, incompatible, compatible, length, sequence, system, component
        ),
        "_msgbuf": frame,
        "_payload": frame[HEADER_V1:end],  # as pymavlink's, also in version 2
        "_crc": int.from_bytes(received, "little"),
    }
    return message


class _Recipes(dict[Any, _Recipe]):
    """Computes an entry at its first use."""

    def __missing__(self, kind: Any) -> _Recipe:
        assert not TEXT_FIELDS[kind]
        of_constructor = vars(kind(*[0] * len(kind.fieldnames)))
        attributes = {name: value for name, value in of_constructor.items() if name.startswith("_")}
        self[kind] = _Recipe(kind.unpacker.size, kind.unpacker.unpack, _fields_of(kind), attributes)
        return self[kind]


_RECIPES = _Recipes()


def _fields_of(kind: Any) -> Callable[[_Values], dict[str, Any]]:
    names = tuple(kind.ordered_fieldnames)
    if len(names) == kind.lengths.count(1):
        return lambda values: dict(zip(names, values, strict=True))
    places: list[int | slice] = []
    start = 0
    for length in kind.lengths:
        places.append(start if length == 1 else slice(start, start + length))
        start += length
    return lambda values: {
        name: list(values[place]) if place.__class__ is slice else values[place]
        for name, place in zip(names, places, strict=True)
    }
