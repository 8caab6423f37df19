"""Destination of a return: home or a rally point."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import distance
from flightstack.plan import MissionItem
from flightstack.plan.rally import rally_altitude_m

NEAREST, RALLY_FIRST = 0, 1
"""Values of RTL_TYPE, as in PX4: the nearest of home and rally points, or the nearest rally point if there is one.

PX4's other values need a landing pattern in the mission.
"""


class ReturnPlace(NamedTuple):
    """Destination of a return: north, east and altitude above the local frame's origin [m].

    The altitude is that of the ground. As in PX4, a return to a rally point flies RTL_RETURN_ALT above it.
    """

    north_m: float
    east_m: float
    altitude_m: float


HOME = ReturnPlace(0.0, 0.0, 0.0)


def rally_points(items: Iterable[MissionItem], frame: LocalFrame, home: GeoPoint) -> tuple[ReturnPlace, ...]:
    """Return the rally points from items that ``plan.check_rally`` accepted; relative altitudes refer to home."""
    home_m = home.altitude_m - frame.origin.altitude_m
    points = []
    for item in items:
        if item.position_deg is not None:
            local = frame.to_ned(GeoPoint(*item.position_deg, frame.origin.altitude_m))
            points.append(ReturnPlace(local.x, local.y, home_m + rally_altitude_m(item, home)))
    return tuple(points)


def choose(
    position_ne_m: tuple[float, float], home: ReturnPlace, points: Sequence[ReturnPlace], return_type: float
) -> ReturnPlace:
    """Return the destination of a return from ``position_ne_m``; at equal distance home, then the first point."""
    candidates = list(points) if return_type == RALLY_FIRST and points else [home, *points]
    north_m, east_m = position_ne_m
    return min(candidates, key=lambda place: distance(place.north_m - north_m, place.east_m - east_m))
