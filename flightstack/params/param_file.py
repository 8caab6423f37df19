"""Parameter files in QGroundControl's ``.params`` format: five tab-separated columns.

Reading is strict: a malformed line, a rejected value or a truncated file raises an error with file and line. Parameters
that the current vehicle and controller do not have are kept. Writing is atomic, also among vehicles that share a file.
"""

from __future__ import annotations

import contextlib
import fcntl
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import ConfigError
from flightstack.params.spec import LARGEST_NAME, ParamSpec
from flightstack.params.store import ParamStore, set_all

INT32, REAL32 = 6, 9
"""MAV_PARAM_TYPE of the parameters."""
_INTEGER_TYPES, _FLOAT_TYPES = range(1, 9), (9, 10)
_AUTOPILOT = 1  # component id
_OURS, _END = "# Stack: flightstack", "# End"
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_LARGEST_FILE = 4_000_000


class ParamLine(NamedTuple):
    """One parameter of a file."""

    name: str
    value: float
    is_integer: bool
    line: int = 0


def format_params(lines: Iterable[ParamLine], system_id: int = 1) -> str:
    """Return the text of a parameter file, sorted by name."""
    rows = [
        f"{system_id}\t{_AUTOPILOT}\t{item.name}\t{item.value!r}\t{INT32 if item.is_integer else REAL32}"
        for item in sorted(lines)
    ]
    head = [
        f"# Onboard parameters for Vehicle {system_id}",
        "#",
        _OURS,
        "# Only what differs from the defaults",
        "#",
        "# Vehicle-Id Component-Id Name Value Type",
    ]
    return "\n".join([*head, *rows, _END]) + "\n"


def is_parameter_name(name: str) -> bool:
    """Return True for a valid parameter name."""
    return re.fullmatch(rf"[A-Za-z0-9_]{{1,{LARGEST_NAME}}}", name) is not None


def parse_params(text: str, file: object) -> list[ParamLine]:
    """Parse a parameter file; raise ConfigError with ``file`` and line."""
    lines: dict[str, ParamLine] = {}
    rows = text.split("\n")
    for number, row in enumerate(rows, 1):
        if not row.strip() or row.startswith("#"):
            continue
        item = _parse_row(row.rstrip("\r"), file, number)
        if item.name in lines:
            problem = f"{item.name} is already set in line {lines[item.name].line}"
            raise ConfigError(file, f"line {number}", problem)
        lines[item.name] = item
    comments = {row.strip() for row in rows if row.startswith("#")}
    if _OURS in comments and _END not in comments:
        raise ConfigError(file, "", f"is truncated: its last line must be {_END!r}")
    return list(lines.values())


def _parse_row(row: str, file: object, number: int) -> ParamLine:
    def error(problem: str) -> ConfigError:
        return ConfigError(file, f"line {number}", problem)

    if not row.isascii():
        raise error("contains characters that are not ASCII")
    columns = row.split("\t")
    if len(columns) != 5:
        raise error(
            f"has {len(columns)} columns between tabs, expected 5: vehicle, component, name, value, type"
        )
    vehicle, component, name, value, kind = columns
    if not (vehicle.isdecimal() and int(vehicle) <= 255 and component.isdecimal()):
        raise error(f"vehicle {vehicle[:20]!r} and component {component[:20]!r} must be numbers")
    if int(component) != _AUTOPILOT:
        raise error(f"{name} belongs to component {component}, not to the autopilot, {_AUTOPILOT}")
    if not is_parameter_name(name):
        raise error(f"{name[:40]!r} is not a parameter name")
    if not kind.isdecimal() or int(kind) not in (*_INTEGER_TYPES, *_FLOAT_TYPES):
        raise error(f"{name}: {kind[:20]!r} is not a numeric MAV_PARAM_TYPE")
    number_read = float(value) if _NUMBER.fullmatch(value) else math.nan
    if not math.isfinite(number_read):
        raise error(f"{name}: {value[:40]!r} is not a number")
    is_integer = int(kind) in _INTEGER_TYPES
    if is_integer and number_read != int(number_read):
        raise error(f"{name}: {value[:40]!r} is not a whole number, as type {kind} demands")
    return ParamLine(name, int(number_read) if is_integer else number_read, is_integer, number)


