"""State of the map that outlives a redraw: anchor, track, and the plan in metres."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Plan
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.map.scene import (
    Craft,
    MapPlan,
    MapScene,
    Place,
    Track,
    is_known,
    map_plan,
    place_of,
    vehicle_scene,
)
from gcs_cli.tui.map.traffic import Aircraft
from gcs_cli.vehicle.view_types import VehicleView

_POSITION = "GLOBAL_POSITION_INT"
_UNKNOWN_HEADING = 65535  # GLOBAL_POSITION_INT.hdg


class MapModel:
    """Folds the vehicle's state, its history and plans to a scene."""

    def __init__(self) -> None:
        self.frame: LocalFrame | None = None
        """Frame of the map around the first known position; None before."""
        self._system_id: int | None = None
        self._track = Track()
        self._track_s = -np.inf
        self._source: Plan | None = None
        self._home: Place | None = None
        self._plan = MapPlan()

    def clear_track(self) -> None:
        """Drop the track up to now."""
        self._track = Track()

    def scene(
        self, view: VehicleView, history: History, plan: Plan, aircraft: Iterable[Aircraft] = ()
    ) -> MapScene:
        """Return the scene; the track also gets the positions that ``history`` received since the last call."""
        self._select(view)
        if self.frame is None:
            return MapScene()
        self._extend_track(history, self.frame)
        scene = vehicle_scene(view, self.frame)
        others = (
            *_others(history, self._system_id, self.frame),
            *(_craft_of(each, view, self.frame) for each in aircraft),
        )
        if plan is not self._source or scene.home != self._home:
            self._source, self._home = plan, scene.home
            self._plan = map_plan(plan, self.frame, scene.home)
        return scene._replace(plan=self._plan, track=self._track.points, others=others)

    def _select(self, view: VehicleView) -> None:
        system_id = None if view.identity is None else view.identity.system_id
        if system_id != self._system_id:
            self._system_id = system_id
            self._track, self._track_s = Track(), -np.inf
            self.frame, self._source = None, None
        for start in (view.home, view.geo):
            if self.frame is None and start is not None and is_known(start):
                self.frame = LocalFrame(GeoPoint(start.latitude_deg, start.longitude_deg, start.altitude_m))

    def _extend_track(self, history: History, frame: LocalFrame) -> None:
        latitude = history.series(f"{_POSITION}.lat", self._system_id)
        longitude = history.series(f"{_POSITION}.lon", self._system_id)
        count = min(len(latitude.values), len(longitude.values))  # a message may arrive in between
        times_s = latitude.times_s[:count]
        first = int(np.searchsorted(times_s, self._track_s, side="right"))
        if first == count:
            return
        self._track_s = float(times_s[-1])
        new = np.column_stack((latitude.values[first:count], longitude.values[first:count])) / 1e7
        new = new[(new != 0.0).any(axis=1)]
        self._track.extend(np.array([place_of(frame, *point) for point in new.tolist()]).reshape(-1, 2))


def _others(history: History, system_id: int | None, frame: LocalFrame) -> list[Craft]:
    """Return the other vehicles on the link by their last positions."""
    return [
        Craft(
            place_of(frame, stream.last.lat / 1e7, stream.last.lon / 1e7),
            None if stream.last.hdg == _UNKNOWN_HEADING else stream.last.hdg / 100,
            str(stream.key.system_id),
        )
        for stream in history.streams()
        if stream.name == _POSITION and stream.key.system_id != system_id and stream.last.lat
    ]


def _craft_of(aircraft: Aircraft, view: VehicleView, frame: LocalFrame) -> Craft:
    """Return an aircraft with its altitude above the vehicle, or its pressure altitude (PA)."""
    name = aircraft.name
    if aircraft.altitude_m is not None and not aircraft.is_geometric:
        name += f" PA {aircraft.altitude_m:.0f} m"
    elif aircraft.altitude_m is not None and view.geo is not None:
        name += f" {aircraft.altitude_m - view.geo.altitude_m:+.0f} m"
    place = place_of(frame, aircraft.latitude_deg, aircraft.longitude_deg)
    return Craft(place, aircraft.heading_deg, name, is_traffic=True)
