"""Missions of a pattern: square, circle, lemniscate, corridor and survey. Pure.

Places are metres north and east of an origin, shape (n, 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Command, Frame, MissionItem
from flightstack.plan.item import integer_coordinate

Ending: TypeAlias = Literal["return", "land", "none"]
NAN = math.nan


class Route(NamedTuple):
    """Speed, height and stops along a pattern."""

    altitude_m: float = 5.0
    """Above home."""
    speed_m_s: float | None = None
    """None: the vehicle's cruise speed."""
    acceptance_m: float = 0.5
    laps: int = 1
    ending: Ending = "return"


def square(side_m: float) -> FloatArray:
    """Return the corners of a square that begins at the origin and extends north and east."""
    return np.array([[0.0, 0.0], [side_m, 0.0], [side_m, side_m], [0.0, side_m], [0.0, 0.0]])


def circle(diameter_m: float, points: int) -> FloatArray:
    """Return a circle around the origin, clockwise from the north and closed."""
    angles = np.linspace(0.0, 2.0 * math.pi, points + 1)
    return 0.5 * diameter_m * np.column_stack((np.cos(angles), np.sin(angles)))


def lemniscate(width_m: float, points: int) -> FloatArray:
    """Return Bernoulli's lemniscate, a figure of eight of ``width_m`` from west to east, from the origin and closed."""
    angles = np.linspace(0.5 * math.pi, 2.5 * math.pi, points + 1)
    share = 0.5 * width_m / (1.0 + np.sin(angles) ** 2)
    return np.column_stack((share * np.sin(angles) * np.cos(angles), share * np.cos(angles)))


def corridor(centre_m: FloatArray, width_m: float, spacing_m: float) -> FloatArray:
    """Return parallel passes along a line, ``spacing_m`` apart at most, in alternating directions.

    The outer passes lie half a spacing inside the corridor's edges.
    """
    count = max(1, math.ceil(width_m / spacing_m - 1e-9))
    offsets = (np.arange(count) - 0.5 * (count - 1)) * (width_m / count)
    passes = [_offset(centre_m, float(offset)) for offset in offsets]
    return np.concatenate([each[::-1] if index % 2 else each for index, each in enumerate(passes)])


def _offset(line_m: FloatArray, offset_m: float) -> FloatArray:
    """Return a line moved to its right by ``offset_m``, with mitred corners of four times the offset at most."""
    along = np.diff(line_m, axis=0)
    lengths = np.hypot(along[:, 0], along[:, 1])
    line_m, along = line_m[np.r_[True, lengths > 0.0]], along[lengths > 0.0]
    unit = along / lengths[lengths > 0.0, None]
    right = np.column_stack((-unit[:, 1], unit[:, 0]))
    before, after = np.vstack((right[:1], right)), np.vstack((right, right[-1:]))
    mitre = before + after
    scale = np.minimum(2.0 / np.maximum((mitre**2).sum(axis=1), 1e-12), 2.0)
    return np.asarray(line_m + offset_m * scale[:, None] * mitre)


def pattern_items(
    places_m: FloatArray, origin: GeoPoint, home: GeoPoint, route: Route
) -> tuple[MissionItem, ...]:
    """Return the mission that takes off at home, flies ``places_m`` from ``origin``, and ends as ``route`` says."""
    frame = LocalFrame(origin)
    takeoff = _item(Command.NAV_TAKEOFF, home, route.altitude_m, 0.0)
    items = [takeoff]
    if route.speed_m_s is not None:
        items.append(MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, 1.0, route.speed_m_s, -1.0))
    first = len(items)
    for north_m, east_m in _distinct(places_m):
        there = frame.to_geo(Vector3(north_m, east_m, 0.0))
        items.append(_item(Command.NAV_WAYPOINT, there, route.altitude_m, route.acceptance_m))
    if route.laps > 1:
        items.append(MissionItem(Command.DO_JUMP, Frame.MISSION, float(first), float(route.laps - 1)))
    if route.ending == "return":
        items.append(MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION))
    elif route.ending == "land":
        items.append(_item(Command.NAV_LAND, home, 0.0, 0.0))
    return tuple(items)


def _distinct(places_m: FloatArray) -> list[tuple[float, float]]:
    places = [(float(north), float(east)) for north, east in places_m]
    return [
        place for index, place in enumerate(places) if not index or math.dist(place, places[index - 1]) > 1e-3
    ]


def _item(command: Command, place: GeoPoint, altitude_m: float, acceptance_m: float) -> MissionItem:
    x, y = (integer_coordinate(value, is_global=True) for value in place[:2])
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT, 0.0, acceptance_m, 0.0, NAN, x, y, altitude_m)


def local_m(points_deg: Sequence[tuple[float, float]], origin: GeoPoint) -> FloatArray:
    """Return points of latitude and longitude as metres north and east of ``origin``."""
    frame = LocalFrame(origin)
    places = [frame.to_ned(GeoPoint(*point, origin.altitude_m)) for point in points_deg]
    return np.array([(place.x, place.y) for place in places]).reshape(-1, 2)
