"""A path in space as SVG text: seen from the south-east and above, with its shadow on the ground. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.report.svg import multiples, nice_ticks, polyline, segment, text, tick_text

_WIDTH, _HEIGHT, _MARGIN = 480, 330, 42
_TURN, _TILT = math.radians(35.0), math.radians(24.0)
_POINTS = 900
_EVERY_M_OF_A_STALK = 1.0


class Path(NamedTuple):
    """A path with the class of its style."""

    label: str
    ned_m: FloatArray
    """Shape (n, 3)."""
    style: str


class _View(NamedTuple):
    scale: float
    x: float
    y: float


def space_chart(name: str, paths: Sequence[Path]) -> str:
    """Return the picture: metres are equally long along all axes as far as a parallel projection goes."""
    points = np.concatenate([path.ned_m[np.isfinite(path.ned_m).all(axis=1)] for path in paths])
    if not len(points):
        return '<p class="none">No data.</p>'
    low, high = _box(points)
    view = _view(low, high)
    return "".join(
        (
            f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(name)}">',
            *_floor(low, high, view),
            *(part for path in paths for part in _path(path, view)),
            "</svg>",
        )
    )


def _box(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Corners, in north, east and height, that hold the points, end at whole metres and stand on the ground."""
    heights = np.column_stack((points[:, :2], -points[:, 2]))
    low, high = np.floor(heights.min(axis=0) + 1e-9), np.ceil(heights.max(axis=0) - 1e-9)
    low[2] = min(low[2], 0.0)
    return low, np.maximum(high, low + 1.0)


def _flat(points: FloatArray) -> FloatArray:
    """Project north, east and height, shape (n, 3), to right and up, shape (n, 2), in metres."""
    north, east, height = points.T
    right = math.cos(_TURN) * east + math.sin(_TURN) * north
    away = math.cos(_TURN) * north - math.sin(_TURN) * east
    return np.column_stack((right, math.sin(_TILT) * away + math.cos(_TILT) * height))


def _view(low: FloatArray, high: FloatArray) -> _View:
    corners = _flat(
        np.array([[n, e, h] for n in (low[0], high[0]) for e in (low[1], high[1]) for h in (low[2], high[2])])
    )
    least, most = corners.min(axis=0), corners.max(axis=0)
    scale = min((_WIDTH - 2 * _MARGIN) / (most[0] - least[0]), (_HEIGHT - 2 * _MARGIN) / (most[1] - least[1]))
    middle = 0.5 * (least + most)
    return _View(scale, 0.5 * _WIDTH - scale * middle[0], 0.5 * _HEIGHT + scale * middle[1])


def _pixels(points: FloatArray, view: _View) -> FloatArray:
    flat = _flat(points)
    return np.column_stack((view.x + view.scale * flat[:, 0], view.y - view.scale * flat[:, 1]))


def _line(style: str, a: Sequence[float], b: Sequence[float], view: _View) -> str:
    (x1, y1), (x2, y2) = _pixels(np.array([a, b], np.float64), view).tolist()
    return segment(style, x1, y1, x2, y2)


def _floor(low: FloatArray, high: FloatArray, view: _View) -> Iterator[str]:
    ground = float(low[2])
    step = _step(low, high)
    for north in multiples(step, low[0], high[0]):
        yield _line("grid", (north, low[1], ground), (north, high[1], ground), view)
        yield _label(tick_text(north), (north, high[1], ground), view, (8.0, 12.0))
    for east in multiples(step, low[1], high[1]):
        yield _line("grid", (low[0], east, ground), (high[0], east, ground), view)
        yield _label(tick_text(east), (low[0], east, ground), view, (-6.0, 15.0))
    for height in multiples(step, ground, high[2]):
        yield _line("grid", (high[0], low[1], height), (high[0], high[1], height), view)
        yield _line("grid", (high[0], low[1], height), (low[0], low[1], height), view)
        yield _label(tick_text(height), (low[0], low[1], height), view, (-12.0, 4.0))
    for north, east in ((high[0], low[1]), (low[0], low[1]), (high[0], high[1])):
        yield _line("grid", (north, east, ground), (north, east, high[2]), view)
    yield _label("north [m]", (0.5 * (low[0] + high[0]), high[1], ground), view, (46.0, 26.0))
    yield _label("east [m]", (low[0], 0.5 * (low[1] + high[1]), ground), view, (-20.0, 34.0))
    yield _label("height [m]", (low[0], low[1], high[2]), view, (-4.0, -12.0))


def _step(low: FloatArray, high: FloatArray) -> float:
    ticks = nice_ticks(0.0, float((high - low).max()), 5)
    return ticks[1] - ticks[0] if len(ticks) > 1 else 1.0


def _label(content: str, at: Sequence[float], view: _View, offset: tuple[float, float]) -> str:
    x, y = _pixels(np.array([at], np.float64), view)[0].tolist()
    return text("label", x + offset[0], y + offset[1], content)


def _path(path: Path, view: _View) -> Iterator[str]:
    points = np.column_stack((path.ned_m[:, :2], -path.ned_m[:, 2]))
    points = points[np.isfinite(points).all(axis=1)]
    points = points[:: 1 + len(points) // _POINTS]
    shadow = _pixels(points * (1.0, 1.0, 0.0), view)
    yield polyline(shadow[:, 0], shadow[:, 1], "shadow")
    flown = _pixels(points, view)
    yield f"<g><title>{escape(path.label)}</title>{polyline(flown[:, 0], flown[:, 1], path.style)}</g>"
