"""TOML files: found by built-in name or path, read with range checks; unknown keys are errors."""

from __future__ import annotations

import difflib
import os
import re
import tomllib
from collections.abc import Iterable
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

from flightstack.core.errors import ConfigError, did_you_mean, plain

_LIKE = 0.85
"""Similarity of a misspelt key; that of the coefficients of thrust and torque is 0.83."""
_SHOWN = 8


class Table:
    """A table of a TOML file that tracks which keys were read."""

    def __init__(self, file: object, values: dict[str, Any], path: str = "") -> None:
        self.file = file
        self._values = values
        self._path = path
        self._read: set[str] = set()

    def _name(self, key: str) -> str:
        return f"{self._path}.{key}" if self._path else key

    def error(self, key: str, problem: str) -> ConfigError:
        """Return the error to raise for ``key``."""
        return ConfigError(self.file, self._name(key), problem)

    def _get(self, key: str, default: Any) -> Any:
        self._read.add(key)
        if key not in self._values:
            if default is None:
                raise self.missing(key)
            return default
        return self._values[key]

    def missing(self, *keys: str) -> ConfigError:
        """Return the error for a table without any of ``keys``; it names a misspelt key, or those that are there."""
        others = sorted(set(self._values) - self._read)
        near = next((other for key in keys for other in _like(key, others)), None)
        either = "".join(f": give it or {key}" for key in keys[1:])
        if near is not None:
            hint = f"; did you misspell it as {near}?"
        else:
            hint = f"; there are {_listed(self._values)}" if self._values else ""
        return self.error(keys[0], f"is missing{either}{hint}")

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """Return a finite number in [low, high]."""
        return self._in_range(key, self._get(key, default), low, high)

    def _in_range(self, key: str, value: Any, low: float, high: float) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"{value!r} is not a number")
        if not low <= value <= high:  # also rejects NaN
            shown = plain(value) if isinstance(value, float) or abs(value) < 10**15 else "a number that large"
            raise self.error(key, f"{shown} is outside the allowed range {plain(low)} to {plain(high)}")
        return float(value)

    def numbers(
        self, key: str, count: int, low: float, high: float, default: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        """Return a list of ``count`` finite numbers in [low, high]."""
        value = self._get(key, default)
        if not isinstance(value, list | tuple) or len(value) != count:
            raise self.error(key, f"must be a list of {count} numbers")
        return tuple(self._in_range(key, item, low, high) for item in value)

    def number_list(
        self, key: str, fewest: int, most: int, low: float, high: float, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return a list of ``fewest`` to ``most`` finite numbers in [low, high]."""
        value = self._get(key, default)
        if not isinstance(value, list | tuple) or not fewest <= len(value) <= most:
            raise self.error(key, f"must be a list of {fewest} to {most} numbers")
        return tuple(self._in_range(key, item, low, high) for item in value)

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string."""
        value = self._get(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"{value!r} is not a string")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """Return true or false."""
        value = self._get(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"{value!r} is neither true nor false")
        return value

    def is_flag(self, key: str) -> bool:
        """Return True if ``key`` is true or false."""
        return isinstance(self._values.get(key), bool)

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """Return one of ``choices``."""
        value = self.text(key)
        if value not in choices:
            raise self.error(key, f"{value!r} is not one of {', '.join(choices)}")
        return value

    def table(self, key: str) -> Table:
        """Return the table under ``key``."""
        value = self._get(key, None)
        if not isinstance(value, dict):
            raise self.error(key, "must be a table")
        return Table(self.file, value, self._name(key))

    def optional_table(self, key: str) -> Table:
        """Return the table under ``key``, or an empty one."""
        return self.table(key) if key in self._values else Table(self.file, {}, self._name(key))

    def tables(self, key: str) -> list[Table]:
        """Return the array of tables under ``key``."""
        value = self._get(key, None)
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            raise self.error(key, "must be an array of tables")
        return [Table(self.file, item, f"{self._name(key)}[{index}]") for index, item in enumerate(value)]

    def values(self) -> dict[str, Any]:
        """Return the values, unchecked."""
        return self._values

    def has(self, key: str) -> bool:
        """Return True if ``key`` is present."""
        return key in self._values

    def expect(self, *keys: str, prefix: tuple[str, ...]) -> None:
        """Raise ConfigError for a key that is not in ``keys`` and does not begin with one of ``prefix``."""
        for key in self._values:
            if key not in keys and not key.startswith(prefix):
                raise self._unknown(key, keys)

    def finish(self) -> None:
        """Raise ConfigError for a key that was not read, such as a misspelt one."""
        unknown = sorted(set(self._values) - self._read)
        if unknown:
            raise self._unknown(unknown[0], sorted(self._read))

    def _unknown(self, key: str, known: Iterable[str]) -> ConfigError:
        near = _like(key, known)
        hint = f"did you mean {near[0]}?" if near else f"known are {_listed(known)}"
        return self.error(key, f"is not a known key; {hint}" if known else "is not a known key")


def _like(key: str, others: Iterable[str]) -> list[str]:
    return difflib.get_close_matches(key, list(others), 1, _LIKE)


def _listed(keys: Iterable[str]) -> str:
    names = list(keys)
    return ", ".join(names if len(names) <= _SHOWN else [*names[:_SHOWN], "…"])


def read_toml(path: Path) -> Table:
    """Read a TOML file; raise ConfigError when it is missing or malformed."""
    return parse_toml(path, read_text(path))


def read_text(path: Path) -> str:
    """Return the text of a TOML file; raise ConfigError when it is missing or not UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(path, "", f"is not valid TOML: {error}") from error


def parse_toml(path: Path, text: str) -> Table:
    """Parse the text of the TOML file ``path``; raise ConfigError when it is malformed."""
    try:
        return Table(path, deepcopy(_parsed(text)))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(path, "", f"is not valid TOML: {error}") from error
    except (RecursionError, ValueError) as error:  # deep nesting, numbers of thousands of digits
        problem = "is not usable TOML: its nesting is too deep or a number too long"
        raise ConfigError(path, "", problem) from error


@lru_cache(maxsize=16)
def _parsed(text: str) -> dict[str, Any]:
    """Return the values of a text: each flight of a campaign reads the same files."""
    return tomllib.loads(text)


_STEP = re.compile(r"\.?([^.\[\]]+)|\[(\d+)\]")


def set_value(values: dict[str, Any], path: str, value: Any) -> None:
    """Set the value at ``path``, such as ``body.mass_kg`` or ``event[0].at_s``, in the tables and lists of a file.

    A missing key of a table is added. Raise KeyError, whose text is the problem, if a table or an item of a list is
    missing.

    >>> values = {"event": [{"at_s": 3.0}]}
    >>> set_value(values, "event[0].at_s", 4.0)
    >>> values
    {'event': [{'at_s': 4.0}]}
    """
    steps = [int(step[2]) if step[2] else step[1] for step in _STEP.finditer(path)]
    if not steps or _STEP.sub("", path):
        raise KeyError("is no path of a value, such as wind.gust_m_s or event[0].at_s")
    here: Any = values
    for step in steps[:-1]:
        here = _entry(here, step)
    last = steps[-1]
    if isinstance(last, int) or not isinstance(here, dict):
        _entry(here, last)
    here[last] = value


def _entry(container: Any, step: str | int) -> Any:
    if isinstance(step, int):
        if isinstance(container, list) and step < len(container):
            return container[step]
        raise KeyError(f"the file has no item [{step}] there")
    if isinstance(container, dict) and step in container:
        return container[step]
    raise KeyError(f"the file has no table {step} there")


def find_file(name_or_path: str, folder: Path, kind: str) -> Path:
    """Return the TOML file for a name or a path; raise ConfigError for an unknown name.

    A path has a separator or a suffix. A plain name always means a built-in file in ``folder``. ``kind`` describes the
    file in messages, for example "a built-in vehicle".
    """
    if not _is_name(name_or_path):
        return Path(name_or_path)
    known = built_in_names(folder)
    if name_or_path in known:
        return folder / f"{name_or_path}.toml"
    names = ", ".join(known)
    if Path(name_or_path).is_file():
        problem = f"is not {kind} ({names}); to use the file give ./{name_or_path}"
    else:
        problem = f"is neither a file nor {kind} ({names}){did_you_mean(name_or_path, known)}"
    raise ConfigError(name_or_path, "", problem)


def built_in_names(folder: Path) -> list[str]:
    """Return the names of the built-in files in ``folder``."""
    names = os.listdir(folder) if folder.is_dir() else []
    files = (name for name in names if name.endswith(".toml"))
    return sorted(name.removesuffix(".toml") for name in files)


def hidden_file(name_or_path: str, kind: str) -> str | None:
    """Return a warning if a built-in name hides a file in the working directory, or None."""
    if not _is_name(name_or_path) or not Path(name_or_path).is_file():
        return None
    return f"{name_or_path} is taken as {kind}; to use the file give ./{name_or_path}"


def _is_name(name_or_path: str) -> bool:
    return os.sep not in name_or_path and not Path(name_or_path).suffix
