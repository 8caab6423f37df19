"""Plans in force: mission, geofence and rally points, and home and ground that they count from. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.commander.fence_monitor import FenceMonitor
from flightstack.core.contract import Vector3
from flightstack.core.enums import Mode, Severity
from flightstack.core.geodesy import GeoPoint
from flightstack.core.portable_math import distance
from flightstack.guidance.mission import plan_table
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.rally import HOME, ReturnPlace
from flightstack.guidance.safe_places import HOME_SPREAD_M, SafePlaces, plan_limits
from flightstack.plan import MissionItem, Rejection
from flightstack.plan.jumps import takes_off
from flightstack.vehicle.flight_state import FlightState, Journal

CEILING_MARGIN_M = 1.0
"""Distance of a return below GF_MAX_VER_DIST, so that a breach of it ends (``fence.HYSTERESIS_M``)."""


class Mission:
    """Holds the items of the mission, and loads them into guidance."""

    def __init__(self, now: FlightState, places: SafePlaces, navigator: Navigator, journal: Journal) -> None:
        self.items: tuple[MissionItem, ...] = ()
        self._now = now
        self._places = places
        self._navigator = navigator
        self._journal = journal
        self._checked: tuple[object, str | None] = (None, None)

    # ------------------------------------------------------------------ checks

    def check(self, items: Sequence[MissionItem], home: GeoPoint | None = None) -> Rejection | None:
        """Return the rejection of ``items`` as a mission from ``home`` (default: home in force), or None."""
        return self._places.check_mission(items, plan_limits(self._now.behaviour), home)

    def refusal(self) -> str | None:
        """Return the reason that the mission in force is refused now, or None.

        Home, limits or geofence may have changed since its upload. SYS_STATUS needs the result repeatedly and a check
        of 2000 items takes long, so the result is cached until one of them changes.
        """
        places = self._places
        basis = (self.items, places.home_point, plan_limits(self._now.behaviour), places.fence)
        if basis != self._checked[0]:
            rejection = self.check(self.items) if self.items else None
            self._checked = basis, None if rejection is None else rejection.reason
        return self._checked[1]

    def home_refusal(self, home: GeoPoint) -> str | None:
        """Return the reason that home may not move to ``home`` during this mission, or None.

        The altitude of home must not change: relative altitudes of the mission would follow it, even into the ground.
        """
        step_m = abs(home.altitude_m - self._places.home_point.altitude_m)
        if step_m > HOME_SPREAD_M and any(item.altitude_is_relative for item in self.items):
            return "altitudes of the mission in flight count from home: pause it first"
        rejection = self.check(self.items, home)
        return None if rejection is None else f"the mission in flight would not do: {rejection.reason}"

    def takes_off(self, first: int | None = None) -> bool:
        """Return True if the mission takes off a vehicle on the ground, from item ``first`` or the current item."""
        progress = self._navigator.progress
        current = 0 if progress.finished else progress.current  # a finished mission restarts
        return takes_off(self.items, current if first is None else first)

    def item_refusal(self, seq: int) -> str | None:
        """Return the reason that ``seq`` cannot be the current item, or None."""
        return None if 0 <= seq < len(self.items) else f"there is no mission item {seq}"

    # ------------------------------------------------------------------ changes

    def set(self, items: Sequence[MissionItem]) -> None:
        """Set a checked mission; it starts at its first item, in flight too."""
        self.items = tuple(items)
        self._navigator.set_plan(*plan_table(self.items, self._places.frame, self._home_m))
        self._restarted()

    def home_moved(self) -> None:
        """Compute the positions of the items from the new home; the mission continues."""
        self._navigator.change_plan(*plan_table(self.items, self._places.frame, self._home_m))

    def set_current(self, seq: int) -> str | None:
        """Make ``seq`` the current item; return the refusal, or None."""
        refusal = self.item_refusal(seq)
        if refusal is None:
            self._navigator.set_current(seq)
            self._restarted()
        return refusal

    def restart(self) -> None:
        """Make the first item the current one and reset the counts of DO_JUMP."""
        self._navigator.restart_plan()
        self._restarted()

    def restart_if_finished(self) -> None:
        """Restart a finished mission."""
        self._now.mission_complete = False
        if self._navigator.progress.finished and self.items:
            self.restart()

    def report_progress(self) -> bool:
        """Announce and record progress since the last call; return True if there is any."""
        now, navigator = self._now, self._navigator
        progress, count = navigator.progress, len(self.items)
        if progress == now.progress:
            return False
        reached = navigator.reached_items()
        for seq in reached:
            self._journal.item_reached(seq, progress, count)
        if not reached:
            self._journal.mission(progress, count)
        now.progress = progress
        return True

    @property
    def _home_m(self) -> float:
        return self._places.home_point.altitude_m

    def _restarted(self) -> None:
        now = self._now
        now.progress = self._navigator.progress
        now.mission_count = len(self.items)
        now.mission_complete = False
        self._journal.mission(now.progress, len(self.items))


class FlightArea:
    """Holds home, geofence, rally points, and the height of the ground."""

    def __init__(
        self,
        now: FlightState,
        places: SafePlaces,
        fence: FenceMonitor,
        mission: Mission,
        navigator: Navigator,
        journal: Journal,
    ) -> None:
        self.fence = fence
        self._now = now
        self._places = places
        self._mission = mission
        self._navigator = navigator
        self._journal = journal
        self._ground_m = -math.inf  # above the origin, at the end of a return or landing
        self._last_ground = HOME  # position where the vehicle armed or landed last
        self.set_bounds()

    # ------------------------------------------------------------------ home

    @property
    def home(self) -> GeoPoint:
        """Destination of a return, and reference of relative altitudes."""
        return self._places.home_point

    @property
    def home_above_origin_m(self) -> float:
        """Height of home above the origin of the local frame."""
        return self._places.home.altitude_m

    @property
    def home_follows(self) -> bool:
        """True if home moves to the position where the vehicle arms."""
        return bool(self._now.behaviour.home_follows) and not self._places.home_is_chosen

    def set_home(self, point: GeoPoint, chosen: bool = True) -> str | None:
        """Move home; return the refusal, or None. Relative altitudes of the mission and limits of the fence follow.

        A ``chosen`` home stays when the vehicle arms elsewhere. A home is refused if a return could not reach it, or
        if it would make the mission in flight invalid.
        """
        return self._home_refusal(point) or self._move_home(point, chosen)

    def set_home_here(self) -> str | None:
        """Move home to the vehicle; return the refusal, or None."""
        return self.set_home(self._places.frame.to_geo(self._here()), chosen=False)

    def await_origin(self) -> None:
        """Accept a home anywhere until the first fix."""
        self._places.await_origin()

    def move_origin(self, origin: GeoPoint) -> None:
        """Move the origin of the local frame, as at the first fix; announce a chosen home that cannot stay."""
        refusal = self._places.move_origin(origin)
        if refusal is not None:
            self._journal.say(Severity.WARNING, f"Home moved to the origin: {refusal}")
        self._journal.origin(origin)
        self.fence.set_fence(self._places.fence)
        self._home_moved()

    def move_home_on_arming(self) -> float:
        """Move home to the arming vehicle if it follows; return the change of its altitude [m]."""
        places, here = self._places, self._here()
        before_m = places.home.altitude_m
        if self.home_follows and places.has_left_home(here):
            self._move_home(places.frame.to_geo(here), chosen=False)
        return places.home.altitude_m - before_m

    def _here(self) -> Vector3:
        return Vector3(*self._now.state[:3].tolist())

    def _home_refusal(self, point: GeoPoint) -> str | None:
        places, now, behaviour = self._places, self._now, self._now.behaviour
        there = places.frame.to_ned(point)
        if not all(math.isfinite(number) for number in there):
            return None  # ``SafePlaces.set_home`` returns the refusal
        if not places.fence.shape.allows(there.x, there.y):
            return "home would be outside the geofence"
        if not now.status.armed:
            return None
        refusal = self._mission.home_refusal(point) if now.status.mode is Mode.MISSION else None
        if refusal is not None:
            return refusal
        farthest_m = behaviour.fence_max_distance_m
        away_m = distance(now.state[0] - there.x, now.state[1] - there.y)
        if 0.0 < farthest_m < away_m and not now.landed and behaviour.fence_action > 0.0:
            return f"home would be more than {farthest_m:g} m from the vehicle (GF_MAX_HOR_DIST)"
        return None

    def _move_home(self, point: GeoPoint, chosen: bool) -> str | None:
        refusal = self._places.set_home(point, chosen)
        if refusal is None:
            self._home_moved()
        return refusal

    def _home_moved(self) -> None:
        home = self._places.home
        home_ned_m = Vector3(home.north_m, home.east_m, -home.altitude_m)
        self._mission.home_moved()
        self.fence.set_home(home_ned_m)
        self.set_bounds()
        self._journal.home(self._places.home_point, home_ned_m)

    # ------------------------------------------------------------------ ground

    def set_ground_here(self) -> None:
        """Store the vehicle's position as a point on the ground."""
        here = self._here()
        self._last_ground = ReturnPlace(here.x, here.y, -here.z)
        self.set_bounds()

    @property
    def stood_down_m(self) -> float:
        """Down coordinate at which the vehicle armed or landed last [m NED]."""
        return -self._last_ground.altitude_m

    def ground_m(self, north_m: float, east_m: float) -> float:
        """Return the estimated height of the ground above the origin at a position [m]."""
        return self._places.ground_m(north_m, east_m, self._last_ground)

    def find_ground(self, return_place: ReturnPlace | None) -> None:
        """Estimate the height of the ground at the end of a starting return or landing.

        It is that of the return place or, for a landing, of the nearest known ground.
        """
        self._ground_m = -math.inf
        if return_place is not None:
            self._ground_m = return_place.altitude_m
        elif self._now.status.mode is Mode.LAND:
            here = self._here()
            self._ground_m = self.ground_m(here.x, here.y)
        self.set_bounds()

    def set_bounds(self) -> None:
        """Set the height of the ground in guidance, and the ceiling of climbs outside a plan.

        A descent slows down from the highest known ground: home or a rally point may have been placed too low.
        """
        now = self._now
        home_m, limit_m = self._places.home.altitude_m, now.behaviour.fence_max_altitude_m
        if now.status.mode not in (Mode.RETURN, Mode.LAND):
            self._ground_m = -math.inf
        below_m = max(limit_m - CEILING_MARGIN_M, 0.5 * limit_m)
        ceiling_m = home_m + below_m if limit_m > 0.0 else math.inf
        self._navigator.set_bounds(-max(self._ground_m, home_m, self._last_ground.altitude_m), -ceiling_m)

    # ------------------------------------------------------------------ return

    def return_place(self) -> ReturnPlace | None:
        """Return the destination of a return from here, or None if all are outside the geofence."""
        here = self._here()
        return self._places.return_place(here.x, here.y, self._now.behaviour.return_type, self._is_allowed)

    def return_destination(self) -> ReturnPlace:
        """Return the destination of a return from here; home if the geofence allows none."""
        return self.return_place() or self._places.home

    def _is_allowed(self, place: ReturnPlace) -> bool:
        if self._now.behaviour.fence_action == 0.0:
            return True
        above_home_m = place.altitude_m - self._places.home.altitude_m
        return self.fence.refusal(place.north_m, place.east_m, above_home_m) is None

    # ------------------------------------------------------------------ geofence and rally points

    def way_refusal(self, here: tuple[float, float, float], there: tuple[float, float, float]) -> str | None:
        """Return the reason that the geofence denies the direct path to a position (north, east, above home) [m]."""
        return self.fence.way_refusal(here, there) if self._now.behaviour.fence_action else None

    def check_fence(self, items: Sequence[MissionItem]) -> Rejection | None:
        """Return the rejection of a geofence, or None. In flight, a fence that is breached at once is rejected."""
        now = self._now
        acts_in_air = not now.landed and now.behaviour.fence_action > 0.0
        return self._places.check_fence(items, (now.state[0], now.state[1]) if acts_in_air else None)

    def set_fence(self, items: Sequence[MissionItem]) -> None:
        """Set a checked geofence; no items remove it."""
        self.fence.set_fence(self._places.set_fence(items))

    def check_rally(self, items: Sequence[MissionItem]) -> Rejection | None:
        """Return the rejection of a list of rally points, or None."""
        return self._places.check_rally(items, plan_limits(self._now.behaviour))

    def set_rally(self, items: Sequence[MissionItem]) -> None:
        """Set checked rally points for the next return; no items remove them."""
        self._places.set_rally(items)
