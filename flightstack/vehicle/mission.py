"""The mission in force: its items, its checks and its progress. No I/O, no clock."""

from __future__ import annotations

from collections.abc import Sequence

from flightstack.core.geodesy import GeoPoint
from flightstack.guidance.mission import plan_table
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.safe_places import HOME_SPREAD_M, SafePlaces, plan_limits
from flightstack.plan import MissionItem, Rejection
from flightstack.plan.jumps import takes_off
from flightstack.vehicle.flight_state import FlightState, Journal


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
