"""Items of missions, geofences and rally points for tests, in metres from a home position."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import RALLY_POINT, Command, FenceCommand, Frame, MissionItem

HOME = GeoPoint(47.397742, 8.545594, 488.0)
Place = tuple[float, float]
_WITHOUT_POSITION = (Command.NAV_DELAY, Command.CONDITION_YAW, Command.DO_JUMP, Command.DO_CHANGE_SPEED)


def degrees(place: Place, home: GeoPoint = HOME) -> tuple[float, float]:
    """Return latitude and longitude [deg] of a place north and east of home [m]."""
    point = LocalFrame(home).to_geo(Vector3(place[0], place[1], 0.0))
    return point.latitude_deg, point.longitude_deg


def item(command: int, north: float = 0.0, east: float = 0.0, z: float = 0.0, p1: float = 0.0) -> MissionItem:
    """Return a mission item at a position north and east of ``HOME`` and at an altitude above it [m]."""
    if command in _WITHOUT_POSITION:
        return MissionItem(command, Frame.MISSION, p1)
    x, y = (round(angle * 1e7) for angle in degrees((north, east)))
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT_INT, p1, 0.0, 0.0, math.nan, x, y, z)


def _item(
    command: int, point: tuple[float, float], *params: float, frame: int = Frame.GLOBAL, z: float = 0.0
):
    param1, param2 = (*params, 0.0, 0.0)[:2]
    x, y = round(point[0] * 1e7), round(point[1] * 1e7)
    return MissionItem(command, frame, param1, param2, 0.0, 0.0, x, y, z)


def vertex_items(
    command: int, points_deg: Sequence[tuple[float, float]], group: float = 0.0
) -> list[MissionItem]:
    """Return the items of a polygon."""
    return [_item(command, point, float(len(points_deg)), group) for point in points_deg]


def polygon(
    places: Sequence[Place], inclusion: bool = True, group: float = 0.0, home: GeoPoint = HOME
) -> list[MissionItem]:
    """Return the items of a polygon of places north and east of home [m]."""
    command = FenceCommand.POLYGON_VERTEX_INCLUSION if inclusion else FenceCommand.POLYGON_VERTEX_EXCLUSION
    return vertex_items(command, [degrees(place, home) for place in places], group)


def circle(
    centre: Place, radius_m: float, inclusion: bool = True, group: float = 0.0, home: GeoPoint = HOME
) -> MissionItem:
    """Return the item of a circle."""
    command = FenceCommand.CIRCLE_INCLUSION if inclusion else FenceCommand.CIRCLE_EXCLUSION
    return _item(command, degrees(centre, home), radius_m, group)


def return_point(place: Place, altitude_m: float = 10.0) -> MissionItem:
    """Return the return point of a geofence."""
    return _item(FenceCommand.RETURN_POINT, degrees(place), frame=Frame.GLOBAL_RELATIVE_ALT, z=altitude_m)


def rally_point(place: Place, altitude_m: float = 0.0, home: GeoPoint = HOME) -> MissionItem:
    """Return a rally point."""
    return _item(RALLY_POINT, degrees(place, home), frame=Frame.GLOBAL_RELATIVE_ALT, z=altitude_m)


def square(half_m: float, at: Place = (0.0, 0.0)) -> list[Place]:
    """Return the corners of a square."""
    north, east = at
    return [(north + half_m * n, east + half_m * e) for n, e in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
