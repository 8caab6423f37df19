"""What the vehicle is to fly and where it may: mission, geofence, rally points, home. No I/O, no clock."""

from __future__ import annotations

from collections.abc import Sequence

from flightstack.commander.supervisor import Supervisor
from flightstack.contract import FloatArray, Vector3
from flightstack.geodesy import GeoPoint
from flightstack.guidance.mission import LAND, NAV_DELAY, RETURN_TO_LAUNCH
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.plan_table import plan_table
from flightstack.guidance.safe_places import SafePlaces, plan_limits
from flightstack.params.behaviour import Behaviour
from flightstack.plan import MissionItem, Rejection
from flightstack.plan.check import Limits
from flightstack.snapshot import Recorder, Snapshot


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

        A home that was ``chosen`` stays when the vehicle arms elsewhere.
        """
        refusal = self.places.set_home(point, chosen)
        if refusal is None:
            home = self.places.home
            home_ned_m = Vector3(home.north_m, home.east_m, -home.altitude_m)
            self._navigator.change_plan(*self._plan_table())
            self.supervisor.set_home(home_ned_m)
            self._recorder.home(self.now.time_us, point, home_ned_m)
        return refusal

    def _bring_home(self) -> float:
        """Move home to where the vehicle stands, as it arms; return by how much that is higher [m]."""
        places, here = self.places, Vector3(*self._state[:3].tolist())
        before_m = places.home.altitude_m
        follows = self._behaviour.home_follows and not places.home_is_chosen
        if follows and places.has_left_home(here):
            self.set_home(places.frame.to_geo(here), chosen=False)
        return places.home.altitude_m - before_m

    def _plan_table(self) -> tuple[FloatArray, FloatArray]:
        return plan_table(self.items, self.places.frame, self.home.altitude_m)

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
        if not 0 <= seq < len(self.items):
            return f"there is no mission item {seq}"
        self._navigator.set_current(seq)
        self._mission_changed()
        return None

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

    def _mission_takes_off(self) -> bool:
        """Tell whether the mission leaves the ground: by a takeoff, or on the way to its first position."""
        for item in self.items:
            if item.command < NAV_DELAY:  # the first item that moves the vehicle
                return item.command not in (LAND, RETURN_TO_LAUNCH)
        return False
