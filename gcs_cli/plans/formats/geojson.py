"""GeoJSON (RFC 7946): JSON, so that Python's json module is all it needs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from flightstack.core.errors import ConfigError
from gcs_cli.plans.formats.features import Feature, Point

_NAMES = {"point": "Point", "line": "LineString", "polygon": "Polygon"}
_MOST_DEPTH = 20  # of collections in collections


def render_geojson(features: list[Feature]) -> str:
    """Return a FeatureCollection. Altitudes above home stay in the properties: those of GeoJSON count from the sea."""
    listed = [
        {"type": "Feature", "geometry": _geometry(feature), "properties": dict(feature.properties)}
        for feature in features
    ]
    return json.dumps({"type": "FeatureCollection", "features": listed}, indent=2) + "\n"


def _geometry(feature: Feature) -> dict[str, Any] | None:
    if feature.shape == "none":
        return None
    rings = [[_position(point, feature.is_relative) for point in ring] for ring in feature.rings]
    coordinates: Any = rings[0]
    if feature.shape == "point":
        coordinates = rings[0][0]
    elif feature.shape == "polygon":
        coordinates = [[*ring, ring[0]] for ring in rings]
    return {"type": _NAMES[feature.shape], "coordinates": coordinates}


def _position(point: Point, is_relative: bool) -> list[float]:
    latitude, longitude, altitude = point
    has_altitude = altitude is not None and not is_relative
    return [longitude, latitude, altitude] if has_altitude and altitude is not None else [longitude, latitude]


def is_geojson(text: str) -> bool:
    """Return True if ``text`` is a JSON object with one of GeoJSON's types."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return False
    return isinstance(document, dict) and document.get("type") in _TYPES


def read_geojson(text: str, file: object) -> list[Feature]:
    """Return the features of a GeoJSON file; raise ConfigError."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(file, "", f"is not valid JSON: {error}") from error
    return list(_features(document, {}, file, 0))


def _features(node: Any, properties: dict[str, Any], file: object, depth: int) -> Iterator[Feature]:
    if not isinstance(node, dict) or node.get("type") not in _TYPES or depth > _MOST_DEPTH:
        found = node.get("type") if isinstance(node, dict) else node
        raise ConfigError(file, "type", f"{found!r:.40} must be one of {', '.join(sorted(_TYPES))}")
    kind = node["type"]
    if kind == "FeatureCollection":
        for entry in _listed(node.get("features"), "features", file):
            yield from _features(entry, {}, file, depth + 1)
    elif kind == "Feature":
        given = node.get("properties")
        own = given if isinstance(given, dict) else {}
        if node.get("geometry") is None:
            yield Feature("none", (), own)
        else:
            yield from _features(node["geometry"], own, file, depth + 1)
    elif kind == "GeometryCollection":
        for entry in _listed(node.get("geometries"), "geometries", file):
            yield from _features(entry, properties, file, depth + 1)
    else:
        yield from _shapes(kind, node.get("coordinates"), properties, file)


def _shapes(kind: str, coordinates: Any, properties: dict[str, Any], file: object) -> Iterator[Feature]:
    singles = _listed(coordinates, "coordinates", file) if kind.startswith("Multi") else [coordinates]
    for single in singles:
        shape = kind.removeprefix("Multi")
        if shape == "Point":
            yield Feature("point", ((_point(single, file),),), properties)
        elif shape == "LineString":
            yield Feature("line", (_points(single, file),), properties)
        else:
            rings = tuple(open_ring(_points(ring, file)) for ring in _listed(single, "coordinates", file))
            if not rings:
                raise ConfigError(file, "coordinates", "a polygon needs an outline")
            yield Feature("polygon", rings, properties)


_TYPES = {
    "FeatureCollection", "Feature", "GeometryCollection", "Point", "MultiPoint", "LineString", "MultiLineString",
    "Polygon", "MultiPolygon",
}  # fmt: skip


def open_ring(points: tuple[Point, ...]) -> tuple[Point, ...]:
    """Return a ring without its last point if that repeats the first one."""
    return points[:-1] if len(points) > 1 and points[0][:2] == points[-1][:2] else points


def _points(listed: Any, file: object) -> tuple[Point, ...]:
    return tuple(_point(entry, file) for entry in _listed(listed, "coordinates", file))


def _point(entry: Any, file: object) -> Point:
    numbers = _listed(entry, "coordinates", file)
    is_good = len(numbers) >= 2 and all(
        isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        for value in numbers
    )
    if not is_good:
        raise ConfigError(
            file, "coordinates", f"{entry!r:.60} must be longitude, latitude and maybe altitude"
        )
    return float(numbers[1]), float(numbers[0]), float(numbers[2]) if len(numbers) > 2 else None


def _listed(value: Any, key: str, file: object) -> list[Any]:
    if not isinstance(value, list):
        raise ConfigError(file, key, f"{value!r:.40} must be a list")
    return value
