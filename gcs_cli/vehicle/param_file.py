"""Parameter files of ``gcs``: read as the flight stack reads them, written with all parameters of any vehicle."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from flightstack.core.errors import ConfigError
from flightstack.mavlink.param_values import INT32, REAL32, Parameter
from flightstack.params.param_file import read_param_file
from gcs_cli.vehicle.param_info import number_text


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
    """Read a file by the rule of the flight stack; raise ConfigError that names file and line."""
    if not path.exists():
        raise ConfigError(path, "", "there is no such file")
    return {line.name: float(line.value) for line in read_param_file(path)}
