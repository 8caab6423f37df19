"""The straight ways that a mission flies, and whether one of them leaves the geofence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.geodesy import GeoPoint
from flightstack.plan.fence_shape import FenceShape
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Fault, Rejection, item_rejection
from flightstack.plan.vocabulary import Command, MissionResult

Place = tuple[float, float]


class Leg(NamedTuple):
    """A straight way from one place to another, north and east of the geofence's origin [m]."""

    begin: Place
    end: Place
    seq: int
    """Number of the item at its end."""
    start: str
    """Where it begins, in words."""


def mission_legs(items: Sequence[MissionItem], home: Place, shape: FenceShape) -> list[Leg]:
    """Return the ways from home through all positions, by jumps too; a return goes to home."""
    places: list[Place | None] = []
    for item in items:
        position = item.position_deg
        place = None if position is None else shape.local(*position)
        places.append(home if item.command == Command.NAV_RETURN_TO_LAUNCH else place)
    legs: list[Leg] = []
    here, start = home, "home"
    for seq, item in enumerate(items):
        if item.command == Command.DO_JUMP and item.param2 != 0.0:
            target = next((after for after in range(int(item.param1), len(items)) if places[after]), None)
            there = None if target is None else places[target]
            if there is not None and target is not None:
                legs.append(Leg(here, there, target, start))
        there = places[seq]
        if there is not None:
            legs.append(Leg(here, there, seq, start))
            here, start = there, f"item {seq}"
    return legs


def leg_rejection(items: Sequence[MissionItem], home: GeoPoint, fence: FenceShape | None) -> Rejection | None:
    """Return the rejection of the first item outside ``fence``, or the way to which leaves it."""
    if fence is None or not len(fence.areas):
        return None
    home_ne_m = fence.local(home.latitude_deg, home.longitude_deg)
    legs = mission_legs(items, home_ne_m, fence)
    if not legs:
        return None
    outside = fence.ways_out(np.array([leg.begin for leg in legs]), np.array([leg.end for leg in legs]))
    if not outside:
        return None
    index, place = outside[0]
    leg = legs[index]
    if not fence.allows(*leg.end):
        fault = Fault(MissionResult.INVALID, "is outside the geofence")
    else:
        way = f"the way from {leg.start} to it leaves the geofence"
        north_m, east_m = place[0] - home_ne_m[0], place[1] - home_ne_m[1]
        fault = Fault(MissionResult.INVALID, f"{way}, {north_m:.0f} m north and {east_m:.0f} m east of home")
    return item_rejection(leg.seq, items[leg.seq], fault)
