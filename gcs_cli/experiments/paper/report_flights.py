"""The flights along the desired trajectory as parts of the report: figures 7 to 13, steps, and their figures. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_axes import Axis, chart, spanning
from gcs_cli.experiments.paper.report_labels import (
    ANGLES,
    AXES,
    AXIS_TITLES,
    LABELS,
    PLANTS,
    REFERENCE,
    STYLES,
    anchored,
    legend_of,
)
from gcs_cli.experiments.paper.report_space import Path, space_chart
from gcs_cli.experiments.paper.types import Recording
from gcs_cli.report.chart import Line
from gcs_cli.report.plots import section

Recordings = Mapping[str, Recording]
Cases = Mapping[str, Mapping[str, Any]]

PAIR = (cases.PID, cases.BACKSTEPPING)
ERROR_SIZE = (480, 150)
STEP_SIZE = (480, 220)
_FIGURES = {"roll": 8, "pitch": 9, "yaw": 10, "x": 11, "y": 12, "z": 13}
_COLUMN = {"x": 0, "y": 1, "z": 2, "roll": 0, "pitch": 1, "yaw": 2}
_LEAST = {False: 0.02, True: 0.2}
"""Smallest span of an axis in metres and in degrees: rounding shall not look like a flight."""


def signals(recording: Recording, axis: str) -> tuple[FloatArray, FloatArray]:
    """Return reference and response of an axis, in metres or degrees, z upwards, shape (n,) each."""
    column = _COLUMN[axis]
    if axis in ANGLES:
        wanted = recording.reference[:, 3] if axis == "yaw" else recording.euler_target_rad[:, column]
        return np.degrees(wanted), np.degrees(recording.euler_rad[:, column])
    sign = -1.0 if axis == "z" else 1.0
    return sign * recording.reference[:, column], sign * recording.position_ned_m[:, column]


def response_lines(flown: Mapping[str, Recording], axis: str) -> list[Line]:
    """Return the reference of the first flight, and the response of each contender."""
    lines: list[Line] = []
    for name, recording in flown.items():
        wanted, got = signals(recording, axis)
        if not lines:
            lines.append(Line("reference", recording.time_s, wanted, REFERENCE))
        lines.append(Line(LABELS[name], recording.time_s, got, STYLES[name]))
    return lines


def label(axis: str) -> str:
    """Return the label of an axis of a chart."""
    if axis in ANGLES:
        return f"{AXIS_TITLES[axis]} [°]"
    return f"{AXIS_TITLES[axis]} [m]"


def over_time(recording: Recording) -> Axis:
    """Return the axis of time of a flight that came to its end or not."""
    end = float(recording.time_s[-1]) if len(recording.time_s) else 1.0
    return Axis("time [s]", 0.0, math.ceil(end - 1e-6))


def desired_figure(recordings: Recordings) -> str:
    """Return figure 7: the desired trajectory over time, from above and in space."""
    recording = recordings.get(cases.key(cases.PID, cases.DESIRED))
    if recording is None:
        return ""
    time = over_time(recording)
    charts = []
    for axis in ("x", "y", "z", "yaw"):
        wanted = signals(recording, axis)[0]
        lines = [Line(f"desired {axis}", recording.time_s, wanted, "s1")]
        charts.append(chart(f"Desired {axis}", time, spanning(label(axis), [wanted]), lines, size=STEP_SIZE))
    path = recording.reference[:, :3]
    plan = Line("desired path", path[:, 1], path[:, 0], "s1")
    above = chart(
        "Desired path from above",
        spanning("east [m]", [path[:, 1]]),
        spanning("north [m]", [path[:, 0]]),
        [plan],
        size=(480, 330),
        equal=True,
    )
    space = space_chart("Desired path in space", [Path("desired path", path, "s1")])
    note = (
        "The paper's figure has no numbers that could be read off; this trajectory is our choice, defined in "
        "gcs_cli/experiments/paper/trajectories/desired.toml. Right below: the path in space, "
        "with its shadow on the ground."
    )
    body = f'<div class="pair">{"".join(charts)}{above}{space}</div>'
    return anchored("fig-7", section("Fig. 7: desired trajectory", body, note=note))


def response_figures(recordings: Recordings) -> Iterator[str]:
    """Yield figures 8 to 13: each axis on two plants side by side, and below each what is missing to the reference."""
    plants = beside(recordings)
    if not plants:
        return
    for axis in AXES:
        columns = "".join(_column(recordings, axis, plant) for plant in plants)
        title = f"Fig. {_FIGURES[axis]}: {AXIS_TITLES[axis]}"
        asked = "asked for by the outer loop (PID flight)" if axis in ("roll", "pitch") else "desired"
        note = "" if axis != "roll" else (
            "Each controller's outer loop asks for a roll and pitch of its own, and each error is that to its own; "
            "drawn is what the PID's asked for."
        )  # fmt: skip
        html = section(title, f'<div class="pair">{columns}</div>', legend_of(PAIR, asked), note)
        yield anchored(f"fig-{_FIGURES[axis]}", html)


def beside(recordings: Recordings) -> list[str]:
    """Return the two plants that are shown side by side: the paper's, and the most physical one that was flown."""
    flown = [
        plant
        for plant in (cases.SMALL_ANGLE, cases.MULTIBODY, cases.RIGID)
        if all(cases.key(name, cases.DESIRED, cases.PLAIN, plant) in recordings for name in PAIR)
    ]
    return flown[:2]


def _column(recordings: Recordings, axis: str, plant: str) -> str:
    pair = {name: recordings[cases.key(name, cases.DESIRED, cases.PLAIN, plant)] for name in PAIR}
    lines, errors = response_lines(pair, axis), []
    for name, recording in pair.items():
        wanted, got = signals(recording, axis)
        errors.append(Line(LABELS[name], recording.time_s, got - wanted, f"{STYLES[name]} thin"))
    time = over_time(max(pair.values(), key=lambda recording: len(recording.time_s)))
    least = _LEAST[axis in ANGLES]
    unit = "°" if axis in ANGLES else "m"
    head = f'<h3 class="plant">{escape(PLANTS[plant])}</h3>'
    response = chart(
        f"{AXIS_TITLES[axis]}, {PLANTS[plant]}",
        time._replace(label=""),
        spanning(label(axis), [line.y for line in lines], least=least),
        lines,
        size=STEP_SIZE,
    )
    missing = chart(
        f"Error of {AXIS_TITLES[axis]}, {PLANTS[plant]}",
        time,
        spanning(f"error [{unit}]", [line.y for line in errors], least=0.1 * least),
        errors,
        size=ERROR_SIZE,
    )
    return f"<div>{head}{response}{missing}</div>"
