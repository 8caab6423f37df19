"""What the vehicle is to fly and where it may: mission, geofence, rally points, home. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.commander.supervisor import Supervisor
from flightstack.core.contract import FloatArray, RecordArray, Vector3
from flightstack.core.geodesy import GeoPoint
from flightstack.core.modes import Mode
from flightstack.core.portable_math import distance
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.plan_table import plan_table
from flightstack.guidance.rally import HOME, ReturnPlace
from flightstack.guidance.safe_places import HOME_SPREAD_M, SafePlaces, plan_limits
from flightstack.params.behaviour import Behaviour
from flightstack.plan import MissionItem, Rejection
from flightstack.plan.check import Limits
from flightstack.vehicle.snapshot import Recorder, Snapshot

CEILING_MARGIN_M = 1.0
"""So far below GF_MAX_VER_DIST a return stays: where a breach of it ends (``fence.HYSTERESIS_M``)."""


class PlanKeeper:
    """The part of the autopilot that takes plans from the ground and checks them."""

    _behaviour: Behaviour
    _navigator: Navigator
    _recorder: Recorder
    _state: FloatArray
    now: Snapshot
    supervisor: Supervisor

    def __init__(self, home: GeoPoint) -> None:
        self.items: tuple[MissionItem, ...] = ()
        self.places = SafePlaces(home)
        self._mission_judged: tuple[object, str | None] = (None, None)
        self._ground_m = -math.inf  # above the origin
        self._stood = HOME  # where the vehicle armed or landed last

    def _mission_is_gone(self) -> None:
        """Act when the mission that may be flown was cleared."""
        raise NotImplementedError

    @property
    def limits(self) -> Limits:
        """Limits of a mission."""
        return plan_limits(self._behaviour)

    @property
    def home(self) -> GeoPoint:
        """Where a return goes, and from where relative altitudes count."""
        return self.places.home_point

    def set_home(self, point: GeoPoint, chosen: bool = True) -> str | None:
        """Move home; return why not, or None. A mission's relative altitudes follow, and the fence's limits.

        A home that was ``chosen`` stays when the vehicle arms elsewhere. None is taken that a return could not go
        to, or that would spoil what is being flown.
        """
        return self._home_refusal(point) or self._move_home(point, chosen)

    def _home_refusal(self, point: GeoPoint) -> str | None:
        """Tell why home may not be there: because of the geofence, the mission in flight or the vehicle's place."""
        places = self.places
        there = places.frame.to_ned(point)
        if not all(math.isfinite(number) for number in there):
            return None  # no place at all, as ``SafePlaces.set_home`` says
        if not places.fence.shape.allows(there.x, there.y):
            return "home would be outside the geofence"
        if not self.now.status.armed:
            return None
        spoils = self._spoils_mission(point) if self.now.status.mode is Mode.MISSION else None
        if spoils is not None:
            return spoils
        farthest_m = self._behaviour.fence_max_distance_m
        away_m = distance(self._state[0] - there.x, self._state[1] - there.y)
        if 0.0 < farthest_m < away_m and not self.now.landed and self._behaviour.fence_action > 0.0:
            return f"home would be more than {farthest_m:g} m from the vehicle (GF_MAX_HOR_DIST)"
        return None

    def _spoils_mission(self, home: GeoPoint) -> str | None:
        """Tell what another home would do to the mission in flight.

        Its height must stay: a mission's relative altitudes would follow it at once, into the ground if need be.
        """
        steps_m = abs(home.altitude_m - self.home.altitude_m)
        if steps_m > HOME_SPREAD_M and any(item.altitude_is_relative for item in self.items):
            return "altitudes of the mission in flight count from home: pause it first"
        rejection = self.places.check_mission(self.items, self.limits, home)
        return None if rejection is None else f"the mission in flight would not do: {rejection.reason}"

    def _move_home(self, point: GeoPoint, chosen: bool) -> str | None:
        refusal = self.places.set_home(point, chosen)
        if refusal is None:
            home = self.places.home
            home_ned_m = Vector3(home.north_m, home.east_m, -home.altitude_m)
            self._navigator.change_plan(*self._plan_table())
            self.supervisor.fence.set_home(home_ned_m)
            self._set_bounds()
            self._recorder.home(self.now.time_us, point, home_ned_m)
        return refusal

    @property
    def _home_follows(self) -> bool:
        """Whether home moves to where the vehicle arms."""
        return bool(self._behaviour.home_follows) and not self.places.home_is_chosen

    def _bring_home(self) -> float:
        """Move home to where the vehicle stands, as it arms; return by how much that is higher [m]."""
        places, here = self.places, Vector3(*self._state[:3].tolist())
        before_m = places.home.altitude_m
        if self._home_follows and places.has_left_home(here):
            self._move_home(places.frame.to_geo(here), chosen=False)
        return places.home.altitude_m - before_m

    def _stands_here(self) -> None:
        """Remember where the vehicle stands: there is ground."""
        north_m, east_m, down_m = self._state[:3].tolist()
        self._stood = ReturnPlace(north_m, east_m, -down_m)
        self._set_bounds()

    def ground_m(self, north_m: float, east_m: float) -> float:
        """Return how high the ground is taken to be at a place, above the origin."""
        return self.places.ground_m(north_m, east_m, self._stood)

    def _find_ground(self, return_place: ReturnPlace | None) -> None:
        """Say where the ground is taken to be as a return or a landing begins: there, or at the nearest place known."""
        self._ground_m = -math.inf
        if return_place is not None:
            self._ground_m = return_place.altitude_m
        elif self.now.status.mode is Mode.LAND:
            self._ground_m = self.ground_m(float(self._state[0]), float(self._state[1]))
        self._set_bounds()

    def _set_bounds(self) -> None:
        """Tell guidance where the ground begins, and how high it may climb where no plan says so.

        A descent is slow from the highest ground on: a home or a rally point may have been placed too low.
        """
        home_m, limit_m = self.places.home.altitude_m, self._behaviour.fence_max_altitude_m
        if self.now.status.mode not in (Mode.RETURN, Mode.LAND):  # they end where they were going to
            self._ground_m = -math.inf
        below_m = max(limit_m - CEILING_MARGIN_M, 0.5 * limit_m)
        ceiling_m = home_m + below_m if limit_m > 0.0 else math.inf
        self._navigator.set_bounds(-max(self._ground_m, home_m, self._stood.altitude_m), -ceiling_m)

    def _return_place(self) -> ReturnPlace | None:
        """Return where a return from here goes, or None if all places are outside the geofence."""
        north_m, east_m = float(self._state[0]), float(self._state[1])
        return self.places.return_place(north_m, east_m, self._behaviour.return_type, self._may_be_at)

    def _may_be_at(self, place: ReturnPlace) -> bool:
        if self._behaviour.fence_action == 0.0:
            return True
        above_home_m = place.altitude_m - self.places.home.altitude_m
        return self.supervisor.fence.refusal(place.north_m, place.east_m, above_home_m) is None

    def _plan_table(self) -> tuple[RecordArray, FloatArray]:
        return plan_table(self.items, self.places.frame, self.home.altitude_m)

    def _mission_refusal(self) -> str | None:
        """Tell why the mission would be refused by now: home, limits or geofence may have changed since it came."""
        basis = (self.items, self.home, self.limits, self.places.fence)
        if (
            basis != self._mission_judged[0]
        ):  # a check of 2000 items takes its time, and SYS_STATUS asks again and again
            rejection = self.check_mission(self.items) if self.items else None
            self._mission_judged = basis, None if rejection is None else rejection.reason
        return self._mission_judged[1]

    def check_mission(self, items: Sequence[MissionItem]) -> Rejection | None:
        """Tell why the vehicle would refuse a mission, or None."""
        return self.places.check_mission(items, self.limits)

    def set_mission(self, items: Sequence[MissionItem]) -> None:
        """Take a mission that was checked; one that is being flown begins anew with its first item."""
        self.items = tuple(items)
        self._navigator.set_plan(*self._plan_table())
        self._mission_changed()
        if not self.items:
            self._mission_is_gone()

    def check_fence(self, items: Sequence[MissionItem]) -> Rejection | None:
        """Tell why the vehicle would refuse a geofence, or None: in flight, one that it would break at once."""
        acts_in_air = not self.now.landed and self._behaviour.fence_action > 0.0
        return self.places.check_fence(items, (self._state[0], self._state[1]) if acts_in_air else None)

    def set_fence(self, items: Sequence[MissionItem]) -> None:
        """Take a geofence that was checked; no items remove it."""
        self.supervisor.set_fence(self.places.set_fence(items))

    def check_rally(self, items: Sequence[MissionItem]) -> Rejection | None:
        """Tell why the vehicle would refuse a list of rally points, or None."""
        return self.places.check_rally(items, self.limits)

    def set_rally(self, items: Sequence[MissionItem]) -> None:
        """Take rally points that were checked, for the next return; no items remove them."""
        self.places.set_rally(items)

    def set_current_item(self, seq: int) -> str | None:
        """Make ``seq`` the current item; return why not, or None."""
        refusal = self.item_refusal(seq)
        if refusal is not None:
            return refusal
        self._navigator.set_current(seq)
        self._mission_changed()
        return None

    def item_refusal(self, seq: int) -> str | None:
        """Return why ``seq`` cannot be the current item, or None."""
        return None if 0 <= seq < len(self.items) else f"there is no mission item {seq}"

    def restart_mission(self) -> None:
        """Begin the mission anew: its first item is the current one, jumps count from zero."""
        self._navigator.restart_plan()
        self._mission_changed()

    def _mission_changed(self) -> None:
        now = self.now
        now.progress = self._navigator.progress
        now.mission_count = len(self.items)
        now.mission_complete = False
        self._recorder.mission(now.time_us, now.progress, len(self.items))
