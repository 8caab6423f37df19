"""Curves over time in braille: lanes by unit above one time axis. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.charts.canvas import DOTS_X, DOTS_Y, Canvas
from gcs_cli.tui.map.viewport import round_step
from gcs_cli.tui.palette import Palette

CURVE_COLOURS = ("#63a8ff", "#ffa04d", "#4fd196", "#ff7ab8", "#b797ff", "#dcbb4a", "#4dd0dd", "#ff6b6b")
_GAP_PERIODS, _LEAST_GAP_S = 6.0, 1.0
"""A curve is interrupted if no sample arrives for this many of its usual periods, and for this time."""
_LEAST_RANGE = 1e-4
"""Of an axis: smaller changes are noise in most units."""
_LARGEST = 1e100
_TICK_ROWS = 4
_PARTS = 5
"""An axis ends at a multiple of this part of its tick step, so that it seldom changes."""
_LEAST_LANE_ROWS = 4
_TIME_LABEL_CELLS = 12


class Curve(NamedTuple):
    """A field over time; times [s] ascend, NaN are gaps."""

    name: str
    unit: str
    times_s: FloatArray
    values: FloatArray
    colour: str = CURVE_COLOURS[0]


class Span(NamedTuple):
    """The visible time [s], and the time at which values are read: the newest if None."""

    start_s: float
    end_s: float
    cursor_s: float | None = None


class Lane(NamedTuple):
    """Curves of one unit, in rows ``top`` to ``bottom`` of the screen; the first row is the legend."""

    unit: str
    curves: tuple[Curve, ...]
    top: int
    bottom: int


class Scale(NamedTuple):
    """Range and ticks of a vertical axis."""

    low: float
    high: float
    step: float

    @property
    def ticks(self) -> list[float]:
        """Values of the ticks."""
        first, last = math.ceil(self.low / self.step - 1e-9), math.floor(self.high / self.step + 1e-9)
        return [number * self.step for number in range(first, last + 1)]


def draw_plot(curves: Sequence[Curve], span: Span, width: int, height: int, colours: Palette) -> Canvas:
    """Draw the curves; too many lanes for the height are left out from the bottom."""
    canvas = Canvas(width, height)
    lanes = lanes_of(curves, height - 2)
    gutter = gutter_of(curves, span, height)
    for lane in lanes:
        _draw_lane(canvas, lane, scale_of(lane, span), span, gutter, colours)
    if lanes:
        _draw_times(canvas, span, gutter, lanes[-1].bottom + 1, colours)
    if span.cursor_s is not None and lanes:
        x = _columns(np.array([span.cursor_s]), span, gutter, width)
        rows = [0.0, DOTS_Y * (lanes[-1].bottom + 1) - 1.0]
        canvas.line([x[0], x[0]], rows, colours.text)
    return canvas


def gutter_of(curves: Sequence[Curve], span: Span, height: int) -> int:
    """Return the width of the tick labels and the axis."""
    scales = [scale_of(lane, span) for lane in lanes_of(curves, height - 2)]
    return max((len(label) for scale in scales for label in tick_labels(scale)), default=0) + 1


def lanes_of(curves: Sequence[Curve], rows: int) -> list[Lane]:
    """Share ``rows`` among the units of the curves, in order of their first curve."""
    units = list(dict.fromkeys(curve.unit for curve in curves))[: max(1, rows // _LEAST_LANE_ROWS)]
    edges = np.linspace(0, max(0, rows), len(units) + 1).round().astype(int).tolist()
    return [
        Lane(unit, tuple(curve for curve in curves if curve.unit == unit), top, bottom - 1)
        for unit, top, bottom in zip(units, edges[:-1], edges[1:], strict=True)
    ]


def scale_of(lane: Lane, span: Span) -> Scale:
    """Return an axis with ticks at 1, 2 or 5 times a power of ten that holds the visible values."""
    low, high = math.inf, -math.inf
    for curve in lane.curves:
        values = _visible(curve, span)[1]
        values = np.clip(values[np.isfinite(values)], -_LARGEST, _LARGEST)
        if len(values):
            low, high = min(low, float(values.min())), max(high, float(values.max()))
    if low > high:
        low, high = 0.0, 1.0
    least = max(_LEAST_RANGE, max(abs(low), abs(high)) * 1e-6)  # float32 values have about seven digits
    if low == high:
        least = max(1.0, 0.02 * abs(low))
    if high - low < least:
        middle = (low + high) / 2
        low, high = middle - least / 2, middle + least / 2
    step = round_step((high - low) / max(2, (lane.bottom - lane.top) // _TICK_ROWS))
    while math.floor(high / step) <= math.ceil(low / step):  # fewer than two ticks
        step = round_step(step / 2.5)
    part = step / _PARTS
    return Scale(math.floor(low / part + 1e-9) * part, math.ceil(high / part - 1e-9) * part, step)


def tick_labels(scale: Scale) -> list[str]:
    """Return the texts of the ticks, with as many decimals as the step needs."""
    largest = max(abs(scale.low), abs(scale.high))
    if largest >= 1e10:
        return [f"{tick:.{math.ceil(math.log10(largest / scale.step))}e}" for tick in scale.ticks]
    digits = max(0, -math.floor(math.log10(scale.step) + 1e-9))
    return [f"{round(tick, digits) + 0.0:.{digits}f}" for tick in scale.ticks]


def value_text(value: float) -> str:
    """Return a value as the legend shows it."""
    if not math.isfinite(value):
        return "—"
    if abs(value) >= 1e7:
        return f"{value:.3e}"
    digits = 3 - math.floor(math.log10(max(1.0, abs(value))))
    return f"{round(value, max(0, digits)) + 0.0:.{max(0, digits)}f}"


def value_at(curve: Curve, time_s: float | None) -> float:
    """Return the last value up to ``time_s``, or the newest; NaN without one or in a gap."""
    if time_s is None:
        return float(curve.values[-1]) if len(curve.values) else math.nan
    last = int(np.searchsorted(curve.times_s, time_s, side="right"))
    if not last or time_s - curve.times_s[last - 1] > _gap_s(curve):
        return math.nan
    return float(curve.values[last - 1])


def _gap_s(curve: Curve) -> float:
    """Return the time between two samples from which a curve is interrupted."""
    periods_s = np.diff(curve.times_s)
    return max(_LEAST_GAP_S, _GAP_PERIODS * float(np.median(periods_s)) if len(periods_s) else 0.0)


def cell_time(column: int, span: Span, gutter: int, width: int) -> float:
    """Return the time of a column of the screen."""
    share = (column + 0.5 - gutter) / max(1, width - gutter)
    return span.start_s + min(1.0, max(0.0, share)) * (span.end_s - span.start_s)


def _visible(curve: Curve, span: Span) -> tuple[FloatArray, FloatArray]:
    """Return the samples in the span, and one more at each side."""
    first, last = np.searchsorted(curve.times_s, (span.start_s, span.end_s)).tolist()
    part = slice(max(0, first - 1), last + 1)
    return curve.times_s[part], curve.values[part]


def _with_gaps(times_s: FloatArray, values: FloatArray, gap_s: float) -> tuple[FloatArray, FloatArray]:
    """Insert NaN where the stream stopped."""
    gaps = np.flatnonzero(np.diff(times_s) > gap_s) + 1
    return np.insert(times_s, gaps, times_s[gaps]), np.insert(values, gaps, np.nan)


def _columns(times_s: FloatArray, span: Span, gutter: int, width: int) -> FloatArray:
    dots = DOTS_X * (width - gutter)
    x: FloatArray = DOTS_X * gutter + (times_s - span.start_s) / (span.end_s - span.start_s) * dots
    return x


def _draw_lane(canvas: Canvas, lane: Lane, scale: Scale, span: Span, gutter: int, colours: Palette) -> None:
    top, bottom = DOTS_Y * (lane.top + 1), DOTS_Y * (lane.bottom + 1) - 1  # dots below the legend

    def down(values: FloatArray) -> FloatArray:
        y: FloatArray = bottom - (values - scale.low) / (scale.high - scale.low) * (bottom - top) + 0.5
        return y

    label_rows = dict.fromkeys(range(lane.top + 1, lane.bottom + 1), "│")
    for tick, label in zip(scale.ticks, tick_labels(scale), strict=True):
        y = float(down(np.array([tick]))[0])
        label_rows[int(y) // DOTS_Y] = f"{label}┤"
        dots = np.arange(DOTS_X * gutter, canvas.dots_wide, 4)
        canvas.points(dots, np.full(len(dots), y), colours.muted)
    for curve in lane.curves:
        if len(curve.times_s) < 2:
            continue
        times_s, values = _with_gaps(*_visible(curve, span), _gap_s(curve))
        x = _columns(times_s, span, gutter, canvas.width)
        canvas.line(*_thinned(x, down(values)), curve.colour)
    for row, label in label_rows.items():  # also covers the part of curves that is left of the axis
        canvas.label(0, row, f"{label:>{gutter}}", colours.muted)
    column = 0
    canvas.label(0, lane.top, " " * canvas.width)
    for text, style in _legend(lane, span, colours, canvas.width):
        canvas.label(column, lane.top, text, style)
        column += len(text)


def _thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and largest y of each column of dots, if there are many more samples than columns."""
    if len(x) < 4 or len(x) < 4 * (x[-1] - x[0]):
        return x, y
    columns = np.floor(x)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(columns)) + 1))
    low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
    return np.repeat(columns[starts], 2), np.column_stack((low, high)).ravel()


