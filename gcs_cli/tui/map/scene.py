"""Contents of the map, in metres north and east of an anchor: plans, track, vehicles. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.plan import RALLY_POINT, Command, MissionItem, Plan, Rejection
from flightstack.plan.fence_areas import fence_areas
from flightstack.plan.item import is_unset
from gcs_cli.vehicle.view_types import GeoPosition, VehicleView

TRACK_POINTS = 4000
"""Most points of a track; when it is full, every second one is dropped."""
_FIRST_STEP_M = 0.1
_FARTHEST_M = 1e7
"""Setpoints farther away are not on the earth."""


class Place(NamedTuple):
    """A place relative to the anchor."""

    north_m: float
    east_m: float


class PathItem(NamedTuple):
    """A mission item with a place; an item without a place of its own (a return) has no mark."""

    seq: int
    place: Place
    has_mark: bool = True


class MapArea(NamedTuple):
    """A polygon or circle of a geofence."""

    is_inclusion: bool
    vertices: tuple[Place, ...]
    """Vertices of a polygon, or the centre of a circle."""
    radius_m: float = 0.0


class Craft(NamedTuple):
    """A vehicle on the map; no heading: unknown."""

    place: Place
    heading_deg: float | None = None
    name: str = ""
    is_traffic: bool = False
    """True for an aircraft that an ADS-B receiver reports."""


class MapPlan(NamedTuple):
    """Mission, geofence and rally points of a vehicle."""

    path: tuple[PathItem, ...] = ()
    jumps: tuple[tuple[Place, Place], ...] = ()
    areas: tuple[MapArea, ...] = ()
    rally: tuple[Place, ...] = ()
    problem: str = ""
    """Reason that a geofence cannot be drawn."""


class MapScene(NamedTuple):
    """All that the map shows."""

    vehicle: Craft | None = None
    home: Place | None = None
    target: Place | None = None
    """Position setpoint of the vehicle."""
    current: int | None = None
    """Number of the current mission item."""
    plan: MapPlan = MapPlan()
    track: FloatArray = np.zeros((0, 2))
    """Places of the vehicle, oldest first, shape (n, 2): north and east."""
    others: tuple[Craft, ...] = ()

    def extent(self) -> FloatArray:
        """Return the places that a view of everything holds, shape (n, 2)."""
        places: list[Place] = [item.place for item in self.plan.path]
        places += [*self.plan.rally, *(craft.place for craft in self.others if not craft.is_traffic)]
        places += [place for place in (self.home, self.target) if place is not None]
        if self.vehicle is not None:
            places.append(self.vehicle.place)
        for area in self.plan.areas:
            for north, east in area.vertices:
                places += [Place(north - area.radius_m, east - area.radius_m)]
                places += [Place(north + area.radius_m, east + area.radius_m)]
        return np.concatenate((np.array(places, dtype=np.float64).reshape(-1, 2), self.track))


class Track:
    """Places of a vehicle, thinned out to at most ``TRACK_POINTS``, shape (n, 2)."""

    def __init__(self) -> None:
        self._points = np.zeros((TRACK_POINTS, 2))
        self._count = 0
        self._step_m = _FIRST_STEP_M

    @property
    def points(self) -> FloatArray:
        """The places, oldest first."""
        return self._points[: self._count].copy()

    def extend(self, places: FloatArray) -> None:
        """Append places, shape (n, 2), that are at least a step away from the one before."""
        for place in places:
            if self._count and np.hypot(*(place - self._points[self._count - 1])) < self._step_m:
                continue
            if not np.isfinite(place).all():
                continue
            if self._count == TRACK_POINTS:
                self._count = TRACK_POINTS // 2
                self._points[: self._count] = self._points[::2]
                moves = np.diff(self._points[: self._count], axis=0)
                self._step_m = max(2.0 * self._step_m, float(np.hypot(*moves.T).mean()))
            self._points[self._count] = place
            self._count += 1


def place_of(frame: LocalFrame, latitude_deg: float, longitude_deg: float) -> Place:
    """Return a position relative to the origin of ``frame``."""
    north_m, east_m, _ = frame.to_ned(GeoPoint(latitude_deg, longitude_deg, frame.origin.altitude_m))
    return Place(north_m, east_m)


def map_plan(plan: Plan, frame: LocalFrame, home: Place | None) -> MapPlan:
    """Return what the map shows of ``plan``; a takeoff without a position and a return are at ``home``."""
    path = tuple(_path(plan.items, frame, home))
    place_by_seq = {item.seq: item.place for item in path}
    jumps = []
    for seq, item in enumerate(plan.items):
        if item.command == Command.DO_JUMP and item.param1 in place_by_seq:
            before = [place for number, place in place_by_seq.items() if number < seq]
            if before:
                jumps.append((before[-1], place_by_seq[int(item.param1)]))
    areas, problem = _areas(plan.fence, frame)
    rally = [item.position_deg for item in plan.rally if item.command == RALLY_POINT]
    return MapPlan(
        path,
        tuple(jumps),
        areas,
        tuple(place_of(frame, *position) for position in rally if position is not None),
        problem,
    )


def _path(items: Sequence[MissionItem], frame: LocalFrame, home: Place | None) -> Iterator[PathItem]:
    for seq, item in enumerate(items):
        entry = mavlink.enums["MAV_CMD"].get(item.command)
        if entry is None or not entry.name.startswith("MAV_CMD_NAV_"):
            continue
        has_place = item.is_global and not (is_unset(item.x) or is_unset(item.y))
        if entry.has_location and has_place and (item.x, item.y) != (0, 0):
            yield PathItem(seq, place_of(frame, item.x / 1e7, item.y / 1e7))
        elif home is not None and item.command == Command.NAV_TAKEOFF:
            yield PathItem(seq, home)
        elif home is not None and item.command == Command.NAV_RETURN_TO_LAUNCH:
            yield PathItem(seq, home, has_mark=False)


def _areas(items: Sequence[MissionItem], frame: LocalFrame) -> tuple[tuple[MapArea, ...], str]:
    parsed = fence_areas(items)
    if isinstance(parsed, Rejection):
        return (), f"geofence not drawn: {parsed.reason}"
    return tuple(
        MapArea(
            area.is_inclusion,
            tuple(place_of(frame, *point) for point in area.points_deg),
            area.radius_m,
        )
        for area in parsed.areas
    ), ""


def vehicle_scene(view: VehicleView, frame: LocalFrame) -> MapScene:
    """Return the scene of the vehicle, its home, setpoint and current item, without plan and track."""
    home = None
    if view.home is not None and is_known(view.home):
        home = place_of(frame, view.home.latitude_deg, view.home.longitude_deg)
    if view.geo is None or not is_known(view.geo):
        return MapScene(home=home, current=view.mission.current)
    place = place_of(frame, view.geo.latitude_deg, view.geo.longitude_deg)
    heading = view.heading_deg
    if view.attitude is not None:
        heading = float(np.degrees(view.attitude.yaw_rad)) % 360.0
    target = None
    if view.setpoint is not None and view.setpoint.position_ned_m and view.position_ned_m:
        # the origin of the vehicle's local frame is not home, so only the difference is used
        wanted, now = view.setpoint.position_ned_m, view.position_ned_m
        if math.hypot(wanted.x - now.x, wanted.y - now.y) < _FARTHEST_M:
            target = Place(place.north_m + wanted.x - now.x, place.east_m + wanted.y - now.y)
    return MapScene(Craft(place, heading), home, target, view.mission.current)


def is_known(position: GeoPosition) -> bool:
    """True if a position is given; autopilots without one send zeros."""
    return (position.latitude_deg, position.longitude_deg) != (0.0, 0.0)
