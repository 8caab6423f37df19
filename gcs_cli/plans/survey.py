"""Parallel lines over a polygon, flown to and fro: boustrophedon cellular decomposition. Pure.

Choset, "Coverage of Known Spaces: The Boustrophedon Cellular Decomposition", Autonomous Robots 9 (2000).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray

MOST_LINES = 2000


class _Segment(NamedTuple):
    """A part of a line inside the polygon: its place across the lines, and its ends along them [m]."""

    across: float
    begin: float
    end: float


_Cell: TypeAlias = list[_Segment]


def survey(rings_m: Sequence[FloatArray], spacing_m: float, angle_deg: float) -> FloatArray:
    """Return lines ``spacing_m`` apart over a polygon, in the direction ``angle_deg`` from north.

    ``rings_m``: the outline and the holes, each of shape (n, 2), north and east. The outer lines lie at most half a
    spacing inside the outline. Each cell of the polygon is flown as a whole; ways between cells may cross a hole or
    leave the polygon. Raise ValueError if no line crosses the polygon, or for more than MOST_LINES lines.
    """
    angle = math.radians(angle_deg)
    along, across = (
        np.array([math.cos(angle), math.sin(angle)]),
        np.array([-math.sin(angle), math.cos(angle)]),
    )
    rings = [np.column_stack((ring @ along, ring @ across)) for ring in rings_m]
    cells = _cells(rings, spacing_m)
    if not cells:
        raise ValueError("the area is too narrow for a line")
    path = np.array(_ordered(cells))
    return np.asarray(path[:, :1] * along + path[:, 1:] * across)


def _cells(rings: Sequence[FloatArray], spacing_m: float) -> list[_Cell]:
    """Return the cells: runs of overlapping segments on consecutive lines, each with one neighbour on either side."""
    low, high = float(rings[0][:, 1].min()), float(rings[0][:, 1].max())
    count = max(1, math.ceil((high - low) / spacing_m - 1e-9))
    if count > MOST_LINES:
        raise ValueError(
            f"{count} lines are needed, and at most {MOST_LINES} are allowed: increase the spacing"
        )
    step = (high - low) / count
    cells: list[_Cell] = []
    opened: list[_Cell] = []
    for index in range(count):
        segments = _segments(rings, low + (index + 0.5) * step)
        still: list[_Cell] = []
        for segment in segments:
            before = [cell for cell in opened if _overlap(cell[-1], segment)]
            beside = [other for other in segments if before and _overlap(before[0][-1], other)]
            if len(before) == 1 and len(beside) == 1:
                before[0].append(segment)
                still.append(before[0])
            else:
                cells.append([segment])
                still.append(cells[-1])
        opened = still
    return cells


def _segments(rings: Sequence[FloatArray], across: float) -> list[_Segment]:
    """Return the parts of a line inside, by the even-odd rule."""
    crossings: list[float] = []
    for ring in rings:
        for (a0, c0), (a1, c1) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            if (c0 > across) != (c1 > across):
                crossings.append(float(a0 + (across - c0) * (a1 - a0) / (c1 - c0)))
    crossings.sort()
    return [_Segment(across, *ends) for ends in zip(crossings[::2], crossings[1::2], strict=True)]


def _overlap(one: _Segment, other: _Segment) -> bool:
    return one.begin < other.end and other.begin < one.end


def _ordered(cells: list[_Cell]) -> list[tuple[float, float]]:
    """Return the places of all cells, the nearest next; a cell may begin at any of its four ends."""
    path: list[tuple[float, float]] = []
    left = [*cells]
    while left:
        ways = [(index, way) for index, cell in enumerate(left) for way in _ways(cell)]
        index, way = ways[0] if not path else min(ways, key=lambda entry: math.dist(path[-1], entry[1][0]))
        path += way
        del left[index]
    return path


def _ways(cell: _Cell) -> list[list[tuple[float, float]]]:
    """Return the four ways to fly a cell: from its first or last line, from either end."""
    ways = []
    for lines in (cell, cell[::-1]):
        for starts_at_end in (False, True):
            way: list[tuple[float, float]] = []
            for index, line in enumerate(lines):
                ends = [(line.begin, line.across), (line.end, line.across)]
                way += ends[::-1] if (index % 2 == 1) != starts_at_end else ends
            ways.append(way)
    return ways