def read_param_file(path: Path) -> list[ParamLine]:
    """Read a parameter file, none if there is no such file; raise ConfigError."""
    try:
        if not path.exists():
            return []
        if path.stat().st_size > _LARGEST_FILE:
            raise ConfigError(path, "", "is too large for a parameter file")
        return parse_params(path.read_bytes().decode("utf-8"), path)
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(path, "", "is not a text file") from error


def begin_param_file(path: Path, system_id: int) -> None:
    """Write a parameter file without parameters; raise ConfigError.

    A path that is not writable is thus reported at startup and not after a flight.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text_atomically(path, format_params([], system_id))
    except OSError as error:
        raise ConfigError(path, "", f"cannot be written: {error.strerror}") from error


class LoadedParams(NamedTuple):
    """Contents of a parameter file."""

    lines: Mapping[str, ParamLine]
    unknown: tuple[str, ...]
    """Names that the vehicle does not have; they stay in the file."""

    def warning(self, path: Path) -> str | None:
        """Return a warning about unknown names, or None."""
        if not self.unknown:
            return None
        shown = ", ".join(self.unknown[:5]) + (" …" if len(self.unknown) > 5 else "")
        return f"{path}: not used by this vehicle and controller, but kept: {shown}"


NOTHING_LOADED = LoadedParams({}, ())


def load_into(store: ParamStore, path: Path) -> LoadedParams:
    """Set the parameters of a file; raise ConfigError for a known parameter with a bad value."""
    lines = {item.name: item for item in read_param_file(path)}
    known = [item for item in lines.values() if item.name in store.specs]
    refused = set_all(
        known,
        lambda item: _kind_problem(store.specs[item.name], item) or store.set(item.name, item.value),
    )
    if refused is not None:
        item, problem = refused
        raise ConfigError(path, f"line {item.line}", f"{item.name}: {problem}")
    return LoadedParams(lines, tuple(name for name in lines if name not in store.specs))


def _kind_problem(spec: ParamSpec, item: ParamLine) -> str | None:
    if spec.is_integer == item.is_integer:
        return None
    return f"is {f'an integer, type {INT32}' if spec.is_integer else f'a real number, type {REAL32}'}, in the vehicle"


class ParamFile:
    """The parameter file that a vehicle saves to.

    Several vehicles may share it: each writes only the parameters that it has changed since it last read or wrote them.
    """

    def __init__(self, path: Path, system_id: int, loaded: LoadedParams = NOTHING_LOADED) -> None:
        self._path = path
        self._system_id = system_id
        self._lines = dict(loaded.lines)
        self._saved = {name: item.value for name, item in self._lines.items()}

    def save(self, store: ParamStore) -> None:
        """Write changed parameters atomically, those with their default by removing the line.

        Parameters that are overridden for this run, unknown ones, and what another vehicle wrote keep their lines.
        Raise OSError, and ConfigError for a file that is damaged by now.
        """
        self._path.parent.mkdir(parents=True, exist_ok=True)
        saved = self._saved.copy()
        with _locked(self._path):
            lines = self._lines.copy()
            if self._path.exists():  # if not, it was removed during the run
                lines = {item.name: item for item in read_param_file(self._path)}
            for name, spec in store.specs.items():
                value = store.value(name)
                if store.is_overridden(name) or value == saved.get(name, spec.default):
                    continue
                saved[name] = value
                lines[name] = ParamLine(name, value, spec.is_integer)
                if value == spec.default:
                    del lines[name]
            write_text_atomically(self._path, format_params(lines.values(), self._system_id))
        self._lines, self._saved = lines, saved


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Lock the file against other processes that replace it, if it exists and the file system has locks."""
    file: int | None = None
    with contextlib.suppress(OSError):
        while file is None:
            file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            fcntl.flock(file, fcntl.LOCK_EX)
            if not os.path.samestat(os.fstat(file), path.stat()):  # it was replaced meanwhile
                os.close(file)
                file = None
    try:
        yield
    finally:
        if file is not None:
            os.close(file)
