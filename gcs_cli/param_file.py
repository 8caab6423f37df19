"""Parameter files as QGroundControl writes them: one tab-separated line for each parameter. Pure but for ``load``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from flightstack.mavlink.services.param_values import INT32, REAL32, Parameter
from flightstack.params.errors import ConfigError
from gcs_cli.param_info import number_text

_COLUMNS = 5  # system, component, name, value, MAV_PARAM_TYPE
_LONGEST_NAME = 16


def render_parameters(parameters: Iterable[Parameter], system_id: int, component_id: int) -> str:
    """Return the file."""
    lines = [
        f"# Onboard parameters for Vehicle {system_id}",
        "#",
        "# Vehicle-Id Component-Id Name Value Type",
    ]
    for told in parameters:
        kind = INT32 if told.is_integer else REAL32
        lines.append(f"{system_id}\t{component_id}\t{told.name}\t{number_text(told.value)}\t{kind}")
    return "\n".join(lines) + "\n"


def load_parameters(path: Path) -> dict[str, float]:
    """Read a file; raise ConfigError that names it and the line."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ConfigError(str(path), "file", "is no text") from None
    except OSError as error:
        raise ConfigError(str(path), "file", error.strerror or str(error)) from None
    values: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        name, value = _read_line(line, str(path), f"line {number}")
        if name in values:
            raise ConfigError(str(path), f"line {number}", f"{name} stands twice in it")
        values[name] = value
    return values


def _read_line(line: str, path: str, where: str) -> tuple[str, float]:
    columns = line.split("\t") if "\t" in line else line.split()
    if len(columns) != _COLUMNS:
        raise ConfigError(path, where, "expected system, component, name, value and type")
    name = columns[2].strip()
    if not name.isascii() or not name.isprintable() or not 0 < len(name) <= _LONGEST_NAME:
        raise ConfigError(path, where, "has no name of 1 to 16 characters")
    try:
        value = float(columns[3])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError(path, where, f"{columns[3].strip()} is not a number")
    return name, value