def _legend(lane: Lane, span: Span, colours: Palette, width: int) -> Iterator[tuple[str, str]]:
    """Yield name and value of each curve, at the cursor or the newest; names are short if the width is."""
    unit = f" {lane.unit}" if lane.unit else ""
    values = [value_text(value_at(curve, span.cursor_s)) for curve in lane.curves]
    names = [curve.name for curve in lane.curves]
    if sum(len(name) + len(value) + len(unit) + 4 for name, value in zip(names, values, strict=True)) > width:
        names = [name.partition(".")[2] or name for name in names]
    for curve, name, value in zip(lane.curves, names, values, strict=True):
        yield f" {name} ", f"bold {curve.colour}"
        yield f"{value}{unit}  ", colours.text


def _draw_times(canvas: Canvas, span: Span, gutter: int, row: int, colours: Palette) -> None:
    """Draw the time axis: seconds before the right edge."""
    length_s = span.end_s - span.start_s
    cells = max(1, canvas.width - gutter)
    step_s = round_step(length_s / max(1, cells // _TIME_LABEL_CELLS))
    canvas.label(gutter - 1, row, "└" + "─" * cells, colours.muted)
    ticks = np.arange(0, math.floor(length_s / step_s + 1e-9) + 1) * step_s
    cursor = range(0)
    if span.cursor_s is not None:
        column = gutter + int((span.cursor_s - span.start_s) / length_s * cells)
        text = f" −{span.end_s - span.cursor_s:.2f} s "
        cursor = _centred(canvas, column, text)
        canvas.label(cursor.start, row + 1, text, f"bold {colours.text}")
    for ago_s in ticks.tolist():
        column = min(canvas.width - 1, gutter + int((length_s - ago_s) / length_s * cells))
        text = "0 s" if not ago_s else f"−{ago_s:g} s"
        canvas.label(column, row, "┴", colours.muted)
        place = _centred(canvas, column, text)
        if place.stop <= cursor.start or place.start >= cursor.stop:
            canvas.label(place.start, row + 1, text, colours.muted)


def _centred(canvas: Canvas, column: int, text: str) -> range:
    """Return the columns of a text centred at ``column``, within the canvas."""
    start = max(0, min(canvas.width - len(text), column - len(text) // 2))
    return range(start, start + len(text))
