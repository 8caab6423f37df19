"""The figures of a campaign's report: distributions, and the margin over each input. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.campaign.rows import Row
from gcs_cli.campaign.statistics import numeric_inputs
from gcs_cli.charts.figure import Axis, Bars, Figure, Level, Panel, Series
from gcs_cli.scenarios.figures import METRICS

_MOST_BINS = 30
_UNITS = {"_s": "s", "_m": "m", "_m_s": "m/s", "_deg": "deg", "_percent": "%"}
"""Units by the ends of names."""
MARGIN = Axis("least margin", "% of its limit")


def axis_of(name: str) -> Axis:
    """Return the axis of a metric or an input; the unit is the end of its name.

    >>> axis_of("max_speed_m_s")
    Axis(label='max speed', unit='m/s', low=None, high=None, log=False)
    """
    end = max((end for end in _UNITS if name.endswith(end)), key=len, default="")
    label = name.removesuffix(end).replace("_", " ") if "." not in name else name
    return Axis(label, _UNITS.get(end, ""))


def margin_figure(rows: Sequence[Row]) -> Figure:
    """Return the histogram of the least margin of each flight."""
    shares = np.array([100.0 * row["robustness"] for row in rows], float)
    bars = _histogram("flights", shares)
    panel = Panel(
        Axis("flights"), x=MARGIN, bars=[bars] if bars else [], levels=[Level("fails", 0.0, upright=True)]
    )
    caption = "The smallest margin of each flight as a share of its limit; a flight left of 0 fails."
    return Figure("margin", "Least margin", [panel], caption)


def metric_figure(rows: Sequence[Row]) -> Figure:
    """Return the histograms of all metrics."""
    panels = []
    for name in METRICS:
        values = np.array(
            [row["metrics"][name] for row in rows if row["metrics"].get(name) is not None], float
        )
        bars = _histogram(name, values)
        if bars is not None:
            panels.append(Panel(Axis("flights"), x=axis_of(name), bars=[bars]))
    return Figure("metrics", "Metrics", panels, "Flights by the value of each metric.", columns=2)


def input_figure(rows: Sequence[Row]) -> Figure:
    """Return the least margin over each numeric input."""
    panels = [
        Panel(MARGIN, list(_marks(rows, _input(name), _margin)), axis_of(name), levels=[Level("", 0.0)])
        for name in numeric_inputs(rows)
    ]
    return Figure(
        "inputs", "Margin over each input", panels, "A mark for each flight; below 0 it fails.", columns=2
    )


def map_figure(rows: Sequence[Row], first: str, second: str, edge: Sequence[Row] = ()) -> Figure:
    """Return flights over two inputs, those that fail apart; ``edge``: flights on the boundary."""
    series = list(_marks(rows, _input(first), _input(second)))
    if edge:
        x, y = (np.array([row["inputs"][name] for row in edge], float) for name in (first, second))
        series.append(
            Series("boundary", x, y, "s4", "none", marker="diamond", hints=[_hint(row) for row in edge])
        )
    caption = (
        "A mark for each flight over the two inputs; the boundary is the least failing value of a direction."
    )
    panel = Panel(axis_of(second), series, axis_of(first))
    return Figure("boundary", "Stability boundary", [panel], caption, height=420)


def _marks(
    rows: Sequence[Row], x_of: Callable[[Row], float], y_of: Callable[[Row], float]
) -> Iterator[Series]:
    for name, is_passed, colour in (("passed", True, "s3"), ("failed", False, "s2")):
        found = [row for row in rows if row["passed"] == is_passed]
        if found:
            x, y = (np.array([of(row) for row in found], float) for of in (x_of, y_of))
            marker = "circle" if is_passed else "x"
            hints = [_hint(row) for row in found]
            yield Series(name, x, y, colour, "none", marker=marker, hints=hints)  # type: ignore[arg-type]


def _hint(row: Row) -> str:
    return f"flight {row['flight']}: {100.0 * row['robustness']:.1f} %, {row['closest'] or row['outcome']}"


def _margin(row: Row) -> float:
    return 100.0 * float(row["robustness"])


def _input(name: str) -> Callable[[Row], float]:
    return lambda row: float(row["inputs"][name])


def _histogram(name: str, values: FloatArray) -> Bars | None:
    """Return bars of equal width; None without values."""
    if not len(values):
        return None
    low, high = float(values.min()), float(values.max())
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-9):
        width = max(abs(low), 1.0) * 0.05
        low, high = low - width, high + width
    bins = min(_MOST_BINS, max(1, math.ceil(math.sqrt(len(values)))))
    counts, edges = np.histogram(values, bins, (low, high))
    return Bars(name, edges.tolist(), [float(count) for count in counts])
