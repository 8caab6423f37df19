"""Geofence and rally points of a ``.plan`` (version 2 of both), to and from mission items.

The order is QGroundControl's: polygons, circles, return point. The additional key ``inclusionGroup`` holds MAVLink's
group if it is not 0; QGroundControl ignores it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import values
from flightstack.plan.commands import RALLY_POINT, FenceCommand, Frame
from flightstack.plan.fence_areas import MAX_GROUP, MIN_VERTICES, fence_areas
from flightstack.plan.item import MissionItem, integer_coordinate
from flightstack.plan.rejection import Rejection

VERSION = 2
_GROUP = "inclusionGroup"


def fence_items(document: Mapping[str, Any], file: object) -> tuple[MissionItem, ...]:
    """Return the items of ``geoFence``; none for older versions. Raise ConfigError."""
    fence = _part(document, "geoFence", file)
    items: list[MissionItem] = []
    for index, polygon in enumerate(_listed(fence, "geoFence.polygons", file)):
        where = f"geoFence.polygons[{index}]"
        inclusion, group = _kind(polygon, where, file)
        points = polygon.get("polygon")
        if not isinstance(points, list) or len(points) < MIN_VERTICES:
            raise ConfigError(file, f"{where}.polygon", "must be a list of at least three points")
        code = FenceCommand.POLYGON_VERTEX_INCLUSION if inclusion else FenceCommand.POLYGON_VERTEX_EXCLUSION
        for number, point in enumerate(points):
            place = _numbers(point, f"{where}.polygon[{number}]", 2, file)
            items.append(_item(code, Frame.GLOBAL, place, float(len(points)), group))
    for index, circle in enumerate(_listed(fence, "geoFence.circles", file)):
        where = f"geoFence.circles[{index}]"
        inclusion, group = _kind(circle, where, file)
        inner = circle.get("circle")
        if not isinstance(inner, dict):
            raise ConfigError(file, f"{where}.circle", "must be an object with center and radius")
        centre = _numbers(inner.get("center"), f"{where}.circle.center", 2, file)
        radius_m = _numbers([inner.get("radius")], f"{where}.circle.radius", 1, file)[0]
        if not radius_m > 0.0:
            raise ConfigError(file, f"{where}.circle.radius", f"{radius_m:g} must be above 0 m")
        code = FenceCommand.CIRCLE_INCLUSION if inclusion else FenceCommand.CIRCLE_EXCLUSION
        items.append(_item(code, Frame.GLOBAL, centre, radius_m, group))
    back = fence.get("breachReturn")
    if back is not None:
        place = _numbers(back, "geoFence.breachReturn", 3, file)
        items.append(_item(FenceCommand.RETURN_POINT, Frame.GLOBAL_RELATIVE_ALT, place))
    return tuple(items)


def rally_items(document: Mapping[str, Any], file: object) -> tuple[MissionItem, ...]:
    """Return the items of ``rallyPoints``; none for older versions. Raise ConfigError."""
    rally = _part(document, "rallyPoints", file)
    return tuple(
        _item(
            RALLY_POINT, Frame.GLOBAL_RELATIVE_ALT, _numbers(point, f"rallyPoints.points[{index}]", 3, file)
        )
        for index, point in enumerate(_listed(rally, "rallyPoints.points", file, of=list))
    )


def fence_document(items: Sequence[MissionItem], before: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``geoFence`` for ``items``; unknown keys of ``before`` are kept. Raise ConfigError."""
    parsed = fence_areas(items)
    if isinstance(parsed, Rejection):
        raise ConfigError("plan", "geofence", parsed.reason)
    polygons: list[dict[str, Any]] = []
    circles: list[dict[str, Any]] = []
    for area in parsed.areas:
        shown: dict[str, Any] = {"inclusion": area.is_inclusion, "version": 1}
        if area.group:
            shown[_GROUP] = area.group
        points = [list(point) for point in area.points_deg]
        if area.radius_m:
            circles.append({"circle": {"center": points[0], "radius": area.radius_m}, **shown})
        else:
            polygons.append({**shown, "polygon": points})
    document = {**before, "circles": circles, "polygons": polygons, "version": VERSION}
    document.pop("breachReturn", None)
    if parsed.return_point is not None and parsed.return_point.position_deg is not None:
        document["breachReturn"] = [*parsed.return_point.position_deg, parsed.return_point.z]
    return document


def rally_document(
    items: Sequence[MissionItem], home: GeoPoint | None, before: Mapping[str, Any]
) -> dict[str, Any]:
    """Return ``rallyPoints`` for ``items``, with altitudes above home; raise ConfigError if home is unknown."""
    points = []
    for seq, item in enumerate(items):
        if item.position_deg is None:
            raise ConfigError("plan", f"rally point {seq}", "has no latitude and longitude")
        if not item.altitude_is_relative and home is None:
            raise ConfigError(
                "plan", f"rally point {seq}", "has an altitude above sea level, and home is not known"
            )
        sea_level_m = 0.0 if item.altitude_is_relative or home is None else home.altitude_m
        points.append([*item.position_deg, item.z - sea_level_m])
    return {**before, "points": points, "version": VERSION}


def _part(document: Mapping[str, Any], key: str, file: object) -> Mapping[str, Any]:
    part = document.get(key)
    if part is None:
        return {}
    if not isinstance(part, dict):
        raise ConfigError(file, key, "must be an object")
    return part if part.get("version", VERSION) == VERSION else {}


def _listed(part: Mapping[str, Any], key: str, file: object, of: type = dict) -> list[Any]:
    listed = part.get(key.split(".")[1], [])
    if not isinstance(listed, list):
        raise ConfigError(file, key, "must be a list")
    values.check_count(file, len(listed))
    for index, entry in enumerate(listed):
        if not isinstance(entry, of):
            name = "an object" if of is dict else "a list"
            raise ConfigError(file, f"{key}[{index}]", f"must be {name}")
    return listed


def _kind(area: Mapping[str, Any], where: str, file: object) -> tuple[bool, float]:
    inclusion = area.get("inclusion")
    if not isinstance(inclusion, bool):
        raise ConfigError(file, f"{where}.inclusion", f"{inclusion!r:.40} must be true or false")
    return inclusion, float(values.integer(file, f"{where}.{_GROUP}", area.get(_GROUP, 0), MAX_GROUP))


def _numbers(listed: Any, where: str, count: int, file: object) -> list[float]:
    if not isinstance(listed, list) or len(listed) != count:
        raise ConfigError(file, where, f"must be a list of {count} numbers")
    numbers = [values.number(file, where, value) for value in listed]
    for number, (name, limit) in zip(numbers, (("latitude", 90.0), ("longitude", 180.0)), strict=False):
        if count > 1 and not abs(number) <= limit:
            raise ConfigError(file, where, f"{name} {number:.9g} must be from -{limit:g} to {limit:g}")
    return numbers


def _item(
    code: int, frame: Frame, place: list[float], param1: float = 0.0, param2: float = 0.0
) -> MissionItem:
    x, y = (integer_coordinate(value, is_global=True) for value in place[:2])
    z = place[2] if len(place) > 2 else 0.0  # altitude, if given
    return MissionItem(int(code), int(frame), param1, param2, 0.0, 0.0, x, y, z)
