"""Plane geometry of a geofence: containment of places and of segments.

Coordinates are metres north and east of home. A place on a boundary may count for either side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from flightstack.core.contract import FloatArray, Record, RecordArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan.fence_areas import Area

AREA = np.dtype(
    [
        ("inclusion", "i8"),  # 1, or 0 for an exclusion area
        ("group", "i8"),  # of an inclusion area, from 0
        ("start", "i8"),  # vertex range [start, end)
        ("end", "i8"),
        ("north", "f8"),  # centre and radius of a circle, m; the radius of a polygon is 0
        ("east", "f8"),
        ("radius", "f8"),
    ]
)
"""An area of a geofence in kernels; vertices are in a separate array, shape (m, 2): north and east [m]."""


class FenceShape:
    """The areas of a geofence in metres.

    ``areas`` holds ``AREA`` records, shape (n,); ``vertices`` has shape (m, 2); ``groups`` is the number of groups of
    inclusion areas.
    """

    def __init__(self, areas: Sequence[Area], home: GeoPoint) -> None:
        self._home = home
        self._frame = LocalFrame(home)
        self.areas: RecordArray = np.zeros(len(areas), AREA)
        vertices: list[tuple[float, float]] = []
        names = sorted({area.group for area in areas if area.is_inclusion})
        self.groups = len(names)
        for row, area in zip(self.areas, areas, strict=True):
            row["inclusion"] = area.is_inclusion
            row["group"] = names.index(area.group) if area.is_inclusion else -1
            row["start"] = len(vertices)
            if area.radius_m:
                row["north"], row["east"] = self.local(*area.points_deg[0])
                row["radius"] = area.radius_m
            else:
                vertices += [self.local(*point) for point in area.points_deg]
            row["end"] = len(vertices)
        self.vertices: FloatArray = np.array(vertices, dtype=np.float64).reshape(-1, 2)
        self.update_edges()

    def local(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Return the place north and east of home [m]."""
        there = self._frame.to_ned(GeoPoint(latitude_deg, longitude_deg, self._home.altitude_m))
        return there.x, there.y

    def polygon(self, index: int) -> FloatArray:
        """Return the vertices of an area, shape (n, 2)."""
        row = self.areas[index]
        return self.vertices[row["start"] : row["end"]]

    def update_edges(self) -> None:
        """Compute the edges of all polygons from ``vertices``."""
        ends = [np.roll(self.polygon(index), -1, axis=0) for index in range(len(self.areas))]
        self._begins, self._ends = self.vertices, np.concatenate(ends) if ends else self.vertices

    def allowed(self, places: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Return for each of ``places``, shape (n, 2), whether the vehicle may be there."""
        in_group = np.ones((self.groups, len(places)), dtype=np.bool_)
        excluded = np.zeros(len(places), dtype=np.bool_)
        for index, row in enumerate(self.areas):
            inside = self._inside(index, places)
            if row["inclusion"]:
                in_group[row["group"]] &= inside
            else:
                excluded |= inside
        in_any = in_group.any(axis=0) if self.groups else ~np.zeros_like(excluded)
        return in_any & ~excluded

    def allows(self, north_m: float, east_m: float) -> bool:
        """Return True if the vehicle may be at this place."""
        return bool(self.allowed(np.array([[north_m, east_m]]))[0])

    def _inside(self, index: int, places: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        row = self.areas[index]
        north, east = places[:, 0], places[:, 1]
        if row["radius"]:
            inside: np.ndarray[tuple[int], np.dtype[np.bool_]] = (
                np.hypot(north - row["north"], east - row["east"]) <= row["radius"]
            )
            return inside
        inside = np.zeros(len(places), dtype=np.bool_)
        begins = self.polygon(index)
        for (n1, e1), (n2, e2) in zip(begins, np.roll(begins, -1, axis=0), strict=True):
            spans = (e1 > east) != (e2 > east)  # even-odd rule, ray to the north
            if spans.any():
                inside ^= spans & (north < n1 + (east - e1) * ((n2 - n1) / (e2 - e1)))
        return inside

    def segments_outside(self, starts: ArrayLike, stops: ArrayLike) -> list[tuple[int, tuple[float, float]]]:
        """Return the segments from ``starts`` to ``stops``, each of shape (n, 2), that leave the allowed region.

        Each is given by its row and one place on it that is not allowed.
        """
        begins, ends = np.asarray(starts, dtype=np.float64), np.asarray(stops, dtype=np.float64)
        suspects = ~(self.allowed(begins) & self.allowed(ends))
        for start in range(0, len(begins), 256):  # blocks bound the memory
            block = slice(start, start + 256)
            suspects[block] |= self._meets_boundary(begins[block], ends[block])
        found = []
        for row in np.flatnonzero(suspects):
            place = self._first_outside(begins[row], ends[row])
            if place is not None:
                found.append((int(row), place))
        return found

    def _meets_boundary(
        self, begins: FloatArray, ends: FloatArray
    ) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Return for each segment whether it may cross a boundary."""
        along = ends - begins
        meets = np.zeros(len(begins), dtype=np.bool_)
        if len(self._begins):
            t, u = _meeting(
                begins[:, None], along[:, None], self._begins[None], (self._ends - self._begins)[None]
            )
            meets |= ((t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0)).any(axis=1)
        length2 = np.maximum((along**2).sum(axis=1), 1e-12)
        for row in self.areas[self.areas["radius"] > 0.0]:
            to_centre = _centre(row) - begins
            nearest = np.clip((to_centre * along).sum(axis=1) / length2, 0.0, 1.0)
            meets |= np.hypot(*(to_centre - nearest[:, None] * along).T) <= row["radius"]
        return meets

    def _first_outside(self, begin: FloatArray, end: FloatArray) -> tuple[float, float] | None:
        """Return the first place on a segment that is not allowed, or None; tested between boundary crossings."""
        along = end - begin
        shares = [0.0, 1.0]
        if len(self._begins):
            t, u = _meeting(begin, along, self._begins, self._ends - self._begins)
            shares += t[(t > 0.0) & (t < 1.0) & (u >= 0.0) & (u <= 1.0)].tolist()
        for row in self.areas[self.areas["radius"] > 0.0]:
            shares += _circle_shares(begin - _centre(row), along, float(row["radius"]))
        shares.sort()
        middles = 0.5 * (np.array(shares[:-1]) + np.array(shares[1:]))
        places = np.concatenate([begin[None], begin + middles[:, None] * along, end[None]])
        outside = np.flatnonzero(~self.allowed(places))
        if not len(outside):
            return None
        north_m, east_m = places[outside[0]].tolist()
        return north_m, east_m


def _centre(area: Record) -> FloatArray:
    return np.array([area["north"], area["east"]])


def _meeting(
    begin: FloatArray, along: FloatArray, other_begin: FloatArray, other_along: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the fractions of two lines' lengths at their intersection; NaN or infinite for parallel lines."""
    apart = other_begin - begin
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = along[..., 0] * other_along[..., 1] - along[..., 1] * other_along[..., 0]
        t = (apart[..., 0] * other_along[..., 1] - apart[..., 1] * other_along[..., 0]) / cross
        u = (apart[..., 0] * along[..., 1] - apart[..., 1] * along[..., 0]) / cross
    return t, u


def _circle_shares(from_centre: FloatArray, along: FloatArray, radius_m: float) -> list[float]:
    """Return the fractions of a segment's length at its intersections with a circle."""
    a = float(along @ along)
    b = float(from_centre @ along)
    discriminant = b * b - a * (float(from_centre @ from_centre) - radius_m * radius_m)
    if a == 0.0 or discriminant <= 0.0:
        return []
    root = math.sqrt(discriminant)
    return [share for share in ((-b - root) / a, (-b + root) / a) if 0.0 < share < 1.0]


def edges_that_cross(vertices: FloatArray) -> tuple[int, int] | None:
    """Return the first two edges of a polygon that intersect, each by its first vertex, or None.

    Adjacent edges share a vertex and intersect only if one folds back on the other or has zero length.
    """
    count = len(vertices)
    along = np.roll(vertices, -1, axis=0) - vertices
    for first in range(count):
        for second in range(first + 1, count):
            is_next = second == first + 1
            if is_next or (first == 0 and second == count - 1):
                before, after = (first, second) if is_next else (second, first)
                if _folds_back(along[before], along[after]):
                    return first, second
            elif _segments_meet(vertices, first, second):
                return first, second
    return None


def _folds_back(before: FloatArray, after: FloatArray) -> bool:
    cross = before[0] * after[1] - before[1] * after[0]
    return bool(cross == 0.0 and before @ after <= 0.0)


def _segments_meet(vertices: FloatArray, first: int, second: int) -> bool:
    count = len(vertices)
    (ax, ay), (bx, by) = vertices[first].tolist(), vertices[(first + 1) % count].tolist()
    (cx, cy), (dx, dy) = vertices[second].tolist(), vertices[(second + 1) % count].tolist()
    if max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx):
        return False
    if max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by):
        return False
    c_side = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    d_side = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    a_side = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    b_side = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    return bool(c_side * d_side <= 0.0 and a_side * b_side <= 0.0)
