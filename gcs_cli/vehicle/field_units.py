"""Numbers, units and enumerations of message fields, from MAVLink's definitions, for people. Pure."""

from __future__ import annotations

import math
from typing import Any

from flightstack.core.contract import FloatArray
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message

UNKNOWN = "—"


def number(value: float | None, digits: int = 2, unit: str = "") -> str:
    """Format a number; a dash if unknown."""
    if value is None:
        return UNKNOWN
    if abs(value) >= 1e7:
        return f"{value:.1e}{unit}"
    return f"{round(value, digits) + 0.0:.{digits}f}{unit}"  # + 0.0: no -0.00


_DEGREES = math.degrees(1.0)
_SHOWN_UNITS: dict[str, tuple[float, str]] = {
    "rad": (_DEGREES, "deg"), "rad/s": (_DEGREES, "deg/s"), "mrad/s": (1e-3 * _DEGREES, "deg/s"),
    "degE7": (1e-7, "deg"), "degE5": (1e-5, "deg"), "cdeg": (1e-2, "deg"), "ddeg/s": (0.1, "deg/s"),
    "mm": (1e-3, "m"), "cm": (1e-2, "m"), "dm": (0.1, "m"), "dam": (10.0, "m"),
    "mm/s": (1e-3, "m/s"), "cm/s": (1e-2, "m/s"), "dm/s": (0.1, "m/s"), "m/s*5": (0.2, "m/s"),
    "us": (1e-6, "s"), "ms": (1e-3, "s"), "ns": (1e-9, "s"), "cs": (1e-2, "s"),
    "mV": (1e-3, "V"), "cA": (1e-2, "A"), "mA": (1e-3, "A"), "hJ": (100.0, "J"),
    "cdegC": (1e-2, "degC"), "c%": (1e-2, "%"), "d%": (0.1, "%"),
    "mG": (9.80665e-3, "m/s/s"), "mgauss": (1e-3, "gauss"), "deg/2": (2.0, "deg"),
}  # fmt: skip
"""Factor and unit in which a scaled unit is shown."""
_UNKNOWN = {"int16_t": 2**15 - 1, "uint16_t": 2**16 - 1, "int32_t": 2**31 - 1, "uint32_t": 2**32 - 1}
"""Integers that MAVLink's messages use for an unknown quantity, by type."""


def base_name(field: str) -> str:
    """Return the name of the field of an array's element: ``q`` of ``q[2]``."""
    return field.partition("[")[0]


def field_value(message: Message, field: str) -> Any:
    """Return the value of a field or of an array's element."""
    name, _, index = field.partition("[")
    value = getattr(message, name)
    return value[int(index[:-1])] if index else value


def field_unit(message: Message, field: str) -> str:
    """Return MAVLink's unit of a field, or an empty text."""
    unit: str = message.fieldunits_by_name.get(base_name(field), "")
    return unit


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor from ``unit`` to the unit in which it is shown, and that unit."""
    return _SHOWN_UNITS.get(unit, (1.0, unit))


def unknown_value(message: Message, field: str) -> int | None:
    """Return the integer that stands for an unknown value of a field with a unit, or None."""
    name = base_name(field)
    if name not in message.fieldunits_by_name or name not in message.fieldnames:
        return None
    return _UNKNOWN.get(message.fieldtypes[message.fieldnames.index(name)])


def shown_values(message: Message, field: str, values: FloatArray) -> FloatArray:
    """Return ``values`` in the shown unit; unknown ones are NaN."""
    factor, _ = shown_unit(field_unit(message, field))
    unknown = unknown_value(message, field)
    shown = values * factor
    if unknown is not None:
        shown[values == unknown] = math.nan
    return shown


def enum_text(message: Message, field: str, value: Any) -> str:
    """Return the names of an enumeration's value or of the bits of a bitmask, without their common prefix."""
    enum_name = message.fieldenums_by_name.get(base_name(field))
    entries = mavlink.enums.get(enum_name, {}) if isinstance(value, int) else {}
    if message.fielddisplays_by_name.get(base_name(field)) == "bitmask":
        bits = [
            number for number in entries if number and value & number == number and not number & (number - 1)
        ]
        return " | ".join(_short(entries[number].name, enum_name) for number in sorted(bits))
    return _short(entries[value].name, enum_name) if value in entries else ""


def _short(name: str, enum_name: str) -> str:
    """Drop the words that a value's name shares with its enumeration's: ``ACTIVE`` of ``MAV_STATE_ACTIVE``."""
    words, prefix = name.split("_"), enum_name.split("_")
    while prefix and len(words) > 1 and words[0] == prefix[0]:
        words, prefix = words[1:], prefix[1:]
    return "_".join(words)
