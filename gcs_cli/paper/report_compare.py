"""PID against backstepping as parts of the report: figure 14, the matrix of disturbances, the paper's claims. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from gcs_cli.paper import cases
from gcs_cli.paper.report_axes import chart, spanning
from gcs_cli.paper.report_flights import PAIR, Cases, Recordings, ending
from gcs_cli.paper.report_labels import (
    LABELS,
    PLANTS,
    REFERENCE,
    STYLES,
    TRAJECTORIES,
    UNKNOWN,
    anchored,
    condition_label,
    fixed,
    legend_of,
    row,
    wide_table,
)
from gcs_cli.paper.types import Recording
from gcs_cli.report_chart import Line
from gcs_cli.report_plots import section

XY_SIZE = (480, 400)
OTHERS = (cases.POLES, cases.TUNED_PID)
ALIKE = 0.01
"""Within this share of the best, somebody is as good."""
_CONDITION_TITLES = {cases.PLAIN: "with rotor limits and lag", cases.IDEAL: "without limits and lag"}
_OPEN = ((cases.HARD, cases.SMALL_ANGLE), (cases.SMOOTH, cases.SMALL_ANGLE))


def claims_section(claims: Sequence[Mapping[str, Any]]) -> str:
    """Return the paper's claims and ours with their verdicts, one row for each claim and plant."""
    if not claims:
        return ""
    names = [claim["name"] for claim in claims]
    rows, before = [], ""
    for claim in sorted(claims, key=lambda claim: names.index(claim["name"])):
        new = claim["claim"] != before
        before = claim["claim"]
        title = f"{escape(claim['claim'])}<span>{escape(claim['source'])}</span>" if new else ""
        holds = '<td class="good">yes</td>' if claim["holds"] else '<td class="bad">no</td>'
        plant, words, threshold = (
            escape(text)
            for text in (PLANTS.get(claim["plant"], claim["plant"]), claim["words"], claim["threshold"])
        )
        cells = (
            f'<td class="two claim">{title}</td><td>{plant}</td>{holds}<td>{words}</td><td>{threshold}</td>'
        )
        rows.append(row(cells, new))
    table = wide_table(("claim", "plant", "holds", "what came out", "holds if"), rows)
    return anchored("claims", section("Does it hold?", table))


def xy_figures(recordings: Recordings) -> Iterator[str]:
    """Yield figure 14: both controllers in XY, smooth and hard, with limits and without; then the two besides."""
    body = "".join(
        _xy(recordings, PAIR, trajectory, condition)
        for trajectory in (cases.SMOOTH, cases.HARD)
        for condition in (cases.PLAIN, cases.IDEAL)
    )
    if not body:
        return
    note = "Small-angle plant. North is up, east is right, a metre is as long in both directions."
    title = "Fig. 14: PID and backstepping in XY"
    yield anchored(
        "fig-14", section(title, f'<div class="pair">{body}</div>', legend_of(PAIR, "desired"), note)
    )
    others = "".join(
        _xy(recordings, OTHERS, trajectory, cases.PLAIN) for trajectory in (cases.SMOOTH, cases.HARD)
    )
    if others:
        note = "Small-angle plant. What our gains do in the PID, and what backstepping's poles do without backstepping."
        title = "Beside figure 14: other gains in the same laws"
        legend = legend_of(OTHERS, "desired")
        yield anchored("fig-14-others", section(title, f'<div class="pair">{others}</div>', legend, note))


def _xy(recordings: Recordings, contenders: Sequence[str], trajectory: str, condition: str) -> str:
    flown = {
        name: recordings[key]
        for name in contenders
        if (key := cases.key(name, trajectory, condition)) in recordings
    }
    if not flown:
        return ""
    wanted = next(iter(flown.values())).reference
    lines = [Line("desired", wanted[:, 1], wanted[:, 0], REFERENCE)]
    lines += [
        Line(LABELS[name], recording.position_ned_m[:, 1], recording.position_ned_m[:, 0], STYLES[name])
        for name, recording in flown.items()
    ]
    kept = [
        lines[0],
        *(line for line, one in zip(lines[1:], flown.values(), strict=True) if one.ended_s is None),
    ]
    title = f"{TRAJECTORIES[trajectory].capitalize()} profile, {_CONDITION_TITLES[condition]}"
    drawn = chart(
        title,
        spanning("y, east [m]", [line.x for line in kept]),
        spanning("x, north [m]", [line.y for line in kept]),
        lines,
        size=XY_SIZE,
        equal=True,
    )
    return f'<div><h3 class="plant">{escape(title)}{_crashes(flown)}</h3>{drawn}</div>'


def _crashes(flown: Mapping[str, Recording]) -> str:
    told = [
        f"{LABELS[name]} {one.ended_why} at {one.ended_s:.2f} s" for name, one in flown.items() if one.ended_s
    ]
    return f' <span class="bad">{escape("; ".join(told))}</span>' if told else ""


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
    "Upper figure: RMS distance from the reference in space. Below: the largest error of one axis, and the largest "
    "overshoot of x, y and z. Bold on colour: the smallest RMS of the row, and whatever is within 1 % of it; "
    "underlined: the smallest overshoot. On the hard profile the largest error is a step itself, whoever flies it."
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
    best_rms = min((space_rms(case) for case in survivors), default=math.inf)
    best_over = min((worst_overshoot(case) for case in survivors), default=math.inf)
    for name in LABELS:
        case = flown.get(name)
        if case is None:
            yield f"<td>{UNKNOWN}</td>"
        elif case["ended"] is not None:
            yield f'<td class="bad">{escape(ending(case))}</td>'
        else:
            yield _cell(case, best_rms, best_over)


def _cell(case: Mapping[str, Any], best_rms: float, best_over: float) -> str:
    rms, over = space_rms(case), worst_overshoot(case)
    largest = max(case["metrics"][axis]["max_error"] for axis in "xyz")
    unit, factor, places = ("m", 1.0, 3) if rms >= 0.2 else ("mm", 1e3, 1)
    wide, wide_factor, wide_places = ("m", 1.0, 2) if largest >= 0.2 else ("mm", 1e3, 0)
    best = ' class="best"' if rms <= best_rms * (1.0 + ALIKE) else ""
    beyond = f"{fixed(over, 1)} % over" if math.isfinite(over) else ""
    if beyond and over <= best_over + 0.05:
        beyond = f"<u>{beyond}</u>"
    largest_text = f"max {fixed(wide_factor * largest, wide_places)} {wide}"
    return (
        f'<td class="two"><b{best}>{fixed(factor * rms, places)} {unit}</b><span>{largest_text}</span>'
        f"<span>{beyond}</span></td>"
    )


def space_rms(case: Mapping[str, Any]) -> float:
    """Return the RMS distance from the reference in space [m], from the RMS errors of the axes."""
    return math.sqrt(sum(case["metrics"][axis]["rms_error"] ** 2 for axis in "xyz"))


def worst_overshoot(case: Mapping[str, Any]) -> float:
    """Return the largest overshoot of x, y and z [%]; infinite where none is defined."""
    there = [case["metrics"][axis]["overshoot_percent"] for axis in "xyz"]
    return max((value for value in there if value is not None), default=math.inf)
