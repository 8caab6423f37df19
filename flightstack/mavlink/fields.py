"""Values of message and log fields: numbers fitted into their ranges, and text made safe to print. Pure.

An out-of-range value never prevents sending: ``Link.encode`` packs each message as it is and fits it only on failure.

* A time (unsigned with 32 bits or more and a unit of time; the signed nanoseconds of TIMESYNC) and a counter
  (``COUNTERS``) wrap: ``time_boot_ms`` after 49.7 days, as specified.
* Any other integer saturates; a value that is not finite becomes 0.
* A floating-point number beyond single precision becomes infinite.
"""

from __future__ import annotations

import math
import struct
from functools import cache
from typing import Any, NamedTuple

from flightstack.mavlink.dialect import mavlink

_SINGLE = struct.Struct("<f")
_SIZES = {"b": 8, "h": 16, "i": 32, "q": 64}
RANGES: dict[str, tuple[int, int]] = {"?": (0, 1)}
"""Minimum and maximum of each integer code of ``struct``."""
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
"""Counters in messages and topics, which wrap. Other unsigned fields saturate, also without a unit (``eph``, ``rssi``).
"""


def whole(value: float, low: int, high: int) -> int:
    """Round to an integer in [low, high], saturated; 0 for a value that is not finite."""
    try:
        number = round(value)
    except (ValueError, OverflowError):
        return 0
    return number if low <= number <= high else low if number < low else high


def int16(value: float) -> int:
    """Round to a signed 16-bit integer, saturated."""
    return whole(value, -32768, 32767)


def int32(value: float) -> int:
    """Round to a signed 32-bit integer, saturated."""
    return whole(value, -(2**31), 2**31 - 1)


def fitted(value: float, code: str, wraps: bool) -> float:
    """Return ``value`` fitted into a field of the ``struct`` code ``code``.

    Integers wrap or saturate; a floating-point number beyond the field's range becomes infinite.
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
"""Raised by ``pack`` for a value out of range."""

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
    """Return the numeric fields of a message class."""
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
    """Fit all numbers of ``message`` into their fields, in place."""
    for name, code, wraps in _number_fields(message.__class__):
        value = getattr(message, name)
        is_number = isinstance(value, (int, float))
        fits = fitted(value, code, wraps) if is_number else [fitted(one, code, wraps) for one in value]
        setattr(message, name, fits)


REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


def clean(text: str) -> str:
    """Return ``text`` on one line without characters that control a terminal or hide others.

    Whitespace becomes a space. Other non-printable characters (C0 and C1 controls, escape, text direction marks, lone
    surrogates) become U+FFFD.
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
