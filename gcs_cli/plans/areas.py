"""The area of a survey and the line of a corridor, from a plan of any format."""

from __future__ import annotations

import math

from flightstack.core.contract import Vector3
from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Plan, Rejection
from flightstack.plan.fence_areas import Area, fence_areas

_SIDES = 48
Ring = tuple[tuple[float, float], ...]
"""Latitude and longitude of the vertices [deg]."""


def area_rings(plan: Plan, file: object) -> list[Ring]:
    """Return the first inclusion area of the geofence and all exclusion areas as its holes; raise ConfigError."""
    parsed = fence_areas(plan.fence)
    if isinstance(parsed, Rejection):
        raise ConfigError(file, "geofence", parsed.reason)
    outline = next((area for area in parsed.areas if area.is_inclusion), None)
    if outline is None:
        raise ConfigError(file, "", "holds no polygon to survey")
    return [_ring(outline), *(_ring(area) for area in parsed.areas if not area.is_inclusion)]


def _ring(area: Area) -> Ring:
    if not area.radius_m:
        return area.points_deg
    frame = LocalFrame(GeoPoint(*area.points_deg[0], 0.0))
    points = []
    for index in range(_SIDES):
        angle = 2.0 * math.pi * index / _SIDES
        point = frame.to_geo(Vector3(area.radius_m * math.cos(angle), area.radius_m * math.sin(angle), 0.0))
        points.append((point.latitude_deg, point.longitude_deg))
    return tuple(points)


def line_of(plan: Plan, file: object) -> Ring:
    """Return the places of the mission in their order; raise ConfigError for fewer than two different ones."""
    points = tuple(item.position_deg for item in plan.items if item.position_deg is not None)
    if len(set(points)) < 2:
        raise ConfigError(file, "", "holds no line of two points or more")
    return points
