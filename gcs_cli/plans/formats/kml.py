"""KML by fastkml: placemarks with ExtendedData, as Google Earth and other programs show and edit them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from gcs_cli.plans.formats.features import Feature, Point
from gcs_cli.plans.formats.geojson import open_ring
from gcs_cli.plans.formats.libraries import library, parse_xml


def render_kml(features: list[Feature]) -> str:
    """Return a KML document. Altitudes above home are ``relativeToGround``."""
    library("fastkml")
    from fastkml import KML, Data, Document, ExtendedData, Placemark

    placemarks = []
    for feature in features:
        data = [
            Data(name=name, value=json.dumps(value))
            for name, value in feature.properties.items()
            if name != "name"
        ]
        placemarks.append(
            Placemark(
                name=str(feature.properties.get("name", "")),
                extended_data=ExtendedData(elements=data),
                kml_geometry=_geometry(feature),
            )
        )
    document = KML(features=[Document(features=placemarks)])
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + document.to_string(prettyprint=True).strip() + "\n"


def _geometry(feature: Feature) -> Any:
    from fastkml import LineString as KmlLine
    from fastkml import Point as KmlPoint
    from fastkml import Polygon as KmlPolygon
    from fastkml.enums import AltitudeMode
    from pygeoif import LineString, Polygon
    from pygeoif import Point as PlainPoint

    if feature.shape == "none":
        return None
    has_altitude = feature.rings[0][0][2] is not None
    rings: list[list[Any]] = [
        [
            (longitude, latitude, altitude or 0.0) if has_altitude else (longitude, latitude)
            for latitude, longitude, altitude in ring
        ]
        for ring in feature.rings
    ]
    mode = None
    if has_altitude:
        mode = AltitudeMode.relative_to_ground if feature.is_relative else AltitudeMode.absolute
    if feature.shape == "point":
        return KmlPoint(geometry=PlainPoint(*rings[0][0]), altitude_mode=mode)
    if feature.shape == "line":
        return KmlLine(geometry=LineString(rings[0]), altitude_mode=mode, tessellate=True)
    closed = [[*ring, ring[0]] for ring in rings]
    return KmlPolygon(geometry=Polygon(closed[0], closed[1:]), altitude_mode=mode)


def read_kml(text: str, file: object) -> list[Feature]:
    """Return the placemarks of a KML file; raise ConfigError."""
    library("fastkml")
    from fastkml import KML

    return parse_xml("KML", lambda source: list(_features(KML.from_string(source))), text, file)  # type: ignore[no-any-return]


def _features(node: Any) -> Iterator[Feature]:
    for child in getattr(node, "features", None) or ():
        yield from _features(child)
    if not hasattr(node, "kml_geometry"):
        return
    properties = _properties(node)
    if node.kml_geometry is None:
        if properties:
            yield Feature("none", (), properties)
        return
    yield from _shapes(node.kml_geometry, properties)


def _properties(placemark: Any) -> dict[str, Any]:
    found = {}
    elements = placemark.extended_data.elements if placemark.extended_data else ()
    for element in elements:
        if getattr(element, "name", None) and isinstance(getattr(element, "value", None), str):
            try:
                found[element.name] = json.loads(element.value)
            except ValueError:
                found[element.name] = element.value
    return found


def _shapes(shape: Any, properties: dict[str, Any]) -> Iterator[Feature]:
    inner = getattr(shape, "kml_geometries", None)
    if inner is not None:  # MultiGeometry
        for each in inner:
            yield from _shapes(each, properties)
        return
    mode = getattr(shape.altitude_mode, "value", None)
    is_relative, has_altitude = mode == "relativeToGround", mode in ("relativeToGround", "absolute")
    plain = shape.geometry
    if plain is None:
        return
    if plain.geom_type == "Polygon":
        rings = [plain.exterior.coords, *(ring.coords for ring in plain.interiors)]
        yield Feature("polygon", tuple(open_ring(_points(ring, False)) for ring in rings), properties)
    elif plain.geom_type in ("Point", "LineString", "LinearRing"):
        kind = "point" if plain.geom_type == "Point" else "line"
        points = _points(plain.coords, has_altitude)
        yield Feature("point" if kind == "point" else "line", (points,), properties, is_relative)


def _points(coordinates: Any, has_altitude: bool) -> tuple[Point, ...]:
    """Return the points; KML's altitudes count only in some altitude modes."""
    return tuple(
        (each[1], each[0], each[2] if has_altitude and len(each) > 2 else None) for each in coordinates
    )
