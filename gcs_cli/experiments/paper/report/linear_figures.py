"""Figures of the linear analysis: poles and open loops. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from gcs_cli.charts.figure import Axis, Figure, Level, Panel, Series, Shape
from gcs_cli.experiments.paper.linear.gains import AttitudeGains
from gcs_cli.experiments.paper.linear.margins import response
from gcs_cli.experiments.paper.linear.sampled import Actuators, AttitudeTick
from gcs_cli.experiments.paper.report.labels import (
    ANGLES,
    AXES,
    AXIS_TITLES,
    COLOURS,
    DASHES,
    loop_name,
    loop_title,
)
from gcs_cli.experiments.paper.report.tables import SPIN_UP_TITLE, Loops, own_feedback, shown_loops

BODE_HZ = 1000.0
_POINTS = 240
_LOWEST_RAD_S = 1.0
_SLOW_RAD_S = 8.0
"""Poles of x and y span two decades: the slower ones have a panel of their own."""
_SHAPES: tuple[Shape, ...] = ("x", "cross", "diamond", "square", "triangle-up", "circle-open")
_OTHER = "s8"


def linear_figures(linear: Mapping[str, Any]) -> Iterator[Figure]:
    """Yield the Bode plots of the attitude loops as flown, and the poles of all loops."""
    if not linear:
        return
    loops: Loops = linear["loops"]
    flown = Actuators(0, linear["motor_lag_s"])
    panels = [panel for axis in ANGLES for panel in _bode(loops, axis, flown, AXIS_TITLES[axis])]
    panels += _bode(loops, "yaw", flown._replace(lead_s=linear["spin_up_lead_s"]), SPIN_UP_TITLE)
    yield Figure("bode", "Open attitude loops at 1 kHz", panels, columns=2, height=180)
    yield Figure("poles", "Closed-loop poles", [_poles(loops, axis) for axis in AXES], columns=2, height=200)


def _bode(loops: Loops, axis: str, actuators: Actuators, title: str) -> list[Panel]:
    dt_s = 1.0 / BODE_HZ
    frequency = np.geomspace(_LOWEST_RAD_S, 0.9 * np.pi * BODE_HZ, _POINTS)
    gain, phase = [], []
    for loop in shown_loops(own_feedback(loops, axis)):
        law = AttitudeGains(**loop["axes"][axis]["gains"])
        values = response(AttitudeTick(law, BODE_HZ, actuators).open(), frequency * dt_s)
        turned = np.degrees(np.unwrap(np.angle(values)))
        turned -= 360.0 * np.round((turned[0] + 180.0) / 360.0)  # begins between −360° and 0°
        name = loop_name(loop)
        look = (COLOURS.get(name, _OTHER), DASHES.get(name, "solid"))
        gain.append(Series(loop_title(loop), frequency, 20.0 * np.log10(np.abs(values)), *look))
        phase.append(Series(loop_title(loop), frequency, turned, *look))
    along = Axis("frequency", "rad/s", log=True)
    return [
        Panel(Axis("gain", "dB"), gain, along, title, levels=[Level("", 0.0)]),
        Panel(Axis("phase", "°"), phase, along, title, levels=[Level("", -180.0)]),
    ]


def _poles(loops: Loops, axis: str) -> Panel:
    """Return the map of the poles of an axis; of x and y those slower than ``_SLOW_RAD_S``."""
    marks = []
    distinct = loops if axis in ("x", "y") else own_feedback(loops, axis)
    for index, loop in enumerate(shown_loops(distinct)):
        poles = np.array(loop["axes"][axis]["poles"])
        if axis in ("x", "y"):
            poles = poles[np.hypot(*poles.T) < _SLOW_RAD_S]
        colour, shape = COLOURS.get(loop_name(loop), _OTHER), _SHAPES[index % len(_SHAPES)]
        marks.append(Series(loop_title(loop), poles[:, 0], poles[:, 1], colour, "none", marker=shape))
    title = AXIS_TITLES[axis] + (f", poles below {_SLOW_RAD_S:g} rad/s" if axis in ("x", "y") else "")
    return Panel(
        Axis("imaginary", "1/s"), marks, Axis("real", "1/s"), title, levels=[Level("", 0.0, upright=True)]
    )
