"""Mission validation, by the vehicle on upload and by the ground station before it.

Pure. Items are numbered from 0, as in MAVLink.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import distance
from flightstack.plan.commands import (
    GLOBAL_FRAMES,
    MAX_MISSION_ITEMS,
    NAV_COMMANDS,
    OPEN_POSITION_COMMANDS,
    POSITION_COMMANDS,
    Command,
    Frame,
    MissionResult,
)
from flightstack.plan.item import MissionItem
from flightstack.plan.jumps import find_idle_loop
from flightstack.plan.parameter_rules import parameter_fault
from flightstack.plan.rejection import Fault, Rejection, item_rejection, range_fault

if TYPE_CHECKING:
    from flightstack.plan.fence_shape import FenceShape  # needs NumPy

_ALTITUDE_TOLERANCE_M = 0.01  # a float32 altitude above sea level has a resolution of half a millimetre


class Limits(NamedTuple):
    """Limits of a mission, with PX4's parameters in brackets. Zero or less: no limit."""

    max_first_distance_m: float = 10_000.0
    """Horizontal distance from home to the first position [MIS_DIST_1WP]."""
    max_distance_m: float = 10_000.0
    """Horizontal distance from one position to the next [MIS_DIST_WPS]."""
    max_altitude_m: float = 500.0
    """Altitude above home [GF_MAX_VER_DIST]."""
    max_home_distance_m: float = 0.0
    """Horizontal distance from home [GF_MAX_HOR_DIST]."""
    min_takeoff_altitude_m: float = 0.3
    """Minimum takeoff altitude above home: below it the land detector would detect a landing."""
    max_items: int = MAX_MISSION_ITEMS


DEFAULT_LIMITS = Limits()


def check_mission(
    items: Sequence[MissionItem],
    home: GeoPoint,
    limits: Limits = DEFAULT_LIMITS,
    fence: FenceShape | None = None,
) -> Rejection | None:
    """Return the rejection of a mission, or None if it is valid.

    All positions and the straight legs between them must be inside ``fence``.
    """
    return next(mission_rejections(items, home, limits, fence), None)


def mission_rejections(
    items: Sequence[MissionItem],
    home: GeoPoint,
    limits: Limits = DEFAULT_LIMITS,
    fence: FenceShape | None = None,
) -> Iterator[Rejection]:
    """Yield the rejections of a mission; the first one is ``check_mission``'s.

    Faults of single items come first. If there is one, loops, distances and the geofence are not checked.
    """
    if len(items) > limits.max_items:
        reason = f"the mission has {len(items)} items, and at most {limits.max_items} are allowed"
        yield Rejection(MissionResult.NO_SPACE, None, reason)
        return
    is_bad = False
    for seq, item in enumerate(items):
        fault = _item_fault(item, seq, len(items)) or _altitude_fault(item, home, limits)
        if fault:
            is_bad = True
            yield item_rejection(seq, item, fault)
    if is_bad:
        return
    if not any(item.command in NAV_COMMANDS for item in items):
        reason = "the mission has no item to fly to (takeoff, waypoint, loiter, land or return)"
        yield Rejection(MissionResult.INVALID, None, reason)
    loop = find_idle_loop(items)
    if loop is not None:
        fault = Fault(MissionResult.INVALID_PARAM1, "jumps in a loop that holds no item to fly")
        yield item_rejection(loop, items[loop], fault)
    yield from _distance_rejections(items, home, limits)
    yield from leg_rejections(items, home, fence)


def _item_fault(item: MissionItem, seq: int, count: int) -> Fault | None:
    """Return the fault of one item, regardless of the others."""
    if item.command not in Command.__members__.values():
        supported = ", ".join(f"{command.value} {command.name}" for command in Command)
        return Fault(MissionResult.UNSUPPORTED, f"is not supported; supported are {supported}")
    if item.frame not in Frame.__members__.values():
        frames = ", ".join(f"{frame.value} {frame.name}" for frame in Frame)
        return Fault(MissionResult.UNSUPPORTED_FRAME, f"frame {item.frame} is not one of {frames}")
    if item.command in POSITION_COMMANDS and item.frame not in GLOBAL_FRAMES:
        return Fault(MissionResult.UNSUPPORTED_FRAME, "needs a global frame (0, 3, 5 or 6), not MISSION")
    return parameter_fault(item, seq, count) or _position_fault(item)


