"""Geofences: conversion of fence items to areas, and validation.

MAVLink's rules: a polygon is a run of vertices, each with the vertex count; inclusion areas form groups (parameter 2),
and the vehicle must be inside all areas of at least one group. Ground stations send group 0 for all areas, so that the
vehicle must be inside every inclusion area, as with PX4 and, by default, ArduPilot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from flightstack.core.geodesy import GeoPoint
from flightstack.plan.fence_shape import Area, FenceShape, edges_that_cross
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Fault, Rejection, item_rejection, place_fault
from flightstack.plan.vocabulary import MAX_FENCE_ITEMS, FenceCommand, MissionResult, command_name

_POLYGONS = (FenceCommand.POLYGON_VERTEX_INCLUSION, FenceCommand.POLYGON_VERTEX_EXCLUSION)
_INCLUSIONS = (FenceCommand.POLYGON_VERTEX_INCLUSION, FenceCommand.CIRCLE_INCLUSION)
MAX_GROUP = 2**16
MIN_VERTICES = 3
MIN_AREA_M2 = 1.0
MAX_RADIUS_M = 1e6


class FenceAreas(NamedTuple):
    """Areas and return point of a geofence."""

    areas: tuple[Area, ...]
    return_point: MissionItem | None


def fence_areas(items: Sequence[MissionItem]) -> FenceAreas | Rejection:
    """Convert fence items to areas, or return the rejection of the first bad item."""
    areas: list[Area] = []
    return_point: MissionItem | None = None
    seq = 0
    while seq < len(items):
        item = items[seq]
        fault = _item_fault(item)
        if fault is None and item.command == FenceCommand.RETURN_POINT and return_point is not None:
            fault = Fault(MissionResult.INVALID, "is a second return point, and there can be one")
        if fault is not None:
            return item_rejection(seq, item, fault)
        if item.command == FenceCommand.RETURN_POINT:
            return_point = item
            seq += 1
            continue
        count = int(item.param1) if item.command in _POLYGONS else 1
        for other in range(seq, seq + count):
            fault = _vertex_fault(items, seq, other)
            if fault is not None:
                at = min(other, len(items) - 1)
                return item_rejection(at, items[at], fault)
        areas.append(_area(items, seq, count))
        seq += count
    return FenceAreas(tuple(areas), return_point)


def _area(items: Sequence[MissionItem], seq: int, count: int) -> Area:
    first = items[seq]
    places = [item.position_deg for item in items[seq : seq + count]]
    is_inclusion = first.command in _INCLUSIONS
    return Area(
        seq,
        is_inclusion,
        _group(first) if is_inclusion else 0,
        tuple(place for place in places if place is not None),
        0.0 if first.command in _POLYGONS else first.param1,
    )


def _group(item: MissionItem) -> int:
    """Return the inclusion group; ground stations without groups send NaN or 0."""
    return 0 if math.isnan(item.param2) else int(item.param2)


def _item_fault(item: MissionItem) -> Fault | None:
    if item.command not in FenceCommand.__members__.values():
        known = ", ".join(f"{command.value} {command.name}" for command in FenceCommand)
        return Fault(MissionResult.UNSUPPORTED, f"is not an item of a geofence; those are {known}")
    fault = place_fault(item)
    if fault is not None or item.command == FenceCommand.RETURN_POINT:
        return fault
    value, group = item.param1, item.param2
    if item.command in _POLYGONS:
        if not (MIN_VERTICES <= value <= MAX_FENCE_ITEMS and value == math.floor(value)):
            allowed = f"a whole number from {MIN_VERTICES} to {MAX_FENCE_ITEMS}"
            return Fault(
                MissionResult.INVALID_PARAM1, f"vertex count {value:g} (parameter 1) must be {allowed}"
            )
    elif not 0.0 < value <= MAX_RADIUS_M:
        reason = f"radius {value:g} (parameter 1) must be above 0 and at most {MAX_RADIUS_M:g} m"
        return Fault(MissionResult.INVALID_PARAM1, reason)
    if item.command in _INCLUSIONS and not (
        math.isnan(group) or (0.0 <= group <= MAX_GROUP and group == math.floor(group))
    ):
        reason = f"inclusion group {group:g} (parameter 2) must be a whole number, 0 or more"
        return Fault(MissionResult.INVALID_PARAM2, reason)
    return None


def _vertex_fault(items: Sequence[MissionItem], first: int, seq: int) -> Fault | None:
    """Return the fault of item ``seq`` in the polygon or circle that starts at ``first``."""
    start = items[first]
    if seq >= len(items):
        have = len(items) - first
        reason = f"the polygon ends after {have} of its {start.param1:g} vertices"
        return Fault(MissionResult.INVALID_PARAM1, reason)
    item = items[seq]
    if item.command != start.command:
        begun = command_name(start.command)
        reason = f"stands where vertex {seq - first} of the {start.param1:g} of a {begun} polygon is expected"
        return Fault(MissionResult.INVALID_SEQUENCE, reason)
    if item.param1 != start.param1:
        reason = (
            f"vertex count {item.param1:g} differs from the {start.param1:g} of its polygon's first vertex"
        )
        return Fault(MissionResult.INVALID_PARAM1, reason)
    if start.command in _INCLUSIONS and not math.isnan(item.param2) and item.param2 != _group(start):
        reason = (
            f"inclusion group {item.param2:g} differs from the {_group(start)} of its polygon's first vertex"
        )
        return Fault(MissionResult.INVALID_PARAM2, reason)
    return place_fault(item)


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
