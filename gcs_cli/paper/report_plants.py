"""The plants against each other as a part of the report: what differs when the same loops fly the same path. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

import numpy as np

from gcs_cli.paper import cases
from gcs_cli.paper.report_axes import Axis, chart, spanning
from gcs_cli.paper.report_flights import PAIR, STEP_SIZE, Recordings, over_time
from gcs_cli.paper.report_labels import (
    ABOUT_PLANTS,
    LABELS,
    PLANTS,
    STYLES,
    anchored,
    cell,
    fixed,
    legend_of,
    number,
    row,
    wide_table,
)
from gcs_cli.paper.types import Recording
from gcs_cli.report_chart import Line
from gcs_cli.report_plots import section

_ROUNDING = 1e-4
_MM, _LEAST_MM, _LEAST_DEG = 1e3, 0.01, 1e-3


def plants_section(plants: Mapping[str, Any], recordings: Recordings, why_no_multibody: str = "") -> str:
    """Return the table of differences and their course over time, for each pair of plants."""
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
    body += f'<div class="pair">{charts}</div>'
    note = "The same controller flies the desired trajectory on both plants; the difference of the states is shown."
    return anchored("plants", section("The plants against each other", body, legend_of(PAIR, ""), note))


def _table(plants: Mapping[str, Any]) -> str:
    if not plants:
        return ""
    rows = []
    for name, contenders in plants.items():
        title = " – ".join(PLANTS[plant] for plant in name.split("_"))
        for index, (contender, found) in enumerate(contenders.items()):
            head = f"<th>{escape(title) if not index else ''}</th><td>{escape(LABELS[contender])}</td>"
            apart = "".join(
                cell(_small(_MM * found[key], " mm")) for key in ("max_position_m", "rms_position_m")
            )
            turned = "".join(
                cell(_small(found[key], "°")) for key in ("max_attitude_deg", "rms_attitude_deg")
            )
            rows.append(row(f"{head}{apart}{turned}{_bound(found)}", not index))
    columns = ("plants", "controller", "#position, largest", "#RMS", "#attitude, largest", "#RMS", "bound")
    return wide_table(columns, rows)


def _small(value: float, unit: str) -> str:
    """Write a difference; one that is nothing but rounding is only said to be below what anybody asks for."""
    return f"< {_ROUNDING:g}{unit}" if value < _ROUNDING else f"{number(value)}{unit}"


def _bound(found: Mapping[str, Any]) -> str:
    if "within_bounds" not in found:
        return "<td>another model: differs by right</td>"
    words = f"{fixed(100.0 * found['position_bound_m'], 0)} cm, {fixed(found['attitude_bound_deg'], 1)}°"
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
        apart, turned = differences(pair[0], pair[1])
        position.append(Line(LABELS[name], pair[0].time_s[: len(apart)], _MM * apart, STYLES[name]))
        attitude.append(Line(LABELS[name], pair[0].time_s[: len(apart)], turned, STYLES[name]))
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


def differences(one: Recording, other: Recording) -> tuple[Any, Any]:
    """Return the distance [m] and the largest difference of an angle [°] at the times that both flew, (n,) each."""
    count = min(len(one.time_s), len(other.time_s))
    apart = np.linalg.norm(one.position_ned_m[:count] - other.position_ned_m[:count], axis=1)
    turned = np.degrees(np.abs(one.euler_rad[:count] - other.euler_rad[:count])).max(axis=1)
    return apart, turned
