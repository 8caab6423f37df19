"""Fields of a log as a figure, and as text for a terminal. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.charts.colours import nth_colour
from gcs_cli.charts.figure import Axis, Figure, Panel, Series
from gcs_cli.logs.fields import Field
from gcs_cli.logs.recording import AnyArray, Recording

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of a braille character, by row and column."""
_BRAILLE = 0x2800
_LABEL = 11
"""Width of the values beside the axis."""


def field_figure(recording: Recording, fields: Sequence[Field], begin_s: float, end_s: float) -> Figure:
    """Return a figure with a panel for each topic."""
    panels: dict[str, list[Series]] = {}
    for field in fields:
        time_s, values = field_samples(recording, field, begin_s, end_s)
        curves = panels.setdefault(field.topic.name, [])
        curves.append(Series(field.name, time_s, values, nth_colour(len(curves))))
    return Figure(
        name="fields",
        title=recording.source,
        panels=[Panel(Axis(), curves, title=name) for name, curves in panels.items()],
        linked=True,
    )


def field_samples(
    recording: Recording, field: Field, begin_s: float, end_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return time since the start of the log [s] and values, within the limits."""
    time_s = (field.topic.time_us - recording.start_us) * 1e-6
    kept = (time_s >= begin_s) & (time_s <= end_s)
    return time_s[kept], field.topic.fields[field.name][kept].astype(np.float64)


def terminal_panel(panel: Panel, width: int, height: int) -> list[str]:
    """Return a panel as lines: title with ranges, curves in braille, axis of time."""
    finite = [_finite(series) for series in panel.series]
    times = np.concatenate([time_s for time_s, _ in finite])
    values = np.concatenate([y for _, y in finite])
    names = ", ".join(series.name for series in panel.series)
    if not len(values):
        return [f"{panel.title}  {names}: no finite values"]
    low, high = float(values.min()), float(values.max())
    pad = 0.5 * (abs(low) or 1.0) if high == low else 0.0
    columns = max(8, width - _LABEL - 1)
    canvas = [[0] * columns for _ in range(height)]
    span = (float(times.min()), float(times.max()))
    for time_s, y in finite:
        _draw(canvas, time_s, y, span, (low - pad, high + pad))
    labels = {0: f"{high + pad:.4g}", height - 1: f"{low - pad:.4g}"}
    rows = [
        f"{labels.get(row, ''):>{_LABEL}}┤" + "".join(chr(_BRAILLE | dots) for dots in line)
        for row, line in enumerate(canvas)
    ]
    ends = f"{span[0]:.2f} s", f"{span[1]:.2f} s"
    axis = " " * (_LABEL + 1) + ends[0] + " " * max(1, columns - len(ends[0]) - len(ends[1])) + ends[1]
    return [f"{panel.title}  {names}", *rows, axis]


def _finite(series: Series) -> tuple[FloatArray, FloatArray]:
    good = np.isfinite(series.y)
    return series.x[good], series.y[good]


def _draw(
    canvas: list[list[int]],
    time_s: FloatArray,
    y: FloatArray,
    span: tuple[float, float],
    limits: tuple[float, float],
) -> None:
    """Set the dots of a curve: in each column of dots, all between its smallest and largest value."""
    dots_x, dots_y = 2 * len(canvas[0]), 4 * len(canvas)
    column = _scaled(time_s, span, dots_x)
    row = dots_y - 1 - _scaled(y, limits, dots_y)
    for x in np.unique(column):
        here = row[column == x]
        for dot in range(int(here.min()), int(here.max()) + 1):
            canvas[dot // 4][x // 2] |= _DOTS[dot % 4][x % 2]


def _scaled(values: FloatArray, ends: tuple[float, float], count: int) -> AnyArray:
    """Return the dot of each value, 0 to ``count`` - 1."""
    width = ends[1] - ends[0]
    if not width > 0.0 or not math.isfinite(width):
        return np.zeros(len(values), dtype=np.int64)
    return np.clip((values - ends[0]) / width * (count - 1) + 0.5, 0, count - 1).astype(np.int64)
