"""Payloads of pymavlink's message objects: one ``struct`` call on the fields.

pymavlink takes 8 µs to pack a message, since it makes objects of header, buffer and checksum as well. Tests compare the
bytes of all messages.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple, TypeAlias

from flightstack.mavlink.fields import PACKING_ERRORS, STRUCT_CODES, TEXT_FIELDS, fit

_Spread: TypeAlias = Callable[[Any], Sequence[Any]]


class _Format(NamedTuple):
    """How a type of message is packed: ``spreads`` return the values that an array is packed as, None for no array."""

    read: Callable[[Any], tuple[Any, ...]]
    pack: Callable[..., bytes]
    spreads: tuple[_Spread | None, ...]
    has_arrays: bool


class _Formats(dict[Any, _Format]):
    """Computes an entry at its first use."""

    def __missing__(self, kind: Any) -> _Format:
        types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
        names, codes = [], "<"
        spreads: list[_Spread | None] = []
        for name, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
            is_text, code = name in TEXT_FIELDS[kind], STRUCT_CODES.get(types[name], "s")
            names.append(f"_{name}_raw" if is_text else name)
            codes += f"{length or 1}{'s' if code == 'B' and length else code}"
            spreads.append(_spread(code, length) if length and not is_text else None)
        read = attrgetter(*names)
        self[kind] = _Format(
            read if len(names) > 1 else lambda message: (read(message),),
            struct.Struct(codes).pack,
            tuple(spreads),
            any(spreads),
        )
        return self[kind]


_FORMATS = _Formats()


def _spread(code: str, length: int) -> _Spread:
    """Return the function that spreads an array; enough bytes are packed as a single value."""
    if code != "B":
        return itemgetter(slice(length))
    pack = struct.Struct(f"<{length}B").pack
    return lambda array: (
        array if array.__class__ is bytes and len(array) >= length else pack(*array[:length]),
    )


def payload_of(message: Any) -> bytes:
    """Return the payload of a message object without trailing zeros.

    Out-of-range values are fitted in ``message`` (``fields.fit``).
    """
    form = _FORMATS[message.__class__]
    try:
        payload = _packed(message, form)
    except PACKING_ERRORS:
        fit(message)
        payload = _packed(message, form)
    return payload.rstrip(b"\0") or b"\0"


def _packed(message: Any, form: _Format) -> bytes:
    values: Sequence[Any] = form.read(message)
    if form.has_arrays:
        parts = zip(values, form.spreads, strict=True)
        values = [item for value, spread in parts for item in ((value,) if spread is None else spread(value))]
    return form.pack(*values)
