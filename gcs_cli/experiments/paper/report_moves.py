"""How far each move of the hard profile overshoots, as a part of the report. Pure."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping
from html import escape

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_labels import (
    LABELS,
    PLANTS,
    UNKNOWN,
    anchored,
    cell,
    condition_label,
    fixed,
    row,
    wide_table,
)
from gcs_cli.experiments.paper.report_metrics import HOW_ENDED, Cases
from gcs_cli.report.plots import section

_NOTE = (
    "Overshoot of each move of x and y, in per cent of the move. –: the vehicle was not yet at rest in its place when "
    "the move began, so that what it passes the target by would be what was left of the move before. The last rows "
    "compare over moves that began at rest in every flight; those of our own gains, whose integrals settle late, are "
    "left out of that."
)
_CONDITIONS = (cases.PLAIN, cases.NO_LIMITS, cases.NO_LAG, cases.IDEAL)
_AXES = ("x", "y")
_OWN = (cases.TUNED_PID, cases.TUNED_BACKSTEPPING)


def move_sections(found: Cases) -> Iterator[str]:
    """Yield the moves of the hard profile on each plant, as flown; without limits and lag folded below."""
    labels = {condition.name: condition_label(condition) for condition in cases.CONDITIONS}
    for plant in (cases.SMALL_ANGLE, cases.RIGID):
        tables = [(name, moves_table(found, name, plant)) for name in _CONDITIONS]
        body = "".join(
            table
            if name == cases.PLAIN
            else f"<details><summary>{escape(labels[name])}</summary>{table}</details>"
            for name, table in tables
            if table
        )
        if body:
            title = f"Overshoot on the hard profile, {PLANTS[plant]}"
            yield anchored(f"moves-hard-{plant}", section(title, body, note=_NOTE))


def moves_table(found: Cases, condition: str, plant: str) -> str:
    """Return the overshoot of each move of x and y, contenders across; empty if no such case was flown."""
    flown = {
        name: found[key] for name in LABELS if (key := cases.key(name, cases.HARD, condition, plant)) in found
    }
    whole = {name: case for name, case in flown.items() if case["ended"] is None}
    if not flown:
        return ""
    rows = []
    for axis in _AXES:
        columns = {name: case["metrics"][axis]["moves"] for name, case in whole.items()}
        for index, moves in enumerate(zip(*columns.values(), strict=True)):
            title = f"{axis}, {fixed(moves[0]['at_s'], 1)} s, by {fixed(moves[0]['by'], 1)} m"
            over = {name: move["overshoot_percent"] for name, move in zip(columns, moves, strict=True)}
            rows.append(row(f"<th>{escape(title)}</th>{_cells(flown, over)}", not index))
    compared = {name: case for name, case in whole.items() if name not in _OWN}
    shared = shared_moves(compared)
    for of, title in (
        (statistics.median, f"median of the {len(shared)} that began at rest with all of the paper's poles"),
        (max, "worst of these"),
    ):
        values = {name: of([move[name] for move in shared]) for name in compared} if shared else {}
        rows.append(row(f"<th>{escape(title)}</th>{_cells(flown, values, marked=True)}", of is not max))
    return wide_table(("move", *(f"#{LABELS[name]}" for name in flown)), rows, style="moves")


def shared_moves(whole: Cases) -> list[dict[str, float]]:
    """Return the overshoots [%] by contender of each move of x and y that began at rest in all flights."""
    columns = [[move for axis in _AXES for move in case["metrics"][axis]["moves"]] for case in whole.values()]
    rows = [
        dict(zip(whole, (move["overshoot_percent"] for move in moves), strict=True))
        for moves in zip(*columns, strict=True)
    ]
    return [one for one in rows if None not in one.values()]


def _cells(flown: Cases, values: Mapping[str, float | None], marked: bool = False) -> str:
    there = [value for value in values.values() if value is not None]
    told = []
    for name, case in flown.items():
        value = values.get(name)
        if case["ended"] is not None:
            told.append(f'<td class="n bad">{escape(HOW_ENDED[case["ended"]["how"]])}</td>')
        else:
            best = marked and value is not None and value <= min(there) + _AS_GOOD_POINTS
            shown = UNKNOWN if value is None else f"{fixed(value, 1)} %"
            told.append(cell(shown, "best" if best else ""))
    return "".join(told)


_AS_GOOD_POINTS = 0.05
