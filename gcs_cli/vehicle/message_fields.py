"""Names, fields and values of MAVLink messages as text: of any message of the dialect. Pure."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from flightstack.mavlink.dialect import ardupilot_dialect, mavlink
from flightstack.mavlink.link import Message

_TEXT = "char"
_SUGGESTIONS = 3


class FieldError(ValueError):
    """A message, field or value that the dialect does not have; the text is one sentence."""


def message_class(name: str) -> Any:
    """Return the class of a message by its name, in any case, or its id; raise FieldError."""
    found = _known(name)
    if found is None:
        ardupilot_dialect()
        found = _known(name)
    if found is None:
        raise FieldError(f"{name}: the dialect has no such message{_did_you_mean(name.upper(), _by_name())}")
    return found


def _known(name: str) -> Any:
    return mavlink.mavlink_map.get(int(name)) if name.isdecimal() else _by_name().get(name.upper())


def _by_name() -> dict[str, Any]:
    return {each.msgname: each for each in mavlink.mavlink_map.values()}


def _did_you_mean(name: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(known), _SUGGESTIONS)
    return f"; did you mean {' or '.join(near)}?" if near else ""


def check_fields(kind: Any, names: Iterable[str]) -> None:
    """Raise FieldError for a name that is no field of a message."""
    for name in names:
        if name not in kind.fieldnames:
            hint = _did_you_mean(name, kind.fieldnames) or f"; its fields are {', '.join(kind.fieldnames)}"
            raise FieldError(f"{name}: {kind.msgname} has no such field{hint}")


def values_of(message: Message) -> dict[str, Any]:
    """Return the fields of a message: numbers, texts and lists of numbers."""
    return {name: getattr(message, name) for name in message.get_fieldnames()}


def shown(message: Message, name: str) -> str:
    """Return one field as text: an enumeration by its entry, a number with seven digits."""
    value = getattr(message, name)
    if isinstance(value, list | tuple | bytes | bytearray):
        return ",".join(_number(each) for each in value)
    if isinstance(value, str):
        return value
    enum = message.fieldenums_by_name.get(name) if hasattr(message, "fieldenums_by_name") else None
    if enum is None or message.fielddisplays_by_name.get(name) == "bitmask":
        return _number(value)
    entry = mavlink.enums.get(enum, {}).get(value)
    return _number(value) if entry is None else str(entry.name)


def _number(value: float) -> str:
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def made_message(name: str, words: Iterable[str], target: tuple[int, int]) -> tuple[Message, dict[str, Any]]:
    """Return a message of ``FIELD=VALUE`` words, and the values given; raise FieldError.

    Fields without a value are zero, those of the target are the vehicle's.
    """
    kind = message_class(name)
    given: dict[str, str] = {}
    for word in words:
        field, equals, text = word.partition("=")
        if not equals:
            raise FieldError(f"{word} is not FIELD=VALUE")
        given[field] = text
    check_fields(kind, given)
    values = {field: _value(kind, field, text) for field, text in given.items()}
    default = {"target_system": target[0], "target_component": target[1]}
    every = [values.get(field, default.get(field, _zero(kind, field))) for field in kind.fieldnames]
    return kind(*every), values


def _kind_of(kind: Any, field: str) -> tuple[str, int]:
    """Return type and array length (0: no array) of a field."""
    # pymavlink lists types in the order of declaration, and lengths in that of the wire
    length = kind.array_lengths[kind.ordered_fieldnames.index(field)]
    return kind.fieldtypes[kind.fieldnames.index(field)], length


def _zero(kind: Any, field: str) -> Any:
    type_name, length = _kind_of(kind, field)
    if type_name == _TEXT:
        return b""
    zero = 0.0 if type_name in ("float", "double") else 0
    return [zero] * length if length else zero


def _value(kind: Any, field: str, text: str) -> Any:
    type_name, length = _kind_of(kind, field)
    if type_name == _TEXT:
        data = text.encode()
        if length and len(data) > length:
            raise FieldError(f"{field}: {text!r} is longer than {length} bytes")
        return data
    parts = text.split(",") if length else [text]
    if len(parts) > max(1, length):
        raise FieldError(f"{field}: {len(parts)} values, of {length}")
    enum = kind.fieldenums_by_name.get(field)
    numbers = [_scalar(field, part.strip(), type_name, enum) for part in parts]
    return numbers + [type(numbers[0])(0)] * (length - len(numbers)) if length else numbers[0]


def _scalar(field: str, text: str, type_name: str, enum: str | None) -> int | float:
    value = _enum_value(text, mavlink.enums.get(enum, {})) if enum is not None else None
    if type_name in ("float", "double"):
        try:
            return float(text) if value is None else float(value)
        except ValueError:
            raise FieldError(f"{field}: {text!r} is not a number") from None
    if value is None:
        try:
            value = int(text, 0)
        except ValueError:
            wanted = f" or a name of {enum}" if enum is not None else ""
            names = [entry.name for entry in mavlink.enums.get(enum, {}).values()] if enum else []
            hint = _did_you_mean(text.upper(), names)
            raise FieldError(f"{field}: {text!r} is not a whole number{wanted}{hint}") from None
    low, high = _limits(type_name)
    if not low <= value <= high:
        raise FieldError(f"{field}: {value} is outside the allowed range {low} to {high}")
    return value


def _limits(type_name: str) -> tuple[int, int]:
    bits = int("".join(filter(str.isdigit, type_name)))
    return (0, 2**bits - 1) if type_name.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def _enum_value(text: str, entries: Mapping[int, Any]) -> int | None:
    """Return the value of entries joined by ``|``, with or without the prefix of the enumeration; None if unknown."""
    # pymavlink adds an entry NAME_ENUM_END, which begins otherwise
    by_name = {entry.name: number for number, entry in entries.items() if "ENUM_END" not in entry.name}
    prefix = _common_words(by_name)
    total = 0
    for part in text.upper().split("|"):
        number = by_name.get(part, by_name.get(prefix + part))
        if number is None:
            return None
        total |= number
    return total


def _common_words(names: Collection[str]) -> str:
    """Return the words that all names begin with, such as ``MAV_CMD_``."""
    if not names:
        return ""
    first, last = min(names).split("_"), max(names).split("_")
    differs = (index for index, (one, other) in enumerate(zip(first, last, strict=False)) if one != other)
    shared = first[: next(differs, min(len(first), len(last)) - 1)]
    return "".join(f"{word}_" for word in shared)
