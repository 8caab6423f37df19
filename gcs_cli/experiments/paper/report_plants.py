"""The plants against each other as a part of the report: what differs when the same loops fly the same path. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.plants import apart
from gcs_cli.experiments.paper.report_axes import Axis, chart, spanning
from gcs_cli.experiments.paper.report_flights import PAIR, STEP_SIZE, Recordings, over_time
from gcs_cli.experiments.paper.report_labels import (
    ABOUT_PLANTS,
    LABELS,
    PLANTS,
    STYLES,
    UNKNOWN,
    anchored,
    cell,
    fixed,
    legend_of,
    number,
    row,
    wide_table,
)
from gcs_cli.report.chart import Line
from gcs_cli.report.plots import section

_ROUNDING = 1e-4
_MM, _LEAST_MM, _LEAST_DEG = 1e3, 0.01, 1e-3


def plants_section(results: Mapping[str, Any], recordings: Recordings, why_no_multibody: str = "") -> str:
    """Return the table of differences and their course over time, for each pair of plants."""
    plants = results["plants"]
    pairs = [tuple(name.split("_")) for name in plants]
    about = "".join(
        f"<div><dt>{escape(PLANTS[name])}</dt><dd>{escape(ABOUT_PLANTS[name])}</dd></div>"
        for name in PLANTS
        if any(name in pair for pair in pairs) or not pairs
    )
    body = f'<dl class="plants">{about}</dl>{_table(plants)}'
    if why_no_multibody:
        body += f'<p class="none">The multibody plant was left out: {escape(why_no_multibody)}</p>'
    charts = "".join(chart_ for pair in pairs for chart_ in _charts(recordings, *pair))
    body += f'<div class="pair">{charts}</div>{_elsewhere(results.get("plants_elsewhere", {}))}'
    note = (
        "The same controller flies the desired trajectory on both plants; the difference of the states is shown. "
        "Rounding alone: by how much a push of 10⁻¹² N moves the flight on the rigid body from itself. Where that is "
        "more than a micrometre, a loop is unstable and magnifies whatever comes first, and how far two plants are "
        "apart is chance: no bound can be judged there."
    )
    return anchored("plants", section("The plants against each other", body, legend_of(PAIR, ""), note))


def _table(plants: Mapping[str, Any]) -> str:
    if not plants:
        return ""
    rows = []
    for name, contenders in plants.items():
        title = " – ".join(PLANTS[plant] for plant in name.split("_"))
        rows.append(row(f'<th colspan="{len(_COLUMNS)}">{escape(title)}</th>', begins=True))
        for contender, found in contenders.items():
            head = f"<td>{escape(LABELS[contender])}</td>"
            rows.append(row(f"{head}{_figures(found)}{_rounding(found)}{_bound(found)}"))
    return wide_table(_COLUMNS, rows, style="grouped")


_FIGURES = ("#position, largest", "#RMS", "#attitude, largest", "#RMS")
_COLUMNS = ("controller", *_FIGURES, "#rounding alone", "bound")


def _figures(found: Mapping[str, Any]) -> str:
    apart_mm = (_MM * found[key] for key in ("max_position_m", "rms_position_m"))
    turned_deg = (found[key] for key in ("max_attitude_deg", "rms_attitude_deg"))
    shown = [_small(value, " mm") for value in apart_mm] + [_small(value, "°") for value in turned_deg]
    return "".join(cell(text) for text in shown)


def _elsewhere(found: Mapping[str, Any]) -> str:
    """Return the same of the other trajectories that the multibody assembly flew, folded."""
    rows = []
    for trajectory, plants in found.items():
        contenders = plants[f"{cases.RIGID}_{cases.MULTIBODY}"]
        for index, (contender, one) in enumerate(contenders.items()):
            title = trajectory.replace("_", " of ") if not index else ""
            head = f"<th>{escape(title)}</th><td>{escape(LABELS[contender])}</td>"
            rows.append(row(f"{head}{_figures(one)}", not index))
    if not rows:
        return ""
    table = wide_table(("trajectory", "controller", *_FIGURES), rows)
    summary = f"{PLANTS[cases.RIGID]} – {PLANTS[cases.MULTIBODY]} on the other trajectories"
    note = (
        "Steps of the attitude fly without the outer loop: nothing holds their place, and small tilts add up."
    )
    return f'<details><summary>{escape(summary)}</summary>{table}<p class="note">{note}</p></details>'


def _small(value: float, unit: str) -> str:
    """Write a difference; one that is nothing but rounding is only said to be below what anybody asks for."""
    return f"< {_ROUNDING:g}{unit}" if value < _ROUNDING else f"{number(value)}{unit}"


def _rounding(found: Mapping[str, Any]) -> str:
    rounding = found.get("rounding")
    return cell(UNKNOWN if rounding is None else _small(_MM * rounding["max_position_m"], " mm"))


def _bound(found: Mapping[str, Any]) -> str:
    if "within_bounds" not in found:
        return "<td>none: not the same model</td>"
    words = f"{fixed(100.0 * found['position_bound_m'], 0)} cm, {fixed(found['attitude_bound_deg'], 1)}°"
    if found["rounding"] is not None and not found["bound_decides"]:
        return "<td>chance: magnified rounding</td>"
    style, kept = ("good", "kept") if found["within_bounds"] else ("bad", "not kept")
    return f'<td class="{style}">{kept}: {words}</td>'


def _charts(recordings: Recordings, one: str, other: str) -> Iterator[str]:
    position, attitude = [], []
    time = Axis("time [s]", 0.0, 1.0)
    for name in PAIR:
        pair = [recordings.get(cases.key(name, cases.DESIRED, cases.PLAIN, plant)) for plant in (one, other)]
        if pair[0] is None or pair[1] is None:
            continue
        time = over_time(pair[0])
        found = apart(pair[0], pair[1])
        position.append(Line(LABELS[name], found.time_s, _MM * found.position_m, STYLES[name]))
        attitude.append(Line(LABELS[name], found.time_s, found.attitude_deg.max(axis=1), STYLES[name]))
    if not position:
        return
    title = f"{PLANTS[one]} – {PLANTS[other]}"
    for what, lines, least, size in (
        ("position apart [mm]", position, _LEAST_MM, STEP_SIZE),
        ("attitude apart [°]", attitude, _LEAST_DEG, STEP_SIZE),
    ):
        axis = spanning(what, [line.y for line in lines], least=least)
        drawn = chart(f"{title}: {what}", time, axis._replace(low=0.0), lines, size=size)
        yield f'<div><h3 class="plant">{escape(title)}</h3>{drawn}</div>'
