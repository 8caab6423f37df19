"""The flown path seen from above, against the plan, as SVG text. North is up, east is right."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.plan import Command, MissionItem, Plan
from gcs_cli.report.flight_data import Flight
from gcs_cli.report.summary import item_ned_m
from gcs_cli.report.svg import (
    WIDTH,
    Scale,
    circle,
    multiples,
    nice_ticks,
    polyline,
    segment,
    text,
    tick_text,
    upright_text,
)

_HEIGHT = 560
_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 14, 14, 40
_MAX_POINTS = 4000
_SMALLEST_SPAN_M = 4.0
_SAME_PLACE_PX = 9.0
_ACCEPTANCE_PARAMETER = "NAV_ACC_RAD"  # the vehicle's radius for items that give none


class Marker(NamedTuple):
    """A numbered place of the plan, in metres."""

    north_m: float
    east_m: float
    label: str
    radius_m: float


class _View(NamedTuple):
    east: Scale
    north: Scale


def path_chart(flight: Flight, plan: Plan) -> str:
    """Return the map; a sentence instead if there is neither a path nor a place."""
    markers, route = _plan_markers(flight, plan), _route(flight, plan)
    path = flight.position.values[:, :2]
    path = path[np.isfinite(path).all(axis=1)]
    if not len(path) and not markers:
        return '<p class="none">No data.</p>'
    view = _view(path, markers)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {_HEIGHT}" role="img" aria-label="Path from above, against the plan">',
        *_grid(view),
        *_circles(markers, view),
        f"<g><title>planned</title>{_line(route, view, 'plan')}</g>",
        f"<g><title>flown</title>{_line(_thinned(path, view), view, 's1 flown')}</g>",
        *_labels(markers, view),
        "</svg>",
    ]
    return "".join(parts)


def _plan_markers(flight: Flight, plan: Plan) -> list[Marker]:
    home = flight.home_ne_m()
    markers = [Marker(*home, "home", 0.0)] if home else []
    for seq, item in enumerate(plan.items):
        place = item_ned_m(item, flight)
        if place is not None:
            markers.append(Marker(float(place[0]), float(place[1]), str(seq), _radius_m(item, flight)))
    return markers


def _radius_m(item: MissionItem, flight: Flight) -> float:
    if item.command != Command.NAV_WAYPOINT:
        return 0.0
    if math.isfinite(item.param2) and item.param2 > 0.0:
        return item.param2
    return float(flight.parameters.get(_ACCEPTANCE_PARAMETER, 0.0))


def _route(flight: Flight, plan: Plan) -> FloatArray:
    """Places of the plan in the order of its items, shape (n, 2); a return leads home."""
    home = flight.home_ne_m()
    places = [home] if home else []
    for item in plan.items:
        place = item_ned_m(item, flight)
        if place is not None:
            places.append((float(place[0]), float(place[1])))
        elif item.command == Command.NAV_RETURN_TO_LAUNCH:
            places.append(home or (0.0, 0.0))
    return np.array(places).reshape(-1, 2)


def _view(path: FloatArray, markers: Sequence[Marker]) -> _View:
    corners = [path] if len(path) else []
    for marker in markers:
        north, east, radius = marker.north_m, marker.east_m, marker.radius_m
        corners.append(np.array([(north - radius, east - radius), (north + radius, east + radius)]))
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    span = np.maximum(high - low, _SMALLEST_SPAN_M) * 1.14
    metres_per_pixel = max(span[0] / height, span[1] / width)
    half_north, half_east = 0.5 * metres_per_pixel * height, 0.5 * metres_per_pixel * width
    north, east = 0.5 * (low + high)
    return _View(
        Scale(east - half_east, east + half_east, _LEFT, WIDTH - _RIGHT),
        Scale(north - half_north, north + half_north, _HEIGHT - _BOTTOM, _TOP),
    )


def _thinned(path: FloatArray, view: _View) -> FloatArray:
    """Leave out samples that fall on the same half pixel as the one before."""
    if len(path) < 2:
        return path
    pixels = np.round(2.0 * np.column_stack((view.east.pixels(path[:, 1]), view.north.pixels(path[:, 0]))))
    moved = np.concatenate(([True], (np.diff(pixels, axis=0) != 0.0).any(axis=1)))
    kept = path[moved]
    return kept[:: 1 + len(kept) // _MAX_POINTS]


def _line(path: FloatArray, view: _View, style: str) -> str:
    return polyline(view.east.pixels(path[:, 1]), view.north.pixels(path[:, 0]), style)


def _place(marker: Marker, view: _View) -> tuple[float, float]:
    return view.east.pixel(marker.east_m), view.north.pixel(marker.north_m)


def _grid(view: _View) -> Iterator[str]:
    bottom, right = _HEIGHT - _BOTTOM, WIDTH - _RIGHT
    norths = nice_ticks(view.north.low, view.north.high, 6)
    for value in norths:
        at = view.north.pixel(value)
        yield segment("grid", _LEFT, at, right, at)
        yield text("tick y", _LEFT - 7, at + 4, tick_text(value))
    for value in multiples(norths[1] - norths[0], view.east.low, view.east.high):
        at = view.east.pixel(value)
        yield segment("grid", at, _TOP, at, bottom)
        yield text("tick x", at, bottom + 17, tick_text(value))
    yield upright_text("label", 13, 0.5 * (_TOP + bottom), "north [m]")
    yield text("label", 0.5 * (_LEFT + right), _HEIGHT - 4, "east [m]")


def _circles(markers: Sequence[Marker], view: _View) -> Iterator[str]:
    pixels_per_metre = (view.east.end - view.east.start) / (view.east.high - view.east.low)
    for marker in markers:
        if marker.radius_m > 0.0:
            hint = f"item {marker.label}: accepted within {marker.radius_m:g} m"
            yield circle("acceptance", *_place(marker, view), marker.radius_m * pixels_per_metre, hint)


def _labels(markers: Sequence[Marker], view: _View) -> Iterator[str]:
    """Draw each place once, with the numbers of all items there."""
    places: list[tuple[float, float, list[str]]] = []
    for marker in markers:
        x, y = _place(marker, view)
        for known_x, known_y, labels in places:
            if math.hypot(known_x - x, known_y - y) < _SAME_PLACE_PX:
                labels.append(marker.label)
                break
        else:
            places.append((x, y, [marker.label]))
    for x, y, labels in places:
        yield circle("place", x, y, 4)
        yield text("place-label", x + 9, y - 8, ", ".join(labels))
