"""The charts of a PIL report: differences over time, and histograms of costs. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.charts.figure import TIME, Axis, Bars, Figure, Panel, Series, nth_colour
from gcs_cli.pil.compare import Deviation
from gcs_cli.pil.profile import STAGE_TITLES, StageProfile
from gcs_cli.pil.profile import STAGES as PROFILED
from gcs_cli.pil.signals import Signal

_DECADES = 4.0
"""Of a chart: what is smaller than the largest difference by more is drawn at the bottom."""
_STRETCHES = 300
_STAGE_COLOURS = {"outer": "s2", "inner": "s1", "mixer": "s3", "whole": "s5"}


class DeviationChart(NamedTuple):
    """How far one signal is apart over time, for each pair of flights."""

    signal: Signal
    pairs: dict[str, Deviation]


def deviation_figures(charts: Sequence[DeviationChart]) -> Iterator[Figure]:
    """Yield a figure for each signal; pairs of which no bit differs are named, not drawn."""
    for signal, pairs in charts:
        curves, same = [], []
        for index, (pair, apart) in enumerate(pairs.items()):
            if np.any(apart.size > 0.0):
                time_s, size = _envelope(apart)
                curves.append(Series(pair, time_s, size, nth_colour(index)))
            elif len(apart.size):
                same.append(pair)
        caption = f"Largest difference of each of {_STRETCHES} stretches of the flight." if curves else ""
        if same:
            caption = f"{caption} Not drawn, because no bit differs: {', '.join(same)}.".lstrip()
        panel = Panel(Axis("difference", "" if signal.unit == "1" else signal.unit, log=True), curves)
        name = f"difference-{signal.name}".replace("_", "-")
        yield Figure(name, f"Difference over time: {signal.title}", [panel], caption, linked=True, height=190)


def _envelope(apart: Deviation) -> Deviation:
    """Return the largest difference of each stretch of time: between two samples that differ, many do not at all."""
    count = len(apart.size)
    starts = np.unique(np.arange(_STRETCHES) * count // _STRETCHES)
    size = np.maximum.reduceat(apart.size, starts)
    return Deviation(apart.time_s[starts], np.maximum(size, 10.0**-_DECADES * size.max()))


def profile_figure(profiles: Sequence[StageProfile], unit: str, caption: str) -> Figure:
    """Return a histogram for each stage of a step."""
    panels = [histogram_panel(stage, unit, _STAGE_COLOURS[stage.stage]) for stage in profiles]
    return Figure("cost-of-a-step", "What a step costs", panels, caption, columns=2, height=150)


def cost_over_time_figure(costs: FloatArray, unit: str, inner_hz: float | None) -> Figure:
    """Return the largest cost of each stretch over time, for each stage; ``costs`` is (steps, 4)."""
    starts = np.unique(np.arange(_STRETCHES) * len(costs) // _STRETCHES)
    largest = np.maximum.reduceat(costs, starts)
    x = starts.astype(np.float64) if inner_hz is None else starts / inner_hz
    curves = [
        Series(STAGE_TITLES[stage], x, largest[:, column], _STAGE_COLOURS[stage])
        for column, stage in enumerate(PROFILED)
    ]
    time = Axis("step") if inner_hz is None else TIME
    caption = f"Largest cost of each of {len(starts)} stretches."
    return Figure(
        "cost-over-time", "Cost of a step over time", [Panel(Axis("cost", unit), curves, x=time)], caption
    )


def histogram_panel(profile: StageProfile, unit: str, colour: str) -> Panel:
    """Return the histogram of one stage; ``unit`` is that of its costs."""
    shares = [100.0 * count / profile.steps for count in profile.counts]
    hints = [
        f"{_span(*edges)}: {count} of {profile.steps} steps"
        for edges, count in zip(pairwise(profile.edges), profile.counts, strict=True)
    ]
    title = STAGE_TITLES[profile.stage]
    bars = Bars(title, profile.edges, shares, colour, hints)
    return Panel(Axis("share of steps", "%"), x=Axis("cost of a step", unit), title=title, bars=[bars])


def _span(left: float, right: float) -> str:
    first, last = int(left + 0.5), int(right - 0.5)
    return f"{first}" if first == last else f"{first} to {last}"
