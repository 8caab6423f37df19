"""Read frozen dataclasses from TOML tables: types, ranges and choices are declared with each field.

The same declarations give the JSON schema for editors and the reference in the documentation.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cache
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from flightstack.core.errors import ConfigError, plain

T = TypeVar("T")
_DEEP = 1e6
_LARGEST = 1e15


@dataclasses.dataclass(frozen=True)
class Key:
    """Limits of a key: an inclusive range of numbers, the allowed texts, the allowed lengths of a list."""

    help: str
    low: float = -_DEEP
    high: float = _DEEP
    choices: tuple[str, ...] = ()
    lengths: tuple[int, ...] = ()


def key(default: Any, help: str, **limits: Any) -> Any:  # as in Typer and argparse
    """Declare a field with its default, its description and the limits of ``Key``."""
    return dataclasses.field(default=default, metadata={"key": Key(help, **limits)})


def read_record(kind: type[T], file: object, values: Mapping[str, Any], path: str = "") -> T:
    """Return a record of ``kind``; raise ConfigError, which names the key and what is allowed."""
    types = _types(kind)  # type: ignore[arg-type]  # a class is hashable
    fields = {field.name: field for field in dataclasses.fields(kind) if "key" in field.metadata}  # type: ignore[arg-type]
    for name in values:
        if name not in fields:
            raise ConfigError(file, _join(path, name), f"is not a known key; known are {', '.join(fields)}")
    found: dict[str, Any] = {}
    for name, field in fields.items():
        if name in values:
            found[name] = _read(types[name], field.metadata["key"], file, values[name], _join(path, name))
        elif field.default is dataclasses.MISSING:
            raise ConfigError(file, _join(path, name), "is missing")
    return kind(**found)


@cache
def _types(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a record: a campaign reads a scenario for each of its flights."""
    return get_type_hints(kind)


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def _read(kind: Any, limits: Key, file: object, value: Any, path: str) -> Any:
    kind = _without_none(kind)
    if dataclasses.is_dataclass(kind):
        if not isinstance(value, dict):
            raise ConfigError(file, path, "must be a table")
        return read_record(kind, file, value, path)  # type: ignore[arg-type]
    if get_origin(kind) is tuple:
        return _list(get_args(kind)[0], limits, file, value, path)
    if get_origin(kind) is dict:
        if not isinstance(value, dict):
            raise ConfigError(file, path, "must be a table")
        number = get_args(kind)[1]
        return {name: _read(number, limits, file, entry, _join(path, name)) for name, entry in value.items()}
    return _scalar(kind, limits, file, value, path)


def _list(kind: Any, limits: Key, file: object, value: Any, path: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        value = [value] if isinstance(value, str) else value
    if not isinstance(value, list):
        raise ConfigError(file, path, "must be a list")
    if limits.lengths and len(value) not in limits.lengths:
        counts = " or ".join(map(str, limits.lengths))
        raise ConfigError(file, path, f"must be a list of {counts} values, not of {len(value)}")
    return tuple(_read(kind, limits, file, item, f"{path}[{index}]") for index, item in enumerate(value))


def _scalar(kind: Any, limits: Key, file: object, value: Any, path: str) -> Any:
    if kind is bool:
        if not isinstance(value, bool):
            raise ConfigError(file, path, f"{value!r} is neither true nor false")
        return value
    if kind is str:
        if not isinstance(value, str):
            raise ConfigError(file, path, f"{value!r} is not a text")
        if limits.choices and value not in limits.choices:
            raise ConfigError(file, path, f"{value!r} is not one of {', '.join(limits.choices)}")
        return value
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not abs(value) < _LARGEST
        or (kind is int and value != int(value))
    ):
        what = "a whole number" if kind is int else "a number"
        raise ConfigError(file, path, f"{value!r} is not {what}")
    if not limits.low <= value <= limits.high:
        raise ConfigError(
            file, path, f"{value!r} is outside the allowed range {plain(limits.low)} to {plain(limits.high)}"
        )
    return kind(value)


def _without_none(kind: Any) -> Any:
    """Return T of ``T | None``."""
    if isinstance(kind, UnionType):
        return next(part for part in get_args(kind) if part is not type(None))
    return kind


def json_schema(kind: Any, title: str) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a record."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return head | _schema(kind, Key(""))


_SCALARS = {str: "text", bool: "true or false", int: "whole number", float: "number"}
_MOST_CHOICES = 10
"""Longest list of choices in a cell of the reference."""
_NAMES = {str: "string", bool: "boolean", int: "integer", float: "number"}


def _schema(kind: Any, limits: Key) -> dict[str, Any]:
    kind = _without_none(kind)
    if dataclasses.is_dataclass(kind):
        types = get_type_hints(kind)
        keys = [field for field in dataclasses.fields(kind) if "key" in field.metadata]
        entries = {
            field.name: {"description": field.metadata["key"].help}
            | _schema(types[field.name], field.metadata["key"])
            for field in keys
        }
        return {"type": "object", "properties": entries, "additionalProperties": False}
    if get_origin(kind) is tuple:
        return _list_schema(get_args(kind)[0], limits)
    if get_origin(kind) is dict:
        return {"type": "object", "additionalProperties": _schema(get_args(kind)[1], limits)}
    found: dict[str, Any] = {"type": _NAMES[kind]}
    if limits.choices:
        found["enum"] = list(limits.choices)
    if kind in (int, float) and (limits.low, limits.high) != (-_DEEP, _DEEP):
        found |= {"minimum": limits.low, "maximum": limits.high}
    return found


def _list_schema(kind: Any, limits: Key) -> dict[str, Any]:
    found: dict[str, Any] = {"type": "array", "items": _schema(kind, limits)}
    if limits.lengths:
        found |= {"minItems": min(limits.lengths), "maxItems": max(limits.lengths)}
    return {"oneOf": [found, found["items"]]} if kind is str else found


def key_rows(kind: Any) -> Sequence[tuple[str, str, str, str]]:
    """Return name, type, description and default of each key, for the reference."""
    types = get_type_hints(kind)
    return [
        (
            field.name,
            _type_text(types[field.name], field.metadata["key"]),
            field.metadata["key"].help,
            _default_text(field.default),
        )
        for field in dataclasses.fields(kind)
        if "key" in field.metadata
    ]


def _default_text(value: Any) -> str:
    """Return a default as TOML; empty for none."""
    if value in (None, "", ()) or dataclasses.is_dataclass(value):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_default_text, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _type_text(kind: Any, limits: Key) -> str:
    kind = _without_none(kind)
    if dataclasses.is_dataclass(kind):
        return "table"
    if get_origin(kind) is dict:
        return "table of numbers"
    if get_origin(kind) is tuple:
        return _list_text(get_args(kind)[0], limits)
    if limits.choices:
        names = ", ".join(f"`{choice}`" for choice in limits.choices)
        return names if len(limits.choices) <= _MOST_CHOICES else "text, see below"
    return f"{_SCALARS[kind]}{_range_text(kind, limits)}"


def _list_text(kind: Any, limits: Key) -> str:
    if dataclasses.is_dataclass(kind):
        return "tables"
    counts = f"{' or '.join(map(str, limits.lengths))} " if limits.lengths else ""
    return f"list of {counts}{_SCALARS[kind]}s{_range_text(kind, limits)}"


def _range_text(kind: Any, limits: Key) -> str:
    if kind not in (int, float) or (limits.low, limits.high) == (-_DEEP, _DEEP):
        return ""
    return (
        f", at least {plain(limits.low)}"
        if limits.high == _DEEP
        else f", {plain(limits.low)} to {plain(limits.high)}"
    )