def _position_fault(item: MissionItem) -> Fault | None:
    if item.command not in POSITION_COMMANDS:
        return None
    if item.position_deg is None:
        if item.command in OPEN_POSITION_COMMANDS:
            return None
        return Fault(MissionResult.INVALID_PARAM5_X, "latitude and longitude must be given")
    return range_fault(*item.position_deg)


def _altitude_fault(item: MissionItem, home: GeoPoint, limits: Limits) -> Fault | None:
    """Return the fault of an item's altitude. A landing ends on the ground: any altitude is valid."""
    if item.command not in POSITION_COMMANDS or item.command == Command.NAV_LAND:
        return None
    if math.isnan(item.z):
        if item.command in OPEN_POSITION_COMMANDS:
            return None
        return Fault(MissionResult.INVALID_PARAM7, "altitude must be given")
    above_home_m = item.z if item.altitude_is_relative else item.z - home.altitude_m
    low_m = limits.min_takeoff_altitude_m if item.command == Command.NAV_TAKEOFF else 0.0
    high_m = limits.max_altitude_m if limits.max_altitude_m > 0.0 else math.inf
    if not low_m - _ALTITUDE_TOLERANCE_M <= above_home_m <= high_m + _ALTITUDE_TOLERANCE_M:
        reason = f"altitude {above_home_m:g} m above home is outside {low_m:g} to {high_m:g} m"
        return Fault(MissionResult.INVALID_PARAM7, reason)
    return None


def _distance_rejections(items: Sequence[MissionItem], home: GeoPoint, limits: Limits) -> Iterator[Rejection]:
    frame = LocalFrame(home)
    north_m, east_m = 0.0, 0.0
    limit_m, start = limits.max_first_distance_m, "home"
    for seq, item in enumerate(items):
        if item.position_deg is None:
            continue
        there = frame.to_ned(GeoPoint(*item.position_deg, home.altitude_m))
        distance_m = distance(there.x - north_m, there.y - east_m)
        if limit_m > 0.0 and distance_m > limit_m:
            reason = f"is {distance_m:.0f} m from {start}, and at most {limit_m:g} m are allowed"
            yield item_rejection(seq, item, Fault(MissionResult.INVALID, reason))
        elif 0.0 < limits.max_home_distance_m < (from_home_m := distance(there.x, there.y)):
            reason = (
                f"is {from_home_m:.0f} m from home, and at most {limits.max_home_distance_m:g} m are allowed"
            )
            yield item_rejection(seq, item, Fault(MissionResult.INVALID, reason))
        north_m, east_m = there.x, there.y
        limit_m, start = limits.max_distance_m, "the position before it"


Place = tuple[float, float]


class Leg(NamedTuple):
    """A straight leg between two places, north and east of the geofence's origin [m]."""

    begin: Place
    end: Place
    seq: int
    """Number of the item at the end."""
    start: str
    """Description of the start position."""


def mission_legs(items: Sequence[MissionItem], home: Place, shape: FenceShape) -> list[Leg]:
    """Return the legs from home through all positions, with jumps; a return ends at home."""
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
    """Return the rejection of the first item that is outside ``fence`` or whose leg leaves it, or None."""
    return next(leg_rejections(items, home, fence), None)


def leg_rejections(
    items: Sequence[MissionItem], home: GeoPoint, fence: FenceShape | None
) -> Iterator[Rejection]:
    """Yield the rejections of the items that are outside ``fence`` or whose leg leaves it."""
    if fence is None or not len(fence.areas):
        return
    home_ne_m = fence.local(home.latitude_deg, home.longitude_deg)
    legs = mission_legs(items, home_ne_m, fence)
    if not legs:
        return
    for index, place in fence.segments_outside([leg.begin for leg in legs], [leg.end for leg in legs]):
        leg = legs[index]
        if not fence.allows(*leg.end):
            reason = "is outside the geofence"
        else:
            north_m, east_m = place[0] - home_ne_m[0], place[1] - home_ne_m[1]
            reason = f"the way from {leg.start} to it leaves the geofence"
            reason += f", {north_m:.0f} m north and {east_m:.0f} m east of home"
        yield item_rejection(leg.seq, items[leg.seq], Fault(MissionResult.INVALID, reason))
