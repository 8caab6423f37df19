"""Wire layout of a message of our dialect, and the pymavlink message class made from it."""

from __future__ import annotations

import struct
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


class Layout(NamedTuple):
    """One message: its fields in wire order (largest type first, as MAVLink lays them out)."""

    message_id: int
    name: str
    crc_extra: int
    fields: tuple[Field, ...]

    @property
    def format(self) -> str:
        """Struct format of the whole payload."""
        return "<" + "".join(f"{f.length}{f.format}" if f.length > 1 else f.format for f in self.fields)


def message_class(layout: Layout) -> Any:
    """Return a message class for ``layout`` that pymavlink encodes and decodes as one of its own."""
    fields = layout.fields
    declared = sorted(fields, key=lambda field: field.declared_index)
    unpacker = struct.Struct(layout.format)

    def initialise(self: Any, *values: Any, **named: Any) -> None:
        common.MAVLink_message.__init__(self, layout.message_id, layout.name)
        self._fieldnames = names
        self._instance_field = None
        self._instance_offset = -1
        for name, value in zip(names, values, strict=False):
            setattr(self, name, value)
        for name, value in named.items():
            setattr(self, name, value)

    def pack(self: Any, mav: Any, force_mavlink1: bool = False) -> bytes:
        flat: list[Any] = []
        for field in fields:
            value = getattr(self, field.name)
            flat.extend(value) if field.is_array else flat.append(value)
        packed: bytes = self._pack(mav, layout.crc_extra, unpacker.pack(*flat), force_mavlink1=force_mavlink1)
        return packed

    names = [field.name for field in declared]
    return type(
        f"MAVLink_{layout.name.lower()}_message",
        (common.MAVLink_message,),
        {
            "id": layout.message_id,
            "msgname": layout.name,
            "name": layout.name,
            "fieldnames": names,
            "ordered_fieldnames": [field.name for field in fields],
            "fieldtypes": [field.type for field in declared],
            "fielddisplays_by_name": {},
            "fieldenums_by_name": {},
            "fieldunits_by_name": {field.name: field.unit for field in declared if field.unit},
            "native_format": bytearray(("<" + "".join(f.format for f in fields)).encode()),
            "orders": [fields.index(field) for field in declared],
            "lengths": [field.length for field in fields],
            "array_lengths": [field.length if field.is_array else 0 for field in fields],
            "crc_extra": layout.crc_extra,
            "unpacker": unpacker,
            "instance_field": None,
            "instance_offset": -1,
            "__init__": initialise,
            "pack": pack,
        },
    )
