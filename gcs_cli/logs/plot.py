"""Fields of a log as a figure, and as text for a terminal. Pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
from rich.text import Text

from flightstack.core.contract import FloatArray
from gcs_cli.charts.canvas import Canvas
from gcs_cli.charts.figure import Axis, Figure, Panel, Series, nth_colour
from gcs_cli.logs.fields import Field
from gcs_cli.logs.recording import Recording

_LABEL = 11
"""Width of the values beside the axis."""
_STYLES = ("cyan", "yellow", "green", "magenta", "blue", "red", "white")


def field_figure(recording: Recording, fields: Sequence[Field], begin_s: float, end_s: float) -> Figure:
    """Return a figure with a panel for each topic."""
    panels: dict[str, list[Series]] = {}
    names = Counter(field.name for field in fields)
    for index, field in enumerate(fields):  # one legend for all panels: no name and no colour twice
        name = field.name if names[field.name] == 1 else field.label
        series = Series(name, *field_samples(recording, field, begin_s, end_s), nth_colour(index))
        panels.setdefault(field.topic.name, []).append(series)
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


def terminal_panel(panel: Panel, width: int, height: int) -> Text:
    """Return a panel as text: title and names, curves in braille with the range of values, axis of time."""
    names = Text(", ").join(
        Text(series.name, _STYLES[index % len(_STYLES)]) for index, series in enumerate(panel.series)
    )
    title = Text.assemble((panel.title, "bold"), "  ", names)
    finite = [np.isfinite(series.y) for series in panel.series]
    values = np.concatenate([series.y[good] for series, good in zip(panel.series, finite, strict=True)])
    times = np.concatenate([series.x[good] for series, good in zip(panel.series, finite, strict=True)])
    if not len(values):
        return Text.assemble(title, ": no finite values")
    low, high = float(values.min()), float(values.max())
    pad = 0.5 * (abs(low) or 1.0) if high == low else 0.0
    limits, span = (low - pad, high + pad), (float(times.min()), float(times.max()))
    canvas = Canvas(max(8, width - _LABEL - 1), height)
    for index, series in enumerate(panel.series):
        x = _scaled(series.x, span, canvas.dots_wide)
        y = canvas.dots_high - _scaled(series.y, limits, canvas.dots_high)
        canvas.points(x, y, _STYLES[index % len(_STYLES)])
        canvas.line(x, y, _STYLES[index % len(_STYLES)])
    labels = {0: f"{limits[1]:.4g}", height - 1: f"{limits[0]:.4g}"}
    rows = [
        Text.assemble(f"{labels.get(row, ''):>{_LABEL}}┤", line)
        for row, line in enumerate(canvas.text().split(allow_blank=True))
    ]
    ends = f"{span[0]:.2f} s", f"{span[1]:.2f} s"
    gap = " " * max(1, canvas.width - len(ends[0]) - len(ends[1]))
    return Text("\n").join([title, *rows, Text(" " * (_LABEL + 1) + ends[0] + gap + ends[1])])


def _scaled(values: FloatArray, ends: tuple[float, float], count: int) -> FloatArray:
    """Return the place of each value in dots, 0 to ``count`` - 1."""
    width = ends[1] - ends[0]
    if not width > 0.0 or not math.isfinite(width):
        return np.full(len(values), 0.5)
    scaled: FloatArray = (values - ends[0]) / width * (count - 1) + 0.5
    return scaled
