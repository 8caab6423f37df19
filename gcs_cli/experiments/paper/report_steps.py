"""Steps of each axis as parts of the report: responses, figures, and what the reference asks of yaw. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import DEFAULT_VEHICLE, load_vehicle
from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.report_alike import hidden_note
from gcs_cli.experiments.paper.report_axes import Axis, chart, spanning
from gcs_cli.experiments.paper.report_flights import STEP_SIZE, Recordings, label, response_lines
from gcs_cli.experiments.paper.report_labels import ANGLES, LABELS, PLANTS, anchored, fixed, legend_of
from gcs_cli.experiments.paper.report_metrics import step_table
from gcs_cli.experiments.paper.types import Recording
from gcs_cli.report.chart import Line
from gcs_cli.report.plots import section

_STEP_SHOWN_S = 2.5
_SHAPED_NOTE = (
    "Setpoints pass the reference model that our own gains are meant for, as guidance does in flight: it feeds "
    "velocity and acceleration ahead. The bare steps above go round it: what our gains overshoot there says little "
    "of how they fly."
)


def step_sections(results: Mapping[str, Any], recordings: Recordings) -> Iterator[str]:
    """Yield steps of the attitude and of the position, bare and through the reference model, and their figures."""
    found = results["cases"]
    title = "Steps of the attitude, inner loop alone"
    yield step_figure(recordings, title, "steps", ANGLES, note=yaw_note(results))
    yield step_figure(recordings, "Steps of the position", "steps-position", ("x", "y", "z"))
    title = "Steps of the position through a reference model"
    yield step_figure(recordings, title, "steps-shaped", ("x", "y", "z"), cases.SHAPED, _SHAPED_NOTE)
    tables = ""
    for condition, words in ((cases.PLAIN, ""), (cases.SHAPED, ", through the reference model")):
        for plant, name in PLANTS.items():
            table = step_table(found, plant, condition)
            if table:
                unfolded = " open" if (plant, condition) == (cases.SMALL_ANGLE, cases.PLAIN) else ""
                tables += f"<details{unfolded}><summary>{escape(name + words)}</summary>{table}</details>"
    if tables:
        note = "Of the axis that steps: what the paper's words of overshoot and stabilisation time have no numbers for."
        yield anchored("step-figures", section("Figures of the steps", tables, note=note))


def yaw_note(results: Mapping[str, Any]) -> str:
    """Say that the reference filter asks more of yaw than the rotors have, and what comes of it; or nothing."""
    flown = {name: results["cases"].get(cases.key(name, "step_yaw")) for name in (cases.PID, cases.TUNED_PID)}
    over = {
        name: case["metrics"]["yaw"]["overshoot_percent"]
        for name, case in flown.items()
        if case is not None and case["ended"] is None
    }
    if len(over) < len(flown) or None in over.values():
        return ""
    asked = [
        open_gains(gains).table("attitude_reference").number("max_acceleration_rad_s2", 0.0, math.inf)
        for gains in _GAINS
    ]
    linear = _linear_overshoot(results)
    beside = (
        ""
        if linear is None
        else f", where the same loop overshoots by {fixed(linear, 2)} % when it is linear"
    )
    return (
        "Yaw is not a matter of the controllers alone: the reference filter lets the heading be accelerated by "
        f"{asked[0]:g} rad/s² (own gains: {asked[1]:g}), and at hover thrust the rotors have no more than "
        f"{yaw_authority():.1f} rad/s² to give. So a step of yaw saturates them: {LABELS[cases.PID]} overshoots by "
        f"{fixed(over[cases.PID], 1)} %{beside}; {LABELS[cases.TUNED_PID]} by {fixed(over[cases.TUNED_PID], 1)} %."
    )


_GAINS = ("paper", "tuned")


def _linear_overshoot(results: Mapping[str, Any]) -> float | None:
    """Overshoot [%] of Table II's yaw loop by the linear analysis, in continuous time."""
    for loop in results["linear"]["loops"] if results["linear"] else ():
        if (loop["controller"], loop["gains"]) == ("pid", "paper") and loop["axes"]["yaw"]["step"]:
            value: float = loop["axes"]["yaw"]["step"]["overshoot_percent"]
            return value
    return None


def yaw_authority() -> float:
    """Return the largest yaw acceleration [rad/s²] of the paper's vehicle at hover: one pair slowest, one fastest."""
    vehicle = load_vehicle(DEFAULT_VEHICLE)
    matrix = vehicle.effectiveness()  # of the squared speeds: thrust, then torques
    squared = vehicle.weight_n / matrix[0].sum()
    lowest, highest = (
        np.array([value**2 for value in speeds])
        for speeds in zip(*((r.min_speed_rad_s, r.max_speed_rad_s) for r in vehicle.rotors), strict=True)
    )
    turning = np.where(matrix[3] > 0.0, np.minimum(2.0 * squared - lowest, highest), lowest)
    return float(matrix[3] @ turning) / vehicle.inertia_kg_m2[2]


def step_figure(
    recordings: Recordings,
    title: str,
    anchor: str,
    axes: Sequence[str],
    condition: str = cases.PLAIN,
    note: str = "",
) -> str:
    """Return the responses of all contenders to steps of these axes, on the small-angle plant."""
    charts: list[str] = []
    curves: dict[str, list[Line]] = {}
    names: list[str] = []
    for axis in axes:
        flown = {
            name: recordings[key]
            for name in LABELS
            if (key := cases.key(name, f"step_{axis}", condition)) in recordings
        }
        if not flown:
            continue
        names = list(flown)
        lines = _step_lines(flown, axis)
        charts.append(_step_chart(lines, axis))
        curves["height" if axis == "z" else axis] = lines[1:]
    if not charts:
        return ""
    body = f'<div class="pair">{"".join(charts)}</div>'
    note = " ".join(words for words in (hidden_note(curves), note) if words)
    return anchored(anchor, section(title, body, legend_of(names), note))


def _step_lines(flown: Mapping[str, Recording], axis: str) -> list[Line]:
    """Return reference and responses from just before the step."""
    lines = response_lines(flown, axis)
    begin_s = float(lines[0].x[int(np.argmax(lines[0].y != lines[0].y[0]))])
    shown_s = _STEP_SHOWN_S if axis not in ANGLES else 0.2 * _STEP_SHOWN_S
    shown_s *= 2.0 if axis in ("x", "y", "yaw") else 1.0
    return [_between(line, begin_s - 0.08 * shown_s, begin_s + shown_s) for line in lines]


def _step_chart(lines: Sequence[Line], axis: str) -> str:
    time = Axis("time [s]", float(lines[0].x[0]), float(lines[0].x[-1]))
    reach = spanning(label(axis), [line.y for line in lines])
    return chart(f"Step of {axis}", time, reach, lines, size=STEP_SIZE)


def _between(line: Line, start_s: float, end_s: float) -> Line:
    within = (line.x >= start_s) & (line.x <= end_s)
    return line._replace(x=line.x[within], y=line.y[within])
