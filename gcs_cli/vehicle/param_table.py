"""Parameters as a table. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from flightstack.mavlink.param_values import Parameter
from gcs_cli.tables import new_table
from gcs_cli.vehicle.param_info import UNKNOWN, ParamInfo, number_text

if TYPE_CHECKING:
    from rich.table import Table

Infos = Mapping[str, ParamInfo]


def is_pattern(text: str) -> bool:
    """Return True if the text has wildcards: ``*``, ``?`` or ``[...]``."""
    return bool(set(text) & set("*?["))


def matching(parameters: Sequence[Parameter], pattern: str) -> list[Parameter]:
    """Return the parameters whose name matches: with ``*`` and ``?`` as a whole, else in any part."""
    wanted = pattern.upper()
    if not is_pattern(pattern):
        wanted = f"*{wanted}*"
    return [parameter for parameter in parameters if fnmatchcase(parameter.name.upper(), wanted)]


def is_changed(parameter: Parameter, infos: Infos) -> bool:
    """Return True if a parameter has a known default and another value."""
    default = infos.get(parameter.name, UNKNOWN).default
    return default is not None and number_text(default) != number_text(parameter.value)


def facts(parameter: Parameter, infos: Infos) -> dict[str, Any]:
    """Return a parameter as ``--json`` prints it; null for values that the vehicle does not send."""
    info = infos.get(parameter.name, UNKNOWN)
    return {
        "name": parameter.name,
        "value": int(parameter.value) if parameter.is_integer else parameter.value,
        "default": info.default,
        "min": info.low,
        "max": info.high,
        "unit": info.unit or None,
        "help": info.help or None,
        "details": info.details or None,
        "choices": {number_text(value): text for value, text in info.choices} or None,
    }


def parameter_table(parameters: Sequence[Parameter], infos: Infos, compared: str = "default") -> Table:
    """Return a table of name, value, range and help; changed values are highlighted, with their default.

    ``compared`` is the heading of the defaults.
    """
    from rich.text import Text

    table = new_table(header_style="bold")
    table.add_column("name", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    if infos:
        if any(is_changed(parameter, infos) for parameter in parameters):
            table.add_column(compared, justify="right", no_wrap=True, style="bright_black")
        table.add_column("range", no_wrap=True, style="bright_black", max_width=16, overflow="ellipsis")
        table.add_column("help", overflow="fold")
    for parameter in parameters:
        info = infos.get(parameter.name, UNKNOWN)
        changed = is_changed(parameter, infos)
        cells = [
            Text(parameter.name, style="bold yellow" if changed else ""),
            Text(number_text(parameter.value), style="bold yellow" if changed else ""),
            Text(info.unit, style="bright_black"),
        ]
        if len(table.columns) == 6:
            cells.append(Text(number_text(info.default) if changed and info.default is not None else ""))
        cells += [Text(info.range_text), Text(info.help)]
        table.add_row(*cells[: len(table.columns)])
    return table


def _without_repetition(details: str, short: str) -> str:
    """Return the long text without the short one at its begin, a sentence that some vehicles repeat there."""
    begin = short.rstrip(".")
    rest = details.removeprefix(begin)
    is_repeated = bool(begin) and rest != details and (not rest or rest[0] == ".")
    return rest.lstrip(". ") if is_repeated else details


def description(parameter: Parameter, info: ParamInfo) -> str:
    """Return one parameter with its metadata, on several lines."""
    lines = [f"{parameter.name} = {number_text(parameter.value)}{_unit(info)}"]
    if info.help:
        lines.append(f"  {info.help}")
    details = _without_repetition(info.details, info.help)
    if details:
        lines.append(f"  {details}")
    limits = [
        f"default {number_text(info.default)}" if info.default is not None else "",
        f"range {info.range_text}" if info.range_text and not info.choices else "",
        "takes effect after a restart" if info.reboot_required else "",
    ]
    if any(limits):
        lines.append("  " + ", ".join(limit for limit in limits if limit))
    lines += [f"  {number_text(value)}: {text}" for value, text in info.choices]
    return "\n".join(lines)


def change_line(name: str, before: float, after: float, info: ParamInfo) -> str:
    """Return the change of a parameter on one line."""
    later = "; it takes effect after a restart" if info.reboot_required else ""
    if number_text(before) == number_text(after):
        return f"{name} is {number_text(after)}{_unit(info)} already"
    return f"{name} = {number_text(after)}{_unit(info)} (was {number_text(before)}){later}"


def _unit(info: ParamInfo) -> str:
    return f" {info.unit}" if info.unit else ""
