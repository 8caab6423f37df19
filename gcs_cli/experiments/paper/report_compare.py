"""PID against backstepping as parts of the report: figure 14, the matrix of disturbances, the paper's claims. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_axes import chart, spanning
from gcs_cli.experiments.paper.report_flights import PAIR, STEP_SIZE, Recordings, label, over_time, signals
from gcs_cli.experiments.paper.report_labels import (
    LABELS,
    PLANTS,
    REFERENCE,
    STYLES,
    TRAJECTORIES,
    anchored,
    label_of,
    legend_of,
    minus,
    row,
    wide_table,
)
from gcs_cli.experiments.paper.report_metrics import HOW_ENDED
from gcs_cli.experiments.paper.types import Recording
from gcs_cli.report.chart import Line
from gcs_cli.report.plots import section

XY_SIZE = (480, 400)
OTHERS = (cases.POLES, cases.RATE_FED_PID, cases.TUNED_PID)
_CONDITION_TITLES = {
    cases.PLAIN: "with rotor limits, motors of 5 ms",
    cases.NO_LIMITS: "no limits, motors of 5 ms",
    cases.IDEAL: "ideal rotors",
}


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
        style, holds = ("good", "yes") if claim["holds"] else ("bad", "no")
        plant, words, threshold = (
            escape(text)
            for text in (
                PLANTS.get(claim["plant"], claim["plant"]),
                minus(claim["words"]),
                claim["threshold"],
            )
        )
        cells = (
            f'<td class="two claim">{title}</td><td>{plant}</td><td class="{style}">{holds}</td><td>{words}</td>'
            f"<td{label_of('holds if')}>{threshold}</td>"
        )
        rows.append(row(cells, new))
    table = wide_table(("claim", "plant", "holds", "what came out", "holds if"), rows, style="stacked")
    return anchored("claims", section("Does it hold?", table))


def xy_figures(recordings: Recordings) -> Iterator[str]:
    """Yield figure 14: both controllers in XY, smooth and hard, with limits and without; then the two besides."""
    body = "".join(
        _xy(recordings, PAIR, trajectory, condition)
        for trajectory in (cases.SMOOTH, cases.HARD)
        for condition in _CONDITION_TITLES
    )
    if not body:
        return
    note = (
        "Small-angle plant. North is up, east is right, a metre is as long in both directions. Ideal rotors have no "
        "limits, no lag and no spin-up torque."
    )
    title = "Fig. 14: PID and backstepping in XY"
    yield anchored(
        "fig-14", section(title, f'<div class="pair">{body}</div>', legend_of(PAIR, "desired"), note)
    )
    others = "".join(
        _xy(recordings, OTHERS, trajectory, cases.PLAIN) for trajectory in (cases.SMOOTH, cases.HARD)
    )
    if others:
        note = (
            "Small-angle plant. What backstepping's poles do without backstepping, what the PID of Table II does when "
            "it is fed the reference's rate as backstepping is, and what our gains do in it."
        )
        title = "Beside figure 14: other gains in the same laws"
        legend = legend_of(OTHERS, "desired")
        yield anchored("fig-14-others", section(title, f'<div class="pair">{others}</div>', legend, note))


def hard_over_time(recordings: Recordings) -> str:
    """Return x, y, height and yaw of both controllers on the hard profile."""
    flown = {name: recordings[key] for name in PAIR if (key := cases.key(name, cases.HARD)) in recordings}
    if not flown:
        return ""
    longest = max(flown.values(), key=lambda recording: len(recording.time_s))
    charts = []
    for axis in ("x", "y", "z", "yaw"):
        lines = [Line("desired", longest.time_s, signals(longest, axis)[0], REFERENCE)]
        lines += [
            Line(LABELS[name], one.time_s, signals(one, axis)[1], STYLES[name]) for name, one in flown.items()
        ]
        kept = [
            lines[0],
            *(line for line, one in zip(lines[1:], flown.values(), strict=True) if one.ended_s is None),
        ]
        reach = spanning(label(axis), [line.y for line in kept])
        charts.append(chart(f"{axis} on the hard profile", over_time(longest), reach, lines, size=STEP_SIZE))
    body = f'<div class="pair">{"".join(charts)}</div>'
    note = "With rotor limits and lag, on the small-angle plant: many variations in a short period of time."
    return anchored("hard", section("The hard profile over time", body, legend_of(PAIR, "desired"), note))


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
        f"{LABELS[name]} {HOW_ENDED[one.ended_how]}: {one.ended_why} at {one.ended_s:.2f} s"
        for name, one in flown.items()
        if one.ended_s
    ]
    return f' <span class="bad">{escape("; ".join(told))}</span>' if told else ""
