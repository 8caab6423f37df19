"""Conversion of the items of a geofence to its areas. Needs no NumPy, unlike their geometry.

MAVLink's rules: a polygon is a run of vertices, each with the vertex count; inclusion areas form groups (parameter 2),
and the vehicle must be inside all areas of at least one group. Ground stations send group 0 for all areas, so that the
vehicle must be inside every inclusion area, as with PX4 and, by default, ArduPilot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from flightstack.plan.commands import MAX_FENCE_ITEMS, FenceCommand, MissionResult, command_name
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Fault, Rejection, item_rejection, place_fault

_POLYGONS = (FenceCommand.POLYGON_VERTEX_INCLUSION, FenceCommand.POLYGON_VERTEX_EXCLUSION)
_INCLUSIONS = (FenceCommand.POLYGON_VERTEX_INCLUSION, FenceCommand.CIRCLE_INCLUSION)
MAX_GROUP = 2**16
MIN_VERTICES = 3
MAX_RADIUS_M = 1e6


class Area(NamedTuple):
    """A polygon or circle of a geofence."""

    seq: int
    """Number of the first item."""
    is_inclusion: bool
    group: int
    """Group of an inclusion area; 0 for exclusions."""
    points_deg: tuple[tuple[float, float], ...]
    """Latitude and longitude of the vertices, or of the circle's centre."""
    radius_m: float = 0.0
    """Radius of a circle; 0 for a polygon."""


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
