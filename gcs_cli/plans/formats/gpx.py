"""GPX by gpxpy: the mission as a route, home and rally points as waypoints.

Read are the route, or in a file without routes the track, or the waypoints.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import Plan
from gcs_cli.plans.formats.features import Feature
from gcs_cli.plans.formats.libraries import library, parse_xml
from gcs_cli.plans.itinerary import above_home_m
from gcs_cli.plans.names import any_command_name, command_number

_PARTS = {"home": "home", "rally point": "rally"}


def render_gpx(plan: Plan) -> str:
    """Return a GPX file. Elevations are above sea level; without home, altitudes above home are lost."""
    library("gpxpy")
    from gpxpy.gpx import GPX, GPXRoute, GPXRoutePoint, GPXWaypoint

    gpx = GPX()
    gpx.creator = "flightstack"
    if plan.home is not None:
        latitude, longitude, altitude = plan.home
        gpx.waypoints.append(GPXWaypoint(latitude, longitude, altitude, name="home", type="home"))
    for seq, item in enumerate(plan.rally):
        if item.position_deg is not None:
            height = _elevation_m(item, plan.home)
            gpx.waypoints.append(
                GPXWaypoint(*item.position_deg, height, name=f"rally {seq}", type="rally point")
            )
    route = GPXRoute(name="mission")
    for seq, item in enumerate(plan.items):
        if item.position_deg is not None:
            point = GPXRoutePoint(*item.position_deg, _elevation_m(item, plan.home), name=str(seq))
            point.type = any_command_name(item.command)
            route.points.append(point)
    gpx.routes.append(route)
    return str(gpx.to_xml(version="1.1"))


def _elevation_m(item: Any, home: GeoPoint | None) -> float | None:
    if item.frame in (0, 5):
        return float(item.z)
    if home is None or item.z != item.z:
        return None
    return home.altitude_m + above_home_m(item, home)


def read_gpx(text: str, file: object) -> list[Feature]:
    """Return the points of a GPX file; raise ConfigError."""
    library("gpxpy")
    import gpxpy

    return parse_xml("GPX", lambda source: list(_features(gpxpy.parse(source))), text, file)  # type: ignore[no-any-return]


def _features(gpx: Any) -> Iterator[Feature]:
    own = [point for point in gpx.waypoints if point.type in _PARTS]
    for point in own:
        yield _feature(point, {"part": _PARTS[point.type]})
    points = [point for route in gpx.routes for point in route.points]
    points = points or [point for track in gpx.tracks for part in track.segments for point in part.points]
    points = points or [point for point in gpx.waypoints if point not in own]
    for seq, point in enumerate(points):
        name = getattr(point, "type", None) or ""
        properties: dict[str, Any] = {"part": "mission", "seq": seq}
        if command_number(name) is not None:
            properties["command"] = name
        yield _feature(point, properties)


def _feature(point: Any, properties: dict[str, Any]) -> Feature:
    return Feature("point", (((point.latitude, point.longitude, point.elevation),),), properties)
