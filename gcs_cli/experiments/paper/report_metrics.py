"""Overshoot, rise, settling and errors of each axis as tables of the report. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from typing import Any, TypeAlias

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_labels import (
    ANGLES,
    AXES,
    AXIS_TITLES,
    LABELS,
    PLANTS,
    UNKNOWN,
    cell,
    fixed,
    row,
    wide_table,
)

Cases: TypeAlias = Mapping[str, Mapping[str, Any]]
"""``cases`` of results.json."""

_COLUMNS = (
    *("#overshoot", "#rise 10–90 %", "#settling 2 %"),
    *("#steady-state error", "#RMS error", "#largest error"),
)


def metrics_table(found: Cases, trajectory: str, plants: Sequence[str], names: Sequence[str]) -> str:
    """Return overshoot, rise, settling and errors of each axis, contender and plant; empty if nothing was flown."""
    rows = [one for axis in AXES for one in _axis_rows(found, trajectory, axis, plants, names)]
    return wide_table(("axis", "controller", "plant", *_COLUMNS), rows) if rows else ""


def step_table(found: Cases, plant: str, condition: str = cases.PLAIN) -> str:
    """Return the figures of each axis in the flight in which it steps; empty if nothing was flown.

    The plant is not told: all rows are of one.
    """
    rows = [
        one
        for axis in AXES
        for one in _axis_rows(found, f"step_{axis}", axis, (plant,), LABELS, condition, plant_told=False)
    ]
    return wide_table(("axis", "controller", *_COLUMNS), rows) if rows else ""


def _axis_rows(
    found: Cases,
    trajectory: str,
    axis: str,
    plants: Sequence[str],
    names: Iterable[str],
    condition: str = cases.PLAIN,
    *,
    plant_told: bool = True,
) -> Iterator[str]:
    first = True
    for plant in plants:
        for name in names:
            case = found.get(cases.key(name, trajectory, condition, plant))
            if case is None:
                continue
            head = f"<th>{escape(AXIS_TITLES[axis]) if first else ''}</th><td>{escape(LABELS[name])}</td>"
            where = f"<td>{escape(PLANTS[plant])}</td>" if plant_told else ""
            yield row(f"{head}{where}{metrics_cells(case, axis)}", first)
            first = False


def metrics_cells(case: Mapping[str, Any], axis: str) -> str:
    """Return the six cells of an axis: %, s, s, then degrees or millimetres; the sentence of a crash instead."""
    if case["ended"] is not None:
        return f'<td class="bad" colspan="6">{escape(ending(case))}</td>'
    of = case["metrics"].get(axis)
    if of is None:
        return '<td class="n" colspan="6">–</td>'
    factor, unit, places = (math.degrees(1.0), "°", 3) if axis in ANGLES else (1e3, "mm", 1)
    upwards = -1.0 if axis == "z" else 1.0  # a height is told, as it is drawn
    errors = (upwards * of["steady_state_error"], of["rms_error"], of["max_error"])
    return "".join(
        (
            cell(with_unit(fixed(of["overshoot_percent"], 1), "%")),
            cell(with_unit(fixed(of["rise_time_s"], 3), "s")),
            cell(with_unit(fixed(of["settling_time_s"], 3), "s")),
            *(cell(with_unit(fixed(factor * error, places), unit)) for error in errors),
        )
    )


def with_unit(shown: str, unit: str) -> str:
    """Append a unit, but not to a dash."""
    return shown if shown == UNKNOWN else f"{shown}{'' if unit == '°' else ' '}{unit}"


HOW_ENDED = {"crashed": "crashed", "lost": "lost control"}


def ending(case: Mapping[str, Any]) -> str:
    """Say how, when and why a flight ended before its time."""
    ended = case["ended"]
    return f"{HOW_ENDED[ended['how']]} at {fixed(ended['time_s'], 2)} s: {ended['why']}"
