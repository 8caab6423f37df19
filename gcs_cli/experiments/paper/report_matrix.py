"""The matrix of disturbances as a part of the report: who flies best under what. Pure."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_labels import (
    LABELS,
    PLANTS,
    TRAJECTORIES,
    UNKNOWN,
    anchored,
    condition_label,
    fixed,
    row,
    wide_table,
)
from gcs_cli.experiments.paper.report_metrics import Cases, ending
from gcs_cli.report.plots import section

ALIKE = 0.01
"""Within this share of the best, somebody is as good."""
IN_METRES = 0.2
"""Shorter ones are written in millimetres."""
_OPEN = ((cases.HARD, cases.SMALL_ANGLE), (cases.SMOOTH, cases.SMALL_ANGLE))


def matrix_sections(found: Cases) -> Iterator[str]:
    """Yield a table for each profile and plant: conditions down, contenders across, the best one marked."""
    for trajectory in (cases.HARD, cases.SMOOTH, cases.DESIRED):
        for plant in (cases.SMALL_ANGLE, cases.RIGID):
            table = matrix_table(found, trajectory, plant)
            if not table:
                continue
            title = f"{TRAJECTORIES[trajectory].capitalize()} profile, {PLANTS[plant]}"
            name = f"matrix-{trajectory}-{plant}"
            if (trajectory, plant) in _OPEN:
                yield anchored(name, section(f"Disturbances: {title}", table, note=_MATRIX_NOTE))
            else:
                folded = f"<details><summary>{escape(title)}</summary>{table}</details>"
                yield anchored(name, f"<section>{folded}</section>")


_MATRIX_NOTE = (
    "Upper figure: RMS distance from the reference in space. Below: the largest error of one axis, and the overshoot "
    "over the moves of x, y and z that began at rest: the median, and the worst with its axis. Bold on colour: the "
    "smallest RMS of the row, and whatever is within 1 % of it. On the hard profile the largest error is a step "
    "itself, whoever flies it. A flight that lost control has no figures: what comes after is not what was asked for."
)


def matrix_table(found: Cases, trajectory: str, plant: str) -> str:
    """Return the table; empty if no such case was flown."""
    rows = []
    for condition in cases.CONDITIONS:
        flown = {
            name: found[key]
            for name in LABELS
            if (key := cases.key(name, trajectory, condition.name, plant)) in found
        }
        if flown:
            rows.append(row(f"<th>{escape(condition_label(condition))}</th>{''.join(_cells(flown))}"))
    return wide_table(("", *LABELS.values()), rows, style="matrix") if rows else ""


def _cells(flown: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    survivors = [case for case in flown.values() if case["ended"] is None]
    best = min((space_rms(case) for case in survivors), default=math.inf)
    for name in LABELS:
        case = flown.get(name)
        if case is None:
            yield f"<td>{UNKNOWN}</td>"
        elif case["ended"] is not None:
            yield f'<td class="bad">{escape(ending(case))}</td>'
        else:
            yield _cell(case, best)


def _cell(case: Mapping[str, Any], best: float) -> str:
    rms, over = space_rms(case), overshoots(case)
    largest = max(case["metrics"][axis]["max_error"] for axis in "xyz")
    style = ' class="best"' if rms <= best * (1.0 + ALIKE) else ""
    beyond = ""
    if over:
        most = max(over, key=over.__getitem__)
        beyond = f"{fixed(statistics.median(over.values()), 1)} % over, {most[0]} {fixed(over[most], 1)} %"
    figures = (
        f"<b{style}>{_length(rms, 3, 1)}</b><span>max {_length(largest, 2, 0)}</span><span>{beyond}</span>"
    )
    return f'<td class="two">{figures}</td>'


def _length(metres: float, places_m: int, places_mm: int) -> str:
    return f"{fixed(metres, places_m)} m" if metres >= IN_METRES else f"{fixed(1e3 * metres, places_mm)} mm"


def space_rms(case: Mapping[str, Any]) -> float:
    """Return the RMS distance from the reference in space [m], from the RMS errors of the axes."""
    return math.sqrt(sum(case["metrics"][axis]["rms_error"] ** 2 for axis in "xyz"))


def overshoots(case: Mapping[str, Any]) -> dict[tuple[str, float], float]:
    """Return the overshoot [%] of each move of x, y and z that began at rest, by axis and time."""
    return {
        (axis, move["at_s"]): move["overshoot_percent"]
        for axis in "xyz"
        for move in case["metrics"][axis]["moves"]
        if move["overshoot_percent"] is not None
    }
