"""The parameters of a vehicle as the screen lists them: search, rows, details, and the check of a typed value. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rich.text import Text

from flightstack.mavlink.param_values import LARGEST_INTEGER, Parameter
from gcs_cli.tui.palette import Palette
from gcs_cli.tui.widgets.fuzzy import search
from gcs_cli.tui.widgets.row_list import Cell, Column, row_text, stretched
from gcs_cli.vehicle.param_info import UNKNOWN, ParamInfo, number_text
from gcs_cli.vehicle.param_table import description, is_changed

_NAME = 16
_HELP_FROM = 100
"""Width from which a row shows the help text."""


class ParamList(NamedTuple):
    """Parameters by name, sorted; their metadata; and the values of a file to compare with."""

    parameters: Mapping[str, Parameter] = {}  # never changed
    infos: Mapping[str, ParamInfo] = {}
    file: Mapping[str, float] | None = None
    file_name: str = ""

    @property
    def references(self) -> Mapping[str, ParamInfo]:
        """The metadata, with the values of the file instead of the defaults if there is a file."""
        if self.file is None:
            return self.infos
        found = self.infos
        return {name: found.get(name, UNKNOWN)._replace(default=value) for name, value in self.file.items()}

    def with_parameter(self, parameter: Parameter) -> ParamList:
        """Return the list with a new value."""
        return self._replace(parameters={**self.parameters, parameter.name: parameter})

    def changed(self) -> list[str]:
        """Return the names of the parameters that differ from their default, or from the file."""
        references = self.references
        return [name for name, parameter in self.parameters.items() if is_changed(parameter, references)]

    def names(self, query: str, changed_only: bool) -> list[str]:
        """Return the names that match ``query``, best first; after them those whose help has all its words."""
        names = self.changed() if changed_only else list(self.parameters)
        words = query.lower().split()
        if not words:
            return names
        found = [match.name for match in search(query, names)]
        seen = set(found)
        helps = ((name, self.infos.get(name, UNKNOWN).help.lower()) for name in names if name not in seen)
        return found + [name for name, text in helps if all(word in text for word in words)]


def param_columns(width: int, compared: str) -> list[Column]:
    """Return the columns for a width; ``compared`` is the title of the defaults."""
    columns = [
        Column("name", _NAME),
        Column("value", 12, True),
        Column("unit", 9),
        Column(compared, 12, True),
        Column("help", 1),
    ]
    return stretched(columns, width, 4) if width >= _HELP_FROM else columns[:4]


def param_row(
    parameter: Parameter, info: ParamInfo, reference: ParamInfo, columns: Sequence[Column], colours: Palette
) -> Text:
    """Return the row of a parameter; a value that differs from ``reference`` is highlighted."""
    differs = is_changed(parameter, {parameter.name: reference})
    style = f"bold {colours.warning}" if differs else colours.text
    default = "" if reference.default is None else number_text(reference.default)
    cells = [
        Cell(parameter.name, style),
        Cell(number_text(parameter.value), style),
        Cell(info.unit, colours.muted),
        Cell(default, colours.muted),
        Cell(info.help, colours.muted),
    ]
    return row_text(columns, cells[: len(columns)])


def param_details(parameter: Parameter, info: ParamInfo, file_value: float | None, colours: Palette) -> Text:
    """Return a parameter with help, range and the values of its enumeration, on several lines."""
    first, *others = description(parameter, info).splitlines()
    text = Text(first, f"bold {colours.accent}")
    current = f"  {number_text(parameter.value)}: "
    for line in others:
        is_current = bool(info.choices) and line.startswith(current)
        text.append(f"\n{line.strip()}", f"bold {colours.good}" if is_current else colours.text)
    if file_value is not None:
        text.append(f"\nin the file {number_text(file_value)}", colours.text)
    if info == UNKNOWN:
        text.append("\nthe vehicle sends no metadata of this parameter", colours.muted)
    return text


def parse_param(parameter: Parameter, info: ParamInfo, text: str) -> float:
    """Return the value of a typed text, a number or a name of the enumeration; raise ValueError."""
    named = {label.lower(): value for value, label in info.choices}
    try:
        value = named[text.lower()] if text.lower() in named else float(text)
    except ValueError:
        raise ValueError(f"{text or 'nothing'} is not a number") from None
    if not math.isfinite(value):
        raise ValueError("give a finite number")
    if parameter.is_integer and not (value.is_integer() and abs(value) <= LARGEST_INTEGER):
        raise ValueError(f"{parameter.name} is an integer")
    low, high = info.low, info.high
    if (low is not None and value < low) or (high is not None and value > high):
        raise ValueError(f"{parameter.name} must be {info._replace(choices=()).range_text}")
    return value


def differences_text(params: ParamList, wanted: Mapping[str, float]) -> list[str]:
    """Return the parameters whose value is not that in ``wanted``, one a line: old and new value."""
    return [
        f"{name}: {number_text(params.parameters[name].value)} → {number_text(value)}"
        if name in params.parameters
        else f"{name}: the vehicle has no such parameter"
        for name, value in wanted.items()
        if name not in params.parameters or number_text(params.parameters[name].value) != number_text(value)
    ]
