"""Numbers as the fixed-size fields of messages and logs hold them. Pure."""

from __future__ import annotations

import math
import struct
from functools import cache
from typing import Any, NamedTuple

from flightstack.mavlink.dialect import mavlink

_SINGLE = struct.Struct("<f")
_SIZES = {"b": 8, "h": 16, "i": 32, "q": 64}
RANGES: dict[str, tuple[int, int]] = {"?": (0, 1)}
"""Smallest and largest value of each integer code of ``struct``."""
for _code, _bits in _SIZES.items():
    RANGES[_code] = -(1 << _bits - 1), (1 << _bits - 1) - 1
    RANGES[_code.upper()] = 0, (1 << _bits) - 1

COUNTERS = frozenset({
    "errors_comm", "errors_count1", "errors_count2", "errors_count3", "errors_count4", "rxerrors",
    "breach_count", "clipping_0", "clipping_1", "clipping_2", "reset_counter", "sequence",
    "mission_update_counter", "ticks", "overruns", "missed", "step", "steps", "repeats", "out_of_order",
    "frames", "bad_frames", "skipped_octets", "uart_overruns", "dropped_frames", "uart_errors",
    "loop_overruns", "safe_states",
})  # fmt: skip
"""Fields of messages and topics that count, and wrap.

Other unsigned fields saturate: a quantity need not have a unit, as ``eph`` and ``rssi``.
"""


def whole(value: float, low: int, high: int) -> int:
    """Round a quantity into an integer field, saturated; a value that is not finite becomes 0."""
    if not isinstance(value, int) and not math.isfinite(value):
        return 0
    return max(low, min(high, round(value)))


def int16(value: float) -> int:
    """Round a quantity into a signed 16-bit field."""
    return whole(value, -32768, 32767)


def int32(value: float) -> int:
    """Round a quantity into a signed 32-bit field."""
    return whole(value, -(2**31), 2**31 - 1)


def fitted(value: float, code: str, wraps: bool) -> float:
    """Return ``value`` as a field of the ``struct`` code ``code`` holds it.

    An integer that ``wraps`` is taken modulo the field's range, as clocks and counters are; any other saturates.
    A floating-point number too large for its field becomes infinite.
    """
    if code in RANGES:
        low, high = RANGES[code]
        if not wraps:
            return whole(value, low, high)
        finite = isinstance(value, int) or math.isfinite(value)
        return (round(value) - low) % (high - low + 1) + low if finite else 0
    try:
        number = float(value)
        if code == "f":
            _SINGLE.pack(number)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    return number


PACKING_ERRORS = (struct.error, OverflowError)
"""What ``pack`` raises for a value that its field cannot hold."""

STRUCT_CODES = {
    "int8_t": "b", "uint8_t": "B", "int16_t": "h", "uint16_t": "H", "int32_t": "i", "uint32_t": "I",
    "int64_t": "q", "uint64_t": "Q", "float": "f", "double": "d", "bool": "?",
}  # fmt: skip
"""Number types of MAVLink and ULog as codes of ``struct``, which are NumPy's after "<"."""
_TIMES = frozenset({"ns", "us", "ms", "cs", "ds", "s"})
_CLOCK_CODES = frozenset("IQq")


class _Field(NamedTuple):
    name: str
    code: str
    wraps: bool


@cache
def _number_fields(kind: Any) -> tuple[_Field, ...]:
    """Return the fields of a message class that hold numbers."""
    units = kind.fieldunits_by_name
    fields = []
    for name, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        code = STRUCT_CODES.get(field_type)
        if code is not None:
            unit = units.get(name, "")
            is_clock = unit in _TIMES and code in _CLOCK_CODES
            fields.append(_Field(name, code, is_clock or name in COUNTERS))
    return tuple(fields)


def fit(message: Any) -> None:
    """Bring every number of ``message`` into the range of its field, in place."""
    for name, code, wraps in _number_fields(message.__class__):
        value = getattr(message, name)
        is_number = isinstance(value, (int, float))
        fits = fitted(value, code, wraps) if is_number else [fitted(one, code, wraps) for one in value]
        setattr(message, name, fits)


REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


def clean(text: str) -> str:
    """Return ``text`` on one line, with nothing in it that a terminal obeys or that hides other characters.

    White space of any kind is a space. Other characters that are not printable (control characters of C0 and C1,
    escape, marks of text direction, lone surrogates) are replaced by U+FFFD.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else REPLACEMENT for c in text)


class _TextFields(dict[type[mavlink.MAVLink_message], tuple[str, ...]]):
    """Computes an entry at its first use."""

    def __missing__(self, kind: type[mavlink.MAVLink_message]) -> tuple[str, ...]:
        fields = zip(kind.fieldnames, kind.fieldtypes, strict=True)
        names = self[kind] = tuple(str(name) for name, type_name in fields if type_name == "char")
        return names


TEXT_FIELDS = _TextFields()
"""Names of the text fields of each class of messages."""
