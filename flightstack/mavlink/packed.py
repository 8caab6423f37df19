"""Messages packed by precompiled formats, without pymavlink's message objects.

A message object takes 2 µs to construct and pack, ``Packing`` 1 µs, and a ``FramePacker`` for those that are sent most
often less still. Its format comes from pymavlink's message class, and a test compares the bytes of both for random
values of every field. All other messages are packed by ``payloads``.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from operator import itemgetter
from typing import Any, TypeAlias

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import PACKING_ERRORS, STRUCT_CODES, fit

Values: TypeAlias = tuple[float, ...]


class PackedMessage:
    """A payload with its message type; has the part of pymavlink's interface that sending needs."""

    __slots__ = ("packing", "payload")

    def __init__(self, packing: Packing, payload: bytes) -> None:
        self.packing = packing
        self.payload = payload
        """The payload without trailing zeros."""

    def get_type(self) -> str:
        """Return the name of the message type."""
        return self.packing.name

    def get_msgId(self) -> int:  # noqa: N802  # pymavlink's name
        """Return the message id."""
        return self.packing.message_id


class Packing:
    """Packs messages of one type, which has at least two fields and no text."""

    def __init__(self, name: str) -> None:
        kind = getattr(mavlink, f"MAVLink_{name.lower()}_message")
        lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))  # 0 for no array
        self.name = name
        self.message_id: int = kind.id
        self.crc_extra: int = kind.crc_extra
        self.codes: list[str] = []
        """``struct`` code of each value."""
        self._kind = kind
        self._parts: dict[str, slice | int] = {}  # of the values, by field
        ranges: dict[str, range] = {}
        for field, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True):
            begin, end = len(self.codes), len(self.codes) + (lengths[field] or 1)
            self._parts[field] = slice(begin, end) if lengths[field] else begin
            ranges[field] = range(begin, end)
            self.codes += [STRUCT_CODES[field_type]] * (end - begin)
        order = [index for field in kind.ordered_fieldnames for index in ranges[field]]
        self._in_wire_order: Callable[[Values], Values] = itemgetter(*order)
        wire_format = struct.Struct("<" + "".join(self.codes[index] for index in order))
        self._pack, self.size = wire_format.pack, wire_format.size
        self.offsets = self._offsets(order)
        """Offset of each value in the payload, whose ``size`` is that with trailing zeros."""
        self._zeros = (0,) * len(self.codes)

    def __call__(self, *values: float) -> PackedMessage:
        """Return the message of ``values`` in the order of declaration; items of an array are values of their own.

        Values that are missing at the end are zero.
        """
        if len(values) < len(self._zeros):
            values += self._zeros[len(values) :]
        try:
            payload = self._pack(*self._in_wire_order(values))
        except PACKING_ERRORS:
            payload = self._pack(*self._in_wire_order(self._fitted(values)))
        return PackedMessage(self, payload.rstrip(b"\x00") or b"\x00")

    def _offsets(self, order: list[int]) -> list[int]:
        offsets, end = [0] * len(order), 0
        for index in order:
            offsets[index] = end
            end += struct.calcsize("<" + self.codes[index])
        return offsets

    def message(self, *values: float) -> Any:
        """Return pymavlink's message of ``values``."""
        return self._kind(*(values[part] for part in self._parts.values()))

    def _fitted(self, values: Values) -> Values:
        message = self.message(*values)
        fit(message)
        fields = (getattr(message, name) for name in self._parts)
        return tuple(value for field in fields for value in (field if isinstance(field, list) else [field]))
