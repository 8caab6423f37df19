"""Curves and marks of a chart of two free axes as SVG text, thinned so that no peak is lost. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.report.chart import Line, decimated, finite_runs
from gcs_cli.report.svg import Scale, circle, polyline

_BUCKETS_PER_PIXEL = 0.6  # two points each
_CROSS = 4.0


_SHAPES = {
    "s2": "M0,-5v10M-5,0h10",  # plus
    "s3": "M0,-5l4,5l-4,5l-4,-5z",  # diamond
    "s4": "M-4,-4h8v8h-8z",  # square
    "s5": "M0,-5l4.8,8.4h-9.6z",  # triangle
    "s6": "M-4.5,0a4.5,4.5,0,1,0,9,0a4.5,4.5,0,1,0,-9,0",  # circle
}
"""By style, around the point; a cross for the others. They let see what lies on top of each other."""


class Mark(NamedTuple):
    """A point, pointing at which shows ``hint``: a cross, a dot where ``dot``."""

    x: float
    y: float
    style: str
    hint: str = ""
    dot: bool = False
    own_shape: bool = False
    """Drawn in the shape of its style in place of a cross."""


class Frame(NamedTuple):
    """Where values of both axes lie in the picture."""

    x: Scale
    y: Scale


def curve(line: Line, frame: Frame) -> Iterator[str]:
    """Yield the curve, without gaps' ends joined; it ends with a cross where it leaves the axes."""
    x, y, left_at = _until_it_leaves(line, frame)
    buckets = int(_BUCKETS_PER_PIXEL * (frame.x.end - frame.x.start))
    yield f"<g><title>{escape(line.label)}</title>"
    for run_x, run_y in finite_runs(x, y):
        kept_x, kept_y = _thinned(run_x, run_y, frame, buckets)
        yield polyline(frame.x.pixels(kept_x), frame.y.pixels(kept_y), line.style)
    if left_at is not None:
        yield drawn_mark(Mark(*left_at, line.style, f"{line.label}: leaves the picture"), frame)
    yield "</g>"


def _thinned(x: FloatArray, y: FloatArray, frame: Frame, buckets: int) -> tuple[FloatArray, FloatArray]:
    """Keep the extremes where x rises; of a path that turns, the points that move by half a pixel or more."""
    if np.all(np.diff(x) >= 0.0):
        return decimated(x, y, buckets)
    pixels = np.round(2.0 * np.column_stack((frame.x.pixels(x), frame.y.pixels(y))))
    moved = np.concatenate(([True], (np.diff(pixels, axis=0) != 0.0).any(axis=1)))
    moved[-1] = True
    return x[moved], y[moved]


def _until_it_leaves(line: Line, frame: Frame) -> tuple[FloatArray, FloatArray, tuple[float, float] | None]:
    within = (
        (line.x >= frame.x.low)
        & (line.x <= frame.x.high)
        & (line.y >= frame.y.low)
        & (line.y <= frame.y.high)
    ) | ~(np.isfinite(line.x) & np.isfinite(line.y))
    if within.all():
        return line.x, line.y, None
    end = int(np.argmin(within))
    last = (float(line.x[end - 1]), float(line.y[end - 1])) if end and np.isfinite(line.y[end - 1]) else None
    return line.x[:end], line.y[:end], last


def inside(mark: Mark, frame: Frame) -> bool:
    """Tell whether a mark lies between the ends of both axes."""
    return frame.x.low <= mark.x <= frame.x.high and frame.y.low <= mark.y <= frame.y.high


def drawn_mark(mark: Mark, frame: Frame) -> str:
    """Return a cross or a dot at its place."""
    x, y = frame.x.pixel(mark.x), frame.y.pixel(mark.y)
    if mark.dot:
        return circle(f"dot {mark.style}", x, y, 3.5, mark.hint)
    title = f"<title>{escape(mark.hint)}</title>" if mark.hint else ""
    shape = _SHAPES.get(mark.style) if mark.own_shape else None
    if shape is not None:
        place = f"translate({x:.1f} {y:.1f})"
        return f'<path class="cross {mark.style}" transform="{place}" d="{shape}">{title}</path>'
    d = f"M{x - _CROSS:.1f},{y - _CROSS:.1f}l{2 * _CROSS},{2 * _CROSS}m0,{-2 * _CROSS}l{-2 * _CROSS},{2 * _CROSS}"
    return f'<path class="cross {mark.style}" d="{d}">{title}</path>'
