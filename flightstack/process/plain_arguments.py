"""Read a command line that one of our programs writes for another, without typer's parser.

Typer 0.29 checks values with Pydantic, whose import and checks take 70 ms of processor time in each program. Programs
write options as ``--name=value`` and flags as ``--name``.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from types import UnionType
from typing import Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

_FLOAT = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?", re.ASCII)
_INT = re.compile(r"-?\d+", re.ASCII)

Options = TypeVar("Options")


def read_plain(group: type[Options], words: Sequence[str]) -> Options | None:
    """Return the options of a dataclass that ``words`` give, or None if typer is to read them.

    Typer reads help, completion (without any words), a value that is separate from its option, and all errors.
    """
    if not words:
        return None
    options = _options_of(group)
    given: dict[str, Any] = {}
    for word in words:
        flag, equals, text = word.partition("=")
        option = options.get(flag)
        if option is None or option.takes_value != bool(equals):
            return None
        try:
            value = option.read(text) if equals else True
        except ValueError:
            return None
        given[option.field] = [*given.get(option.field, ()), value] if option.repeats else value
    return group(**given)


class _Option(NamedTuple):
    field: str
    read: Callable[[str], Any]
    """Return the value of a text; raise ValueError if it is not written plainly, or out of range."""
    takes_value: bool
    repeats: bool


def _options_of(group: type[Any]) -> dict[str, _Option]:
    """Return the options that are read here by their flags; others have a type of their own."""
    found: dict[str, _Option] = {}
    hints = get_type_hints(group, include_extras=True)
    for field in dataclasses.fields(group):
        annotated, info = get_args(hints[field.name])
        kind, repeats = _kind_of(annotated)
        if kind not in _READ:
            continue
        for flag in info.param_decls or (f"--{field.name.replace('_', '-')}",):
            found[flag] = _Option(field.name, _reader(kind, info.min, info.max), kind is not bool, repeats)
    return found


def _kind_of(annotated: Any) -> tuple[Any, bool]:
    """Return the type of one value, and whether the option may be repeated."""
    if get_origin(annotated) is UnionType:
        annotated = get_args(annotated)[0]  # of ``kind | None``
    repeats = get_origin(annotated) is list
    return (get_args(annotated)[0] if repeats else annotated), repeats


def _reader(kind: Any, low: float | None, high: float | None) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        value = _READ[kind](text)
        if (low is not None and value < low) or (high is not None and value > high):
            raise ValueError(text)
        return value

    return read


def _read_float(text: str) -> float:
    if _FLOAT.fullmatch(text) is None:
        raise ValueError(text)
    return float(text)


def _read_int(text: str) -> int:
    if _INT.fullmatch(text) is None:
        raise ValueError(text)
    return int(text)


_READ: dict[Any, Callable[[str], Any]] = {
    str: str, float: _read_float, int: _read_int, Path: Path, bool: bool,
}  # fmt: skip
