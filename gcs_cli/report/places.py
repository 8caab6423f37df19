"""The places of a plan in the local frame of a flight: items, route, geofence and rally points. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import LocalFrame
from flightstack.plan import Command, MissionItem, Plan
from flightstack.plan.fence_areas import FenceAreas, fence_areas
from gcs_cli.report.flight_data import Flight
from gcs_cli.report.summary import item_ned_m

_ACCEPTANCE_PARAMETER = "NAV_ACC_RAD"  # the vehicle's radius for items that give none
_CIRCLE = np.linspace(0.0, 2.0 * math.pi, 73)
_SAME_PLACE = 0.015
"""Share of the map within which two places have one label."""


class Marker(NamedTuple):
    """A place of the plan, NED [m]. ``radius_m``: within which it is accepted; 0 for none."""

    ned_m: FloatArray
    label: str
    radius_m: float = 0.0


class Area(NamedTuple):
    """An area of the geofence: its closed outline north and east [m], shape (n, 2)."""

    outline_m: FloatArray
    is_inclusion: bool


def plan_markers(flight: Flight, plan: Plan) -> list[Marker]:
    """Return home and all items with a position, labelled with their numbers."""
    home = flight.home_ne_m()
    markers = [Marker(np.array([*home, 0.0]), "home")] if home else []
    for seq, item in enumerate(plan.items):
        place = item_ned_m(item, flight)
        if place is not None:
            markers.append(Marker(place, str(seq), _radius_m(item, flight)))
    return markers


def _radius_m(item: MissionItem, flight: Flight) -> float:
    if item.command != Command.NAV_WAYPOINT:
        return 0.0
    if math.isfinite(item.param2) and item.param2 > 0.0:
        return item.param2
    return float(flight.parameters.get(_ACCEPTANCE_PARAMETER, 0.0))


def merged(markers: Sequence[Marker], axes: int) -> list[Marker]:
    """Return each place once, with the labels of all markers there; ``axes``: 2 as seen from above, 3 in space."""
    if not markers:
        return []
    reach_m = max(0.1, _SAME_PLACE * float(np.ptp([marker.ned_m[:axes] for marker in markers], axis=0).max()))
    places: list[Marker] = []
    for marker in markers:
        for index, known in enumerate(places):
            if np.linalg.norm(known.ned_m[:axes] - marker.ned_m[:axes]) < reach_m:
                places[index] = known._replace(label=f"{known.label}, {marker.label}")
                break
        else:
            places.append(marker)
    return places


def route_ned_m(flight: Flight, plan: Plan) -> FloatArray:
    """Return the places of the plan in the order of its items, NED [m], shape (n, 3); a return leads home."""
    home = np.array([*(flight.home_ne_m() or (0.0, 0.0)), 0.0])
    places = [home] if flight.home_ne_m() else []
    for item in plan.items:
        place = item_ned_m(item, flight)
        if place is None and item.command == Command.NAV_RETURN_TO_LAUNCH:
            place = home
        if place is not None:
            places.append(place)
    return np.array(places).reshape(-1, 3)


def fence(flight: Flight, plan: Plan) -> Iterator[Area]:
    """Yield the areas of the plan's geofence; none of one that the vehicle refuses."""
    found = fence_areas(plan.fence)
    if flight.origin is None or not isinstance(found, FenceAreas):
        return
    for area in found.areas:
        points = np.array([_local(flight, *point) for point in area.points_deg])
        if area.radius_m:
            points = points + area.radius_m * np.column_stack((np.cos(_CIRCLE), np.sin(_CIRCLE)))
        else:
            points = np.concatenate((points, points[:1]))
        yield Area(points, area.is_inclusion)


def rally_markers(flight: Flight, plan: Plan) -> list[Marker]:
    """Return the rally points."""
    places = [item_ned_m(item, flight) for item in plan.rally]
    return [Marker(place, f"R{seq + 1}") for seq, place in enumerate(places) if place is not None]


def _local(flight: Flight, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    assert flight.origin is not None
    there = flight.origin._replace(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    local = LocalFrame(flight.origin).to_ned(there)
    return local.x, local.y
