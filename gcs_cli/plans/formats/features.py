"""Plans as geometric features with properties, which GeoJSON, KML and GPX hold.

A feature of ours has the property ``part``. Its other properties hold what the geometry does not, so that GeoJSON and
KML lose nothing; positions always come from the geometry, so that other programs can move them. Features without
``part`` come from other programs: a line or points become waypoints, polygons become the geofence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import RALLY_POINT, Command, Frame, MissionItem, Plan, values
from flightstack.plan.item import integer_coordinate
from flightstack.plan.qgc_areas import fence_document, fence_items
from gcs_cli.plans.names import any_command_name, command_number

Shape: TypeAlias = Literal["none", "point", "line", "polygon"]
Point: TypeAlias = tuple[float, float, float | None]
"""Latitude and longitude [deg], and altitude [m] if given."""

_RELATIVE, _ABSOLUTE = Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL
_GROUP = "inclusionGroup"


class Feature(NamedTuple):
    """A geometry and its properties."""

    shape: Shape
    rings: tuple[tuple[Point, ...], ...]
    """The points, in one tuple; of a polygon the open outline, then the holes."""
    properties: Mapping[str, Any]
    is_relative: bool = False
    """True if altitudes count from the ground, False from the sea level."""


def features_of_plan(plan: Plan) -> list[Feature]:
    """Return home, items, geofence, rally points, and for display the path; raise ConfigError for a bad geofence."""
    found = []
    if plan.home is not None:
        found.append(Feature("point", (((*plan.home,),),), {"part": "home", "name": "home"}))
    found += [_item_feature("mission", seq, item) for seq, item in enumerate(plan.items)]
    found += _fence_features(plan)
    found += [_item_feature("rally", seq, item) for seq, item in enumerate(plan.rally)]
    path = tuple((*item.position_deg, None) for item in plan.items if item.position_deg is not None)
    if len(path) > 1:
        found.append(Feature("line", (path,), {"part": "path", "name": "path"}))
    return found


def _item_feature(part: str, seq: int, item: MissionItem) -> Feature:
    properties: dict[str, Any] = {
        "part": part,
        "name": f"{seq} {any_command_name(item.command)}",
        "seq": seq,
        "command": any_command_name(item.command),
        "frame": int(item.frame),
        "params": [_finite(value) for value in item.params],
        "altitude_m": _finite(item.z),
        "autocontinue": item.autocontinue,
    }
    if item.position_deg is None:
        properties |= {"x": item.x, "y": item.y}
        return Feature("none", (), properties)
    relative = item.altitude_is_relative
    is_known = relative or item.frame in (Frame.GLOBAL, Frame.GLOBAL_INT)
    altitude_m = item.z if is_known and math.isfinite(item.z) else None
    return Feature("point", (((*item.position_deg, altitude_m),),), properties, relative)


def _fence_features(plan: Plan) -> Iterator[Feature]:
    if not plan.fence:
        return
    document = fence_document(plan.fence, {})
    for polygon in document["polygons"]:
        yield Feature("polygon", (tuple((*point, None) for point in polygon["polygon"]),), _area(polygon))
    for circle in document["circles"]:
        inner = circle["circle"]
        yield Feature("point", (((*inner["center"], None),),), {**_area(circle), "radius_m": inner["radius"]})
    if "breachReturn" in document:
        latitude, longitude, altitude = document["breachReturn"]
        properties = {
            "part": "geofence",
            "name": "return point",
            "return_point": True,
            "altitude_m": altitude,
        }
        yield Feature("point", (((latitude, longitude, altitude),),), properties, True)


def _area(entry: Mapping[str, Any]) -> dict[str, Any]:
    name = "stay inside" if entry["inclusion"] else "stay outside"
    area: dict[str, Any] = {"part": "geofence", "name": name, "inclusion": entry["inclusion"]}
    return {**area, _GROUP: entry[_GROUP]} if _GROUP in entry else area


def plan_of_features(features: Sequence[Feature], altitude_m: float, file: object) -> Plan:
    """Return the plan of features; waypoints without an altitude get ``altitude_m`` above home. Raise ConfigError."""
    parts: dict[str, list[Feature]] = {"home": [], "mission": [], "geofence": [], "rally": []}
    foreign = []
    for feature in features:
        part = feature.properties.get("part")
        if part in parts:
            parts[part].append(feature)
        elif part != "path":
            foreign.append(feature)
    values.check_count(file, len(parts["mission"]))
    items = [_item(feature, altitude_m, file) for feature in _sorted(parts["mission"])]
    rally = [_item(feature, altitude_m, file) for feature in _sorted(parts["rally"])]
    home = next((_home(feature, file) for feature in parts["home"]), None)
    if not items:
        items = _foreign_items(foreign, altitude_m, file)
    areas = parts["geofence"] + [each for each in foreign if each.shape == "polygon"]
    return Plan(tuple(items), home, fence=_fence(areas, file), rally=tuple(rally))


def _sorted(features: list[Feature]) -> list[Feature]:
    def seq(feature: Feature) -> float:
        number = feature.properties.get("seq")
        return float(number) if isinstance(number, int | float) else math.inf

    return sorted(features, key=seq)


def _item(feature: Feature, altitude_m: float, file: object) -> MissionItem:
    properties = feature.properties
    where = f"item {properties.get('seq', '')}".strip()
    is_rally = properties["part"] == "rally"
    name = str(properties.get("command", RALLY_POINT if is_rally else "NAV_WAYPOINT"))
    command = command_number(name)
    if command is None:
        raise ConfigError(file, f"{where}, command", f"{name!r:.40} is not a command of MAVLink")
    frame, z = _frame_and_altitude(feature, altitude_m)
    if "frame" in properties:
        frame = values.frame(file, f"{where}, frame", properties["frame"])
        if "altitude_m" in properties:
            z = values.number(file, f"{where}, altitude_m", properties["altitude_m"])
    given = properties.get("params", [0.0, 0.0, 0.0, None])
    if not isinstance(given, list) or len(given) != 4:
        raise ConfigError(file, f"{where}, params", "must be a list of 4 numbers")
    p1, p2, p3, p4 = (values.number(file, f"{where}, params", value) for value in given)
    if feature.shape == "point":
        x, y = _coordinates(feature.rings[0][0], where, file)
    else:
        x, y = (_stored(properties.get(name, 0), f"{where}, {name}", file) for name in ("x", "y"))
        frame = frame if "frame" in properties else Frame.MISSION
    autocontinue = properties.get("autocontinue") is not False
    return MissionItem(command, int(frame), p1, p2, p3, p4, x, y, z, autocontinue)


def _stored(value: Any, where: str, file: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not -(2**31) <= value < 2**31:
        raise ConfigError(file, where, f"{value!r:.40} must be a 32-bit integer")
    return value


def _frame_and_altitude(feature: Feature, altitude_m: float) -> tuple[int, float]:
    given = feature.rings[0][0][2] if feature.shape == "point" else None
    if given is None:
        return _RELATIVE, altitude_m if feature.shape == "point" else 0.0
    return (_RELATIVE if feature.is_relative else _ABSOLUTE), given


def _home(feature: Feature, file: object) -> GeoPoint | None:
    if feature.shape != "point":
        return None
    latitude, longitude, altitude = feature.rings[0][0]
    return values.home_position(file, "home", [latitude, longitude, altitude or 0.0])


def _foreign_items(features: Sequence[Feature], altitude_m: float, file: object) -> list[MissionItem]:
    """Return the waypoints of lines, or of points in a file without lines."""
    lines = [feature for feature in features if feature.shape == "line"]
    chosen = lines or [feature for feature in features if feature.shape == "point"]
    items: list[MissionItem] = []
    for feature in chosen:
        for point in feature.rings[0]:
            single = Feature("point", ((point,),), {}, feature.is_relative)
            frame, z = _frame_and_altitude(single, altitude_m)
            x, y = _coordinates(point, f"point {len(items)}", file)
            items.append(MissionItem(Command.NAV_WAYPOINT, frame, 0.0, 0.0, 0.0, math.nan, x, y, z))
    values.check_count(file, len(items))
    return items


def _fence(features: Sequence[Feature], file: object) -> tuple[MissionItem, ...]:
    polygons, circles, back = [], [], None
    for feature in features:
        properties = feature.properties
        kind = {"inclusion": properties.get("inclusion", True), _GROUP: properties.get(_GROUP, 0)}
        if feature.shape == "polygon":
            outline, *holes = ([list(point[:2]) for point in ring] for ring in feature.rings)
            polygons.append({**kind, "polygon": outline})
            polygons += [{"inclusion": False, "polygon": hole} for hole in holes]
        elif feature.shape == "point" and properties.get("return_point") is True:
            latitude, longitude, altitude = feature.rings[0][0]
            back = [latitude, longitude, properties.get("altitude_m", altitude or 0.0)]
        elif feature.shape == "point":
            circle = {"center": list(feature.rings[0][0][:2]), "radius": properties.get("radius_m")}
            circles.append({**kind, "circle": circle})
    document: dict[str, Any] = {"polygons": polygons, "circles": circles}
    if back is not None:
        document["breachReturn"] = back
    return fence_items({"geoFence": document}, file)


def _coordinates(point: Point, where: str, file: object) -> tuple[int, int]:
    latitude, longitude, _ = point
    for value, name, limit in ((latitude, "latitude", 90.0), (longitude, "longitude", 180.0)):
        if not abs(value) <= limit:
            raise ConfigError(file, f"{where}, {name}", f"{value:.9g} must be from -{limit:g} to {limit:g}")
    return integer_coordinate(latitude, is_global=True), integer_coordinate(longitude, is_global=True)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
