"""Parameters of a vehicle: the metadata that it sends (component metadata), and parameter files.

Schema: https://github.com/mavlink/mavlink/blob/master/component_metadata/parameter.schema.json
"""

from __future__ import annotations

import json
import lzma
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from flightstack.core.errors import ConfigError
from flightstack.core.float32 import shortest
from flightstack.mavlink.fields import clean
from flightstack.mavlink.param_values import INT32, REAL32, Parameter
from flightstack.params.param_file import read_param_file

METADATA_PATH = "etc/extras/parameters.json.xz"
"""Path of the metadata on PX4 and flightstack, read over MAVLink FTP."""
MAX_METADATA_BYTES = 16_000_000
"""Largest unpacked metadata. PX4's has 1.5 MB."""


class ParamInfo(NamedTuple):
    """Metadata of one parameter; None or empty if the vehicle does not send it."""

    default: float | None = None
    low: float | None = None
    high: float | None = None
    unit: str = ""
    help: str = ""
    choices: tuple[tuple[float, str], ...] = ()
    reboot_required: bool = False
    details: str = ""
    """The long description."""
    group: str = ""

    @property
    def range_text(self) -> str:
        """The range, or the values of an enumeration."""
        if self.choices:
            return " ".join(number_text(value) for value, _ in self.choices)
        if self.low is None and self.high is None:
            return ""
        return f"{_end_text(self.low)} to {_end_text(self.high)}"


UNKNOWN = ParamInfo()


def number_text(value: float) -> str:
    """Format a parameter's value as short as possible; equal texts are equal values on the wire."""
    return f"{shortest(value):.9g}"


def _end_text(value: float | None) -> str:
    return "…" if value is None else number_text(value)


def parse_metadata(packed: bytes) -> dict[str, ParamInfo]:
    """Return the metadata in the packed file, by name; empty if the file is invalid."""
    try:
        text = lzma.LZMADecompressor(memlimit=128 * 2**20).decompress(packed, MAX_METADATA_BYTES)
        entries = json.loads(text)["parameters"]
    except (lzma.LZMAError, EOFError, ValueError, KeyError, TypeError, RecursionError):
        return {}
    if not isinstance(entries, list):
        return {}
    return {
        _text(entry["name"]): _info(entry)
        for entry in entries
        if isinstance(entry, dict) and isinstance(entry.get("name"), str)
    }


def _info(entry: dict[str, Any]) -> ParamInfo:
    values = entry.get("values")
    choices = []
    for choice in values if isinstance(values, list) else ():
        value = _number(choice.get("value")) if isinstance(choice, dict) else None
        if value is not None:
            choices.append((value, _text(choice.get("description"))))
    return ParamInfo(
        _number(entry.get("default")),
        _number(entry.get("min")),
        _number(entry.get("max")),
        _text(entry.get("units")),
        _text(entry.get("shortDesc")),
        tuple(choices),
        entry.get("rebootRequired") is True,
        _text(entry.get("longDesc")),
        _text(entry.get("group")),
    )


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _text(value: Any) -> str:
    """Return ``value`` without control characters, or an empty text if it is not a text."""
    return clean(value) if isinstance(value, str) else ""


def render_parameters(parameters: Iterable[Parameter], system_id: int, component_id: int) -> str:
    """Return a parameter file in the format of QGroundControl."""
    lines = [
        f"# Onboard parameters for Vehicle {system_id}",
        "#",
        "# Vehicle-Id Component-Id Name Value Type",
    ]
    for parameter in parameters:
        kind = parameter.kind or (INT32 if parameter.is_integer else REAL32)
        value = number_text(parameter.value)
        lines.append(f"{system_id}\t{component_id}\t{parameter.name}\t{value}\t{kind}")
    return "\n".join(lines) + "\n"


def load_parameters(path: Path) -> dict[str, float]:
    """Read a parameter file like the flight stack does; raise ConfigError that names file and line."""
    if not path.exists():
        raise ConfigError(path, "", "no such file")
    return {line.name: float(line.value) for line in read_param_file(path)}
