"""Figures of the flights: Figs. 7 to 15 of the paper, steps, and the differences of the plants. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.charts.decimate import spaced
from gcs_cli.charts.figure import AnyFigure, Axis, Bars, Figure, Panel, Series, SpaceFigure, SpacePath
from gcs_cli.experiments.paper.findings.plants import apart
from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.flights.types import Recording
from gcs_cli.experiments.paper.report.labels import (
    ANGLES,
    AXIS_TITLES,
    COLOURS,
    DASHES,
    LABELS,
    PLANTS,
    REFERENCE_COLOUR,
)
from gcs_cli.pil.profile import STAGE_TITLES

Recordings: TypeAlias = Mapping[str, Recording]
PAIR = (cases.PID, cases.BACKSTEPPING)
_NUMBERS = {"roll": 8, "pitch": 9, "yaw": 10, "x": 11, "y": 12, "z": 13}
_COLUMN = {"x": 0, "y": 1, "z": 2, "roll": 0, "pitch": 1, "yaw": 2}
_STEP_SHOWN_S = {"roll": 0.5, "pitch": 0.5, "yaw": 1.0, "x": 5.0, "y": 5.0, "z": 2.5}
_ERROR_UNIT, _ERROR_FACTOR = {"m": "mm", "°": "°"}, {"m": 1e3, "°": 1.0}
_BEFORE = 0.08
_PATH_POINTS = 2000
_XY = [
    (trajectory, plant, f"{trajectory} profile, {PLANTS[plant]}")
    for trajectory in (cases.SMOOTH, cases.HARD)
    for plant in (cases.SMALL_ANGLE, cases.RIGID)
]
_STEPPED = (cases.PID, cases.BACKSTEPPING, cases.POLES, cases.TUNED_PID, cases.RATE_FED_PID)


def signals(recording: Recording, axis: str) -> tuple[FloatArray, FloatArray]:
    """Return reference and response of an axis in metres or degrees, z upwards, shape (n,) each."""
    column = _COLUMN[axis]
    if axis in ANGLES:
        wanted = recording.reference[:, 3] if axis == "yaw" else recording.euler_target_rad[:, column]
        return np.degrees(wanted), np.degrees(recording.euler_rad[:, column])
    sign = -1.0 if axis == "z" else 1.0
    return sign * recording.reference[:, column], sign * recording.position_ned_m[:, column]


def unit(axis: str) -> str:
    """Return the unit in which an axis is drawn."""
    return "°" if axis in ANGLES else "m"


def curve(name: str, x: FloatArray, y: FloatArray) -> Series:
    """Return the curve of a contender, in its colour and dash."""
    return Series(LABELS[name], x, y, COLOURS[name], DASHES[name])


def _reference(x: FloatArray, y: FloatArray, name: str = "reference") -> Series:
    return Series(name, x, y, REFERENCE_COLOUR, "dash", 1.2)


def _flown(
    recordings: Recordings, names: Sequence[str], trajectory: str, plant: str = cases.SMALL_ANGLE
) -> dict[str, Recording]:
    keys = {name: cases.key(name, trajectory, cases.PLAIN, plant) for name in names}
    return {name: recordings[key] for name, key in keys.items() if key in recordings}


def beside(recordings: Recordings) -> list[str]:
    """Return the plants drawn side by side: the paper's, and the most physical one that both controllers flew."""
    order = (cases.SMALL_ANGLE, cases.MULTIBODY, cases.RIGID)
    flown = [plant for plant in order if len(_flown(recordings, PAIR, cases.DESIRED, plant)) == len(PAIR)]
    return flown[:2]


def desired_figures(recordings: Recordings) -> Iterator[AnyFigure]:
    """Yield Fig. 7: the desired trajectory over time and in space."""
    recording = recordings.get(cases.key(cases.PID, cases.DESIRED))
    if recording is None:
        return
    panels = []
    for axis in ("x", "y", "z", "yaw"):
        wanted = Series(
            f"desired {axis}", recording.time_s, signals(recording, axis)[0], "s1", in_legend=False
        )
        panels.append(Panel(Axis(AXIS_TITLES[axis], unit(axis)), [wanted]))
    yield Figure("fig-7-time", "Fig. 7: desired trajectory", panels, columns=2, linked=True, height=150)
    path = SpacePath("desired path", _thinned(recording.reference[:, :3]), "s1")
    yield SpaceFigure("fig-7-space", "Fig. 7: desired path", [path])


def response_figures(recordings: Recordings) -> Iterator[Figure]:
    """Yield Figs. 8 to 13: responses on two plants side by side, and their errors below."""
    plants = beside(recordings)
    for axis, figure in _NUMBERS.items():
        above, below = [], []
        for plant in plants:
            pair = _flown(recordings, PAIR, cases.DESIRED, plant)
            first = next(iter(pair.values()))
            of_time = [_reference(first.time_s, signals(first, axis)[0])]
            errors = []
            for name, recording in pair.items():
                wanted, got = signals(recording, axis)
                of_time.append(curve(name, recording.time_s, got))
                errors.append(curve(name, recording.time_s, _ERROR_FACTOR[unit(axis)] * (got - wanted)))
            above.append(Panel(Axis(AXIS_TITLES[axis], unit(axis)), of_time, title=PLANTS[plant]))
            below.append(Panel(Axis("error", _ERROR_UNIT[unit(axis)]), errors))
        if plants:
            title = f"Fig. {figure}: {AXIS_TITLES[axis]}"
            yield Figure(
                f"fig-{figure}", title, [*above, *below], columns=len(plants), linked=True, height=170
            )


