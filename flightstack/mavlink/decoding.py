"""Received frames as pymavlink's message objects, whose fields are decoded when one of them is read.

Most messages of a stream are counted and not read. ``received_class`` returns a subclass of pymavlink's class of a
message. It holds the frame, reads the header from it, and takes all other constant parts from the class.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from operator import itemgetter
from typing import Any

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import TEXT_FIELDS, clean
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER, HEADER_V1, HEADER_V2, MAGIC_V1, MAGIC_V2

_Values = tuple[Any, ...]


class _ReceivedMessage:
    """The part of a received message that all classes share; ``_msgbuf`` is the frame, of either version.

    Everything that is derived from the frame is computed once, at its first use.
    """

    __slots__ = ()
    _msgbuf: bytes
    _message_id: int

    def get_msgId(self) -> int:  # noqa: N802  # pymavlink's name
        """Return the message id."""
        return self._message_id

    def get_seq(self) -> int:
        """Return the sequence number."""
        frame = self._msgbuf
        return frame[2] if frame[0] == MAGIC_V1 else frame[4]

    def get_srcSystem(self) -> int:  # noqa: N802
        """Return the system id of the sender."""
        frame = self._msgbuf
        return frame[3] if frame[0] == MAGIC_V1 else frame[5]

    def get_srcComponent(self) -> int:  # noqa: N802
        """Return the component id of the sender."""
        frame = self._msgbuf
        return frame[4] if frame[0] == MAGIC_V1 else frame[6]


class _Part:
    """An attribute of received messages that is computed at its first use, with all that ``compute`` returns.

    Attributes that were set before keep their values.
    """

    def __init__(self, kind: Any, name: str, compute: Callable[[bytes], dict[str, Any]]) -> None:
        self._kind = kind
        self._name = name
        self._compute = compute

    def __get__(self, message: Any, _: Any) -> Any:
        if message is None:
            return getattr(
                self._kind, self._name
            )  # a message may have a field with the name of a class attribute
        parts = self._compute(message._msgbuf)
        parts.update(message.__dict__)
        message.__dict__ = parts
        return parts[self._name]


class _ReceivedClasses(dict[Any, Any]):
    """Computes an entry at its first use."""

    def __missing__(self, kind: Any) -> Any:
        of_constructor = vars(kind(*[b"" if name in TEXT_FIELDS[kind] else 0 for name in kind.fieldnames]))
        fields = {*kind.fieldnames, *(f"_{name}_raw" for name in TEXT_FIELDS[kind])}
        attributes = {name: value for name, value in of_constructor.items() if name not in fields}
        decode = _decoder(kind)
        attributes |= {name: _Part(kind, name, decode) for name in fields}
        attributes |= {name: _Part(kind, name, _envelope) for name in ("_header", "_payload", "_crc")}
        attributes |= {"__slots__": (), "__doc__": kind.__doc__, "_message_id": kind.id}
        del attributes["_msgbuf"]
        self[kind] = type(kind.__name__, (_ReceivedMessage, kind), attributes)
        return self[kind]


_CLASSES = _ReceivedClasses()


def received(frame: bytes, kind: Any) -> Any:
    """Return the message in a frame of either version with a verified checksum; ``kind`` is its class.

    It equals that of ``mavlink.MAVLink.decode``, but its buffers are ``bytes``, and its texts are safe to print.
    """
    message = object.__new__(_CLASSES[kind])
    message._msgbuf = frame
    return message


def field_reader(name: str, *fields: str) -> Callable[[Any], Any]:
    """Return a function that reads numbers of the received messages ``name`` without decoding all fields.

    It returns a tuple, or the value if there is one field.
    """
    kind = getattr(mavlink, f"MAVLink_{name.lower()}_message")
    places, unpack = _places(kind), _unpacker(kind)
    pick = itemgetter(*(places[field] for field in fields))

    def read(message: Any) -> Any:
        return pick(unpack(message._msgbuf))

    return _number_reader(kind, *fields, read) if len(fields) == 1 else read


def _number_reader(kind: Any, field: str, read_any: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function that reads one number where it stands; ``read_any`` reads it in other frames."""
    codes = re.findall(r"\d*[a-zA-Z]", kind.unpacker.format)
    index = kind.ordered_fieldnames.index(field)
    offset, number = struct.calcsize("<" + "".join(codes[:index])), struct.Struct(f"<{codes[index]}")
    unpack_from, start, end = number.unpack_from, HEADER_V2 + offset, offset + number.size

    def read(message: Any) -> Any:
        frame = message._msgbuf
        if frame[0] == MAGIC_V2 and frame[1] >= end:
            return unpack_from(frame, start)[0]
        return read_any(message)

    return read


def _envelope(frame: bytes) -> dict[str, Any]:
    """Return what surrounds the fields of a frame."""
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
    return {
        "_header": mavlink.MAVLink_header(
            message_id, incompatible, compatible, length, sequence, system, component
        ),
        "_payload": frame[HEADER_V1:end],  # as pymavlink's, also in version 2
        "_crc": int.from_bytes(frame[end : end + CHECKSUM_SIZE], "little"),
    }


def _decoder(kind: Any) -> Callable[[bytes], dict[str, Any]]:
    """Return a function that decodes the fields of a frame."""
    places, texts, unpack = _places(kind), TEXT_FIELDS[kind], _unpacker(kind)
    names = tuple(places)
    if len(names) == kind.lengths.count(1) and not texts:
        return lambda frame: dict(zip(names, unpack(frame), strict=True))

    def decode(frame: bytes) -> dict[str, Any]:
        values = unpack(frame)
        fields: dict[str, Any] = {
            name: list(values[place]) if place.__class__ is slice else values[place]
            for name, place in places.items()
        }
        for name in texts:
            raw = fields[f"_{name}_raw"] = fields[name].rstrip(b"\0")
            fields[name] = clean(raw.partition(b"\0")[0].decode("ascii", errors="replace"))
        return fields

    return decode


def _places(kind: Any) -> dict[str, int | slice]:
    """Return the place of each field in the unpacked values of a payload."""
    places: dict[str, int | slice] = {}
    start = 0
    for name, length in zip(kind.ordered_fieldnames, kind.lengths, strict=True):
        places[name] = start if length == 1 else slice(start, start + length)
        start += length
    return places


def _unpacker(kind: Any) -> Callable[[bytes], _Values]:
    """Return a function that unpacks the payload of a frame; zeros at its end are not sent."""
    size, unpack, unpack_from = kind.unpacker.size, kind.unpacker.unpack, kind.unpacker.unpack_from

    def unpacked(frame: bytes) -> _Values:
        start = HEADER_V1 if frame[0] == MAGIC_V1 else HEADER_V2
        length = frame[1]
        values: _Values
        if length >= size:
            values = unpack_from(frame, start)
        else:
            values = unpack(frame[start : start + length].ljust(size, b"\0"))
        return values

    return unpacked
