"""Validation of rally points."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.core.geodesy import GeoPoint
from flightstack.core.portable_math import distance
from flightstack.plan.check import DEFAULT_LIMITS, Limits
from flightstack.plan.commands import MAX_RALLY_POINTS, RALLY_POINT, MissionResult
from flightstack.plan.fence_shape import FenceShape
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Fault, Rejection, item_rejection, place_fault


def check_rally(
    items: Sequence[MissionItem],
    home: GeoPoint,
    limits: Limits = DEFAULT_LIMITS,
    fence: FenceShape | None = None,
) -> Rejection | None:
    """Return the rejection of a list of rally points, or None if it is valid."""
    if len(items) > MAX_RALLY_POINTS:
        reason = f"there are {len(items)} rally points, and at most {MAX_RALLY_POINTS} are allowed"
        return Rejection(MissionResult.NO_SPACE, None, reason)
    shape = fence or FenceShape((), home)
    for seq, item in enumerate(items):
        fault = _fault(item, home, limits, shape)
        if fault is not None:
            return item_rejection(seq, item, fault)
    return None


def _fault(item: MissionItem, home: GeoPoint, limits: Limits, shape: FenceShape) -> Fault | None:
    if item.command != RALLY_POINT:
        return Fault(MissionResult.UNSUPPORTED, f"is not a rally point ({RALLY_POINT})")
    return (
        place_fault(item) or _altitude_fault(item, home, limits) or _distance_fault(item, home, limits, shape)
    )


def _altitude_fault(item: MissionItem, home: GeoPoint, limits: Limits) -> Fault | None:
    if not math.isfinite(item.z):
        return Fault(MissionResult.INVALID_PARAM7, "altitude must be given")
    above_home_m = rally_altitude_m(item, home)
    high_m = limits.max_altitude_m if limits.max_altitude_m > 0.0 else math.inf
    if abs(above_home_m) <= high_m:
        return None
    reason = f"altitude {above_home_m:g} m above home is outside {-high_m:g} to {high_m:g} m"
    return Fault(MissionResult.INVALID_PARAM7, reason)


def _distance_fault(item: MissionItem, home: GeoPoint, limits: Limits, shape: FenceShape) -> Fault | None:
    assert item.position_deg is not None  # checked by place_fault
    north_m, east_m = shape.local(*item.position_deg)
    home_north_m, home_east_m = shape.local(home.latitude_deg, home.longitude_deg)
    distance_m, far_m = distance(north_m - home_north_m, east_m - home_east_m), limits.max_home_distance_m
    if 0.0 < far_m < distance_m:
        reason = f"is {distance_m:.0f} m from home, and at most {far_m:g} m are allowed"
        return Fault(MissionResult.INVALID, reason)
    return None if shape.allows(north_m, east_m) else Fault(MissionResult.INVALID, "is outside the geofence")


def rally_altitude_m(item: MissionItem, home: GeoPoint) -> float:
    """Return the altitude of a rally point above home [m]."""
    return item.z if item.altitude_is_relative else item.z - home.altitude_m