def step_figure(recordings: Recordings) -> Iterator[Figure]:
    """Yield the responses of the contenders to steps of each axis on the small-angle plant."""
    panels = []
    for axis, shown_s in _STEP_SHOWN_S.items():
        flown = _flown(recordings, _STEPPED, f"step_{axis}")
        if not flown:
            continue
        first = next(iter(flown.values()))
        wanted = signals(first, axis)[0]
        begin_s = float(first.time_s[int(np.argmax(wanted != wanted[0]))])
        lines = [_reference(first.time_s, wanted)]
        lines += [curve(name, one.time_s, signals(one, axis)[1]) for name, one in flown.items()]
        cut = [_between(line, begin_s - _BEFORE * shown_s, begin_s + shown_s) for line in lines]
        panels.append(Panel(Axis(AXIS_TITLES[axis], unit(axis)), cut))
    if panels:
        yield Figure("steps", "Step responses", panels, columns=2, height=190)


def _between(line: Series, start_s: float, end_s: float) -> Series:
    within = (line.x >= start_s) & (line.x <= end_s)
    return Series(line.name, line.x[within], line.y[within], line.colour, line.dash, line.width)


def _thinned(rows: FloatArray) -> FloatArray:
    return rows[spaced(len(rows), _PATH_POINTS)]


def xy_figure(recordings: Recordings) -> Iterator[Figure]:
    """Yield Fig. 14: both controllers in XY, smooth and hard, on two plants."""
    panels = []
    for trajectory, plant, title in _XY:
        flown = _flown(recordings, PAIR, trajectory, plant)
        if not flown:
            continue
        path = _thinned(next(iter(flown.values())).reference)
        lines = [_reference(path[:, 1], path[:, 0], "desired")]
        for name, one in flown.items():
            position = _thinned(one.position_ned_m)
            lines.append(curve(name, position[:, 1], position[:, 0]))
        east, north = Axis("y, east", "m"), Axis("x, north", "m")
        panels.append(Panel(north, lines, east, title, equal=True))
    if panels:
        yield Figure("fig-14", "Fig. 14: PID and backstepping in XY", panels, columns=2, height=330)


def plants_figure(recordings: Recordings) -> Iterator[Figure]:
    """Yield the distance between the flights on two plants along the desired trajectory."""
    panels = []
    for one, other in ((cases.RIGID, cases.MULTIBODY), (cases.SMALL_ANGLE, cases.RIGID)):
        pairs = (_flown(recordings, PAIR, cases.DESIRED, plant) for plant in (one, other))
        first, second = pairs
        found = {name: apart(first[name], second[name]) for name in first if name in second}
        if not found:
            continue
        title = f"{PLANTS[one]} – {PLANTS[other]}"
        position = [curve(name, of.time_s, 1e3 * of.position_m) for name, of in found.items()]
        attitude = [curve(name, of.time_s, of.attitude_deg.max(axis=1)) for name, of in found.items()]
        panels += [Panel(Axis("position difference", "mm"), position, title=title)]
        panels += [Panel(Axis("attitude difference", "°"), attitude, title=title)]
    if panels:
        yield Figure("plants", "Differences of the plants", panels, columns=2, linked=True, height=180)


def profile_figure(pil: Mapping[str, Any]) -> Iterator[Figure]:
    """Yield Fig. 15: histograms of the execution profile, one row for each stage."""
    panels = []
    for stage, title in STAGE_TITLES.items():
        for name, of in pil.get("controllers", {}).items():
            found = of["profile"]["stages"].get(stage) if of["profile"] else None
            if found is None:
                continue
            edges, counts = found["histogram"]["edges"], found["histogram"]["counts"]
            heights = [100.0 * count / max(1, sum(counts)) for count in counts]
            bars = Bars(LABELS.get(name, name), edges, heights, COLOURS.get(name, "s8"))
            label = of["profile"]["unit"]
            panels.append(Panel(Axis("steps", "%", low=0.0), x=Axis(label), title=title, bars=[bars]))
    if panels:
        columns = max(1, len(pil["controllers"]))
        yield Figure("fig-15", "Fig. 15: execution profile", panels, columns=columns, height=150)


def ended(recordings: Recordings, names: Sequence[str] = PAIR) -> list[str]:
    """Return the flights of Fig. 14 that ended early, each with its time."""
    found = []
    for trajectory, plant, title in _XY:
        for name, one in _flown(recordings, names, trajectory, plant).items():
            if one.ended_s is not None and math.isfinite(one.ended_s):
                found.append(f"{LABELS[name]}, {title}: {one.ended_why} at {one.ended_s:.2f} s")
    return found
