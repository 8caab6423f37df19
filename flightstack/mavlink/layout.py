"""Wire layout of a dialect message, and the pymavlink message class made from it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common


class Field(NamedTuple):
    """One field, in wire order."""

    name: str
    format: str
    length: int
    is_array: bool
    type: str
    unit: str
    declared_index: int
    is_extension: bool = False
    """True for an extension field, which is zero if not sent."""

    @property
    def is_text(self) -> bool:
        """True for an array of characters, which pymavlink takes as bytes and returns as a string."""
        return self.type == "char" and self.is_array

    @property
    def code(self) -> str:
        """``struct`` format of the field."""
        return f"{self.length}{self.format}" if self.length > 1 else self.format

    @property
    def zero(self) -> Any:
        """Default value of an extension field."""
        if self.is_text:
            return b""
        return [0] * self.length if self.is_array else 0


class Layout(NamedTuple):
    """A message with its fields in wire order (MAVLink sorts them by type size)."""

    message_id: int
    name: str
    crc_extra: int
    fields: tuple[Field, ...]

    @property
    def format(self) -> str:
        """``struct`` format of the payload."""
        return "<" + "".join(field.code for field in self.fields)

    @property
    def declared_fields(self) -> list[Field]:
        """The fields in the order of their declaration."""
        return sorted(self.fields, key=lambda field: field.declared_index)


def message_class(layout: Layout) -> Any:
    """Return a message class for ``layout`` that pymavlink can encode and decode."""
    fields = layout.fields
    declared = layout.declared_fields
    unpacker = struct.Struct(layout.format)
    return type(
        f"MAVLink_{layout.name.lower()}_message",
        (common.MAVLink_message,),
        {
            "id": layout.message_id,
            "msgname": layout.name,
            "name": layout.name,
            "fieldnames": [field.name for field in declared],
            "ordered_fieldnames": [field.name for field in fields],
            "fieldtypes": [field.type for field in declared],
            "fielddisplays_by_name": {},
            "fieldenums_by_name": {},
            "fieldunits_by_name": {field.name: field.unit for field in declared if field.unit},
            "native_format": bytearray(
                ("<" + "".join("c" if f.is_text else f.format for f in fields)).encode()
            ),
            "orders": [fields.index(field) for field in declared],
            "lengths": [1 if field.is_text else field.length for field in fields],
            "array_lengths": [field.length if field.is_array else 0 for field in fields],
            "crc_extra": layout.crc_extra,
            "unpacker": unpacker,
            "instance_field": None,
            "instance_offset": -1,
            "__init__": _initialiser(layout),
            "pack": _packer(layout, unpacker),
        },
    )


def _initialiser(layout: Layout) -> Callable[..., None]:
    """Return ``__init__`` of the message class."""
    declared = layout.declared_fields
    names = [field.name for field in declared]
    texts = frozenset(field.name for field in declared if field.is_text)
    zeros = {field.name: field.zero for field in declared if field.is_extension}

    def initialise(self: Any, *values: Any, **named: Any) -> None:
        common.MAVLink_message.__init__(self, layout.message_id, layout.name)
        self._fieldnames = names
        self._instance_field = None
        self._instance_offset = -1
        given = {**zeros, **dict(zip(names, values, strict=False)), **named}
        if len(values) > len(names) or given.keys() != set(names):
            raise TypeError(f"{layout.name} takes the fields {', '.join(names)}")
        for name, value in given.items():
            if name in texts:
                setattr(self, f"_{name}_raw", value)
                setattr(self, name, value.split(b"\x00", 1)[0].decode("ascii", errors="replace"))
            else:
                setattr(self, name, value)

    return initialise


def _packer(layout: Layout, unpacker: struct.Struct) -> Callable[..., bytes]:
    """Return ``pack`` of the message class."""
    fields = layout.fields

    def pack(self: Any, mav: Any, force_mavlink1: bool = False) -> bytes:
        flat: list[Any] = []
        for field in fields:
            value = getattr(self, f"_{field.name}_raw" if field.is_text else field.name)
            flat.extend(value) if field.is_array and not field.is_text else flat.append(value)
        packed: bytes = self._pack(mav, layout.crc_extra, unpacker.pack(*flat), force_mavlink1=force_mavlink1)
        return packed

    return pack
