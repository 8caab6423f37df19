"""Bring the values of a message into the ranges of its fields. Pure.

No value that a program computes may keep a message from being sent: ``Link.encode`` packs each message as it is,
which costs nothing, and fits it when that fails. A value out of range becomes what suits its field:

* a time (unsigned, 32 bits or more, in a unit of time; the signed nanoseconds of TIMESYNC) and a counter (a field of
  ``field_numbers.COUNTERS``) wrap: ``time_boot_ms`` after 49.7 days, as the specification has it;
* a quantity (any other integer) saturates; what is not finite becomes 0;
* a floating-point number that single precision cannot hold becomes infinite.
"""

from __future__ import annotations

import struct
from functools import cache
from typing import Any, NamedTuple

from flightstack.mavlink.field_numbers import COUNTERS, fitted

PACKING_ERRORS = (struct.error, OverflowError)
"""What ``pack`` raises for a value that its field cannot hold."""

_CODES = {
    "int8_t": "b", "uint8_t": "B", "int16_t": "h", "uint16_t": "H", "int32_t": "i", "uint32_t": "I",
    "int64_t": "q", "uint64_t": "Q", "float": "f", "double": "d",
}  # fmt: skip
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
        code = _CODES.get(field_type)
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
