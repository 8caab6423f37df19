"""Validation of geofences."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.core.geodesy import GeoPoint
from flightstack.plan.commands import MAX_FENCE_ITEMS, MissionResult
from flightstack.plan.fence_areas import FenceAreas, fence_areas
from flightstack.plan.fence_shape import FenceShape, edges_that_cross
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Fault, Rejection, item_rejection

MIN_AREA_M2 = 1.0


def fence_shape(items: Sequence[MissionItem], home: GeoPoint) -> FenceShape:
    """Return the shape, in metres from ``home``, of a valid geofence, or an empty shape."""
    parsed = fence_areas(items)
    return FenceShape((), home) if isinstance(parsed, Rejection) else FenceShape(parsed.areas, home)


def check_fence(
    items: Sequence[MissionItem], home: GeoPoint, vehicle_ne_m: tuple[float, float] | None = None
) -> Rejection | None:
    """Return the rejection of a geofence, or None if it is valid.

    ``vehicle_ne_m`` is the position of a flying vehicle, north and east of home. As in PX4, a geofence that it would
    breach is refused.
    """
    if len(items) > MAX_FENCE_ITEMS:
        reason = f"the geofence has {len(items)} items, and at most {MAX_FENCE_ITEMS} are allowed"
        return Rejection(MissionResult.NO_SPACE, None, reason)
    parsed = fence_areas(items)
    if isinstance(parsed, Rejection):
        return parsed
    shape = FenceShape(parsed.areas, home)
    for index, area in enumerate(parsed.areas):
        flaw = None if area.radius_m else _polygon_flaw(shape, index)
        if flaw is not None:
            fault = Fault(MissionResult.INVALID, flaw)
            return item_rejection(area.seq, items[area.seq], fault)
    return _place_rejection(shape, parsed, vehicle_ne_m)


def _polygon_flaw(shape: FenceShape, index: int) -> str | None:
    vertices = shape.polygon(index)
    crossing = edges_that_cross(vertices)
    if crossing is not None:
        one, other = crossing
        return f"the polygon crosses itself: its edges from vertices {one} and {other} meet"
    north, east = vertices[:, 0] - vertices[0, 0], vertices[:, 1] - vertices[0, 1]
    twice_m2 = abs(float((north[:-1] * east[1:] - north[1:] * east[:-1]).sum()))
    if twice_m2 < 2.0 * MIN_AREA_M2:
        return f"the polygon holds less than {MIN_AREA_M2:g} square metre"
    return None


def _place_rejection(
    shape: FenceShape, parsed: FenceAreas, vehicle_ne_m: tuple[float, float] | None
) -> Rejection | None:
    """Return the rejection of a geofence without home, return point or the flying vehicle inside, or None."""
    places: list[tuple[str, tuple[float, float]]] = [("the home position", (0.0, 0.0))]
    if parsed.return_point is not None and parsed.return_point.position_deg is not None:
        places.append(("its return point", shape.local(*parsed.return_point.position_deg)))
    if vehicle_ne_m is not None and all(math.isfinite(value) for value in vehicle_ne_m):
        places.append(("the vehicle, which is flying", vehicle_ne_m))
    for name, place in places:
        if not shape.allows(*place):
            return Rejection(MissionResult.INVALID, None, f"the geofence leaves out {name}")
    return None
