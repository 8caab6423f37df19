"""Automatic disarming on the ground: after a landing, or without a takeoff. Pure."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.commander.transitions import Event
from flightstack.core.periods import NEVER_US
from flightstack.params.behaviour import Behaviour

OFF_GROUND_M = 0.05
"""Vertical distance from the start of the takeoff at which the vehicle is off the ground.

The land detector reports this later, and below a roof or ledge perhaps not at all.
"""
STANDING_M_S = 0.25
"""Largest vertical speed of a vehicle on the ground; PX4's LNDMC_Z_VEL_MAX."""
FALL_M_S, REST_S = 1.0, 0.5
"""A vehicle above this vertical speed falls or rises; it is at rest after this time below it, because the speed is low
for a moment at the top of a bounce."""
FARTHER_M, MORE_LIFT = 0.005, 0.01
"""A takeoff makes progress if it exceeds its extreme heights by this distance, or its largest thrust by this share of
the weight: integrators are slow. Noise exceeds them rarely, and a vehicle that cannot rise never."""


class Standing(NamedTuple):
    """State of a landed vehicle."""

    goes_on: bool
    """True if the mode continues the flight after a landing, now or later."""
    lifts: bool
    """True if the control loops run."""
    down_m: float
    down_m_s: float
    lift: float
    """Thrust setpoint of the loops, as share of the weight."""


class _Takeoff(NamedTuple):
    """A takeoff in progress: where it began, and its extreme values."""

    stood_down_m: float
    least_down_m: float
    most_down_m: float
    most_lift: float


class GroundMonitor:
    """Measures the time since arming, since the last landing, and since the last progress of a takeoff."""

    def __init__(self) -> None:
        self._since_us = 0
        self._has_flown = False
        self._takeoff: _Takeoff | None = None
        self._fell_us: int | None = None

    def update(self, time_us: int, down_m_s: float) -> None:
        """Take the vertical speed, armed or disarmed; once per outer tick."""
        if abs(down_m_s) > FALL_M_S:
            self._fell_us = time_us

    def note_fall(self, time_us: int) -> None:
        """Record that the vehicle fell or rose, or was disarmed in the air."""
        self._fell_us = time_us

    def is_at_rest(self, time_us: int) -> bool:
        """Return True if the vehicle has neither fallen nor risen for ``REST_S``."""
        return self._fell_us is None or time_us - self._fell_us >= REST_S * 1e6

    def armed(self, time_us: int) -> None:
        """Record the arming at the start of a flight."""
        self._since_us, self._has_flown, self._takeoff = time_us, False, None

    def took_off_or_landed(self, time_us: int) -> None:
        """Record a takeoff or a landing."""
        self._has_flown, self._since_us = True, time_us

    def restart_timer(self, time_us: int) -> None:
        """Restart the timer while the plan makes the vehicle wait on the ground."""
        self._since_us = time_us

    def due_event(self, time_us: int, standing: Standing, behaviour: Behaviour) -> Event | None:
        """Return the disarming event that is due on the ground, after a landing or without a takeoff, or None."""
        self.follow(time_us, standing)
        event, wait_s = self._next_event(standing.goes_on, behaviour)
        return event if 0.0 < wait_s <= (time_us - self._since_us) * 1e-6 else None

    def follow(self, time_us: int, standing: Standing) -> None:
        """Take the state of a landed vehicle, after which no event is due."""
        if self._makes_progress(standing) or abs(standing.down_m_s) > STANDING_M_S:
            self._since_us = time_us

    def _next_event(self, goes_on: bool, behaviour: Behaviour) -> tuple[Event, float]:
        """Return the event that follows, and the time after which it does [s]; 0 for never."""
        if self._has_flown and not goes_on:
            return Event.LANDED_LONG_ENOUGH, behaviour.disarm_after_landing_s
        return Event.NO_TAKEOFF, behaviour.disarm_without_takeoff_s

    def due_us(self, *, goes_on: bool, behaviour: Behaviour) -> int:
        """Return a time before which no event is due: progress of a takeoff delays it."""
        _event, wait_s = self._next_event(goes_on, behaviour)
        return self._since_us + math.floor(wait_s * 1e6) if wait_s > 0.0 else NEVER_US

    def stand(self) -> None:
        """Follow calls of ``due_event`` in which the vehicle stood, with its loops stopped."""
        self._takeoff = None

    def _makes_progress(self, now: Standing) -> bool:
        """Return True if a takeoff begins, is off the ground, or exceeds its extreme heights or largest thrust."""
        before, self._takeoff = self._takeoff, None
        if not now.lifts:
            return False
        if before is None:
            self._takeoff = _Takeoff(now.down_m, now.down_m, now.down_m, now.lift)
            return True
        higher = now.down_m < before.least_down_m - FARTHER_M
        lower = now.down_m > before.most_down_m + FARTHER_M
        stronger = now.lift > before.most_lift + MORE_LIFT
        self._takeoff = _Takeoff(
            before.stood_down_m,
            now.down_m if higher else before.least_down_m,
            now.down_m if lower else before.most_down_m,
            now.lift if stronger else before.most_lift,
        )
        is_off = abs(before.stood_down_m - now.down_m) > OFF_GROUND_M
        return higher or lower or stronger or is_off
