"""Line charts as SVG text. Pure: arrays in, markup out; colours come from the page's style sheet."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.report.svg import (
    WIDTH,
    Scale,
    circle,
    decade_ticks,
    nice_ticks,
    polyline,
    rectangle,
    segment,
    text,
    tick_text,
    upright_text,
)

LEFT, RIGHT, TOP, BOTTOM = 58, 14, 20, 34
_BUCKETS = 430  # two points each: about one for a pixel
_MARKED = 60  # up to so many samples are drawn as dots too
_BAND_LABEL_WIDTH = 7.0  # of a character, in pixels


class Line(NamedTuple):
    """A curve; ``style`` is a class of the style sheet."""

    label: str
    x: FloatArray
    y: FloatArray
    style: str


class Level(NamedTuple):
    """A horizontal line across the chart, such as a limit."""

    label: str
    y: float


class Band(NamedTuple):
    """A stretch of time with a name, such as a flight mode."""

    start: float
    end: float
    label: str


def decimated(x: FloatArray, y: FloatArray, buckets: int = _BUCKETS) -> tuple[FloatArray, FloatArray]:
    """Keep the smallest and the largest sample of each bucket in time order, and the first and the last one.

    No peak is lost. ``y`` must be finite; x and y have shape (n,).
    """
    count = len(x)
    if count <= 2 * buckets:
        return x, y
    starts = np.arange(buckets) * count // buckets
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    bucket = np.repeat(np.arange(buckets), np.diff(np.append(starts, count)))
    kept = {0, count - 1}
    for extreme in (low, high):
        hits = np.flatnonzero(y == extreme[bucket])
        first_of_bucket = np.unique(bucket[hits], return_index=True)[1]
        kept.update(hits[first_of_bucket].tolist())
    index = np.array(sorted(kept))
    return x[index], y[index]


def finite_runs(x: FloatArray, y: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the stretches in which both are finite; x and y have shape (n,)."""
    finite = np.isfinite(x) & np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], finite, [False]))))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        yield x[start:end], y[start:end]


def _range(lines: Sequence[Line], levels: Sequence[Level], log: bool) -> tuple[float, float] | None:
    parts = [line.y[np.isfinite(line.y)] for line in lines]
    values = np.concatenate([*parts, np.array([level.y for level in levels])])
    if not any(len(part) for part in parts):
        return None
    low, high = float(values.min()), float(values.max())
    if log:
        return 10.0 ** math.floor(math.log10(low)), 10.0 ** (math.floor(math.log10(high)) + 1.0)
    margin = max(0.06 * (high - low), 1e-3 * max(abs(low), abs(high)), 1e-3)
    return low - margin, high + margin


def time_chart(
    name: str,
    y_label: str,
    lines: Sequence[Line],
    x_range: tuple[float, float],
    *,
    bands: Sequence[Band] = (),
    levels: Sequence[Level] = (),
    x_label: str = "time [s]",
    height: int = 230,
    log: bool = False,
    zero_based: bool = False,
) -> str:
    """Return a chart of curves over time [s]; a sentence instead if there is nothing to draw."""
    if log:
        lines = [line._replace(y=np.where(line.y > 0.0, line.y, math.nan)) for line in lines]
    y_range = _range(lines, levels, log)
    if y_range is None:
        return '<p class="none">No data.</p>'
    low, high = (0.0, y_range[1]) if zero_based else y_range
    x = Scale(x_range[0], max(x_range[1], x_range[0] + 1e-3), LEFT, WIDTH - RIGHT)
    y = Scale(low, high, height - BOTTOM, TOP, log)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(name)}">',
        *_bands(bands, x, height),
        *_grid(x, y, height, (x_label, y_label)),
        *_levels(levels, y),
    ]
    for line in lines:
        parts.extend(_curve(line, x, y))
    parts.append("</svg>")
    return "".join(parts)


def _curve(line: Line, x: Scale, y: Scale) -> Iterator[str]:
    yield f"<g><title>{escape(line.label)}</title>"
    for run_x, run_y in finite_runs(line.x, line.y):
        kept_x, kept_y = decimated(run_x, run_y)
        px, py = x.pixels(kept_x), y.pixels(kept_y)
        yield polyline(px, py, line.style)
        if len(line.x) <= _MARKED:
            for a, b in zip(px.tolist(), py.tolist(), strict=True):
                yield circle(f"dot {line.style}", a, b, 2.5)
    yield "</g>"


def _bands(bands: Sequence[Band], x: Scale, height: int) -> Iterator[str]:
    for index, band in enumerate(bands):
        left, right = x.pixel(max(band.start, x.low)), x.pixel(min(band.end, x.high))
        if right <= left:
            continue
        shade = "band even" if index % 2 else "band odd"
        yield rectangle(shade, left, TOP, right - left, height - BOTTOM - TOP)
        if right - left >= _BAND_LABEL_WIDTH * len(band.label):
            yield text("band-label", 0.5 * (left + right), TOP - 6, band.label)


def _grid(x: Scale, y: Scale, height: int, labels: tuple[str, str]) -> Iterator[str]:
    bottom, right = height - BOTTOM, WIDTH - RIGHT
    for value in decade_ticks(y.low, y.high) if y.log else nice_ticks(y.low, y.high, max(5, height // 40)):
        at = y.pixel(value)
        yield segment("grid", LEFT, at, right, at)
        yield text("tick y", LEFT - 7, at + 4, tick_text(value))
    for value in nice_ticks(x.low, x.high, 10):
        at = x.pixel(value)
        yield segment("axis", at, bottom, at, bottom + 4)
        yield text("tick x", at, bottom + 17, tick_text(value))
    yield segment("axis", LEFT, bottom, right, bottom)
    yield upright_text("label", 13, 0.5 * (TOP + bottom), labels[1])
    yield text("label", 0.5 * (LEFT + right), height - 3, labels[0])


def _levels(levels: Sequence[Level], y: Scale) -> Iterator[str]:
    for level in levels:
        at = y.pixel(level.y)
        yield segment("level", LEFT, at, WIDTH - RIGHT, at)
        yield text("level-label", WIDTH - RIGHT - 4, at - 4, level.label)
