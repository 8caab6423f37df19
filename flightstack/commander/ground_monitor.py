"""Whether a vehicle stands on the ground, and when it is disarmed there. Pure."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.commander.transitions import Event
from flightstack.params.behaviour import Behaviour

OFF_GROUND_M = 0.05
"""Distance above or below where the rotors began to lift from which on the vehicle is off the ground.

The land detector finds that later, and below a roof or ledge perhaps not at all.
"""
STANDING_M_S = 0.25
"""Vertical speed up to which a vehicle may stand; PX4's LNDMC_Z_VEL_MAX."""
FALL_M_S, REST_S = 1.0, 0.5
"""A vehicle beyond this vertical speed falls or rises, and is at rest after so long below it: at the top of a bounce it
is slow for a moment."""
FARTHER_M, MORE_LIFT = 0.005, 0.01
"""A takeoff makes progress when it is higher or lower than ever by so much, or asks for so much more thrust than ever,
as share of the weight: integrators are slow. Noise sets few such records, and a vehicle that cannot rise none."""


class Standing(NamedTuple):
    """What a vehicle does that the land detector has on the ground."""

    goes_on: bool
    """Whether its mode flies on after a landing, now or later."""
    lifts: bool
    """Whether the loops fly it."""
    down_m: float
    down_m_s: float
    lift: float
    """Thrust that the loops ask for, as share of the weight."""


class _Takeoff(NamedTuple):
    """A takeoff under way: where it began, and its records."""

    stood_down_m: float
    least_down_m: float
    most_down_m: float
    most_lift: float


class GroundMonitor:
    """Counts the time since arming, since the last landing, and since a takeoff last made progress."""

    def __init__(self) -> None:
        self._since_us = 0
        self._has_flown = False
        self._takeoff: _Takeoff | None = None
        self._fell_us: int | None = None

    def update(self, time_us: int, down_m_s: float) -> None:
        """Take the vertical speed, armed or not; once per outer tick."""
        if abs(down_m_s) > FALL_M_S:
            self._fell_us = time_us

    def disarmed_in_air(self, time_us: int) -> None:
        """Note that the vehicle was disarmed in the air."""
        self._fell_us = time_us

    def is_at_rest(self, time_us: int) -> bool:
        """Return whether the vehicle has neither fallen nor risen for a while."""
        return self._fell_us is None or time_us - self._fell_us >= REST_S * 1e6

    def armed(self, time_us: int) -> None:
        """Note the arming: a flight begins."""
        self._since_us, self._has_flown, self._takeoff = time_us, False, None

    def took_off_or_landed(self, time_us: int) -> None:
        """Note a takeoff or a landing."""
        self._has_flown, self._since_us = True, time_us

    def restart_timer(self, time_us: int) -> None:
        """Count anew: the plan makes the vehicle wait on the ground."""
        self._since_us = time_us

    def due_event(self, time_us: int, standing: Standing, behaviour: Behaviour) -> Event | None:
        """Return the event that is due while the vehicle stands: disarming after a landing, or without a takeoff."""
        if self._makes_progress(standing) or abs(standing.down_m_s) > STANDING_M_S:
            self._since_us = time_us
        after_landing = self._has_flown and not standing.goes_on
        event = Event.LANDED_LONG_ENOUGH if after_landing else Event.NO_TAKEOFF
        wait_s = behaviour.disarm_after_landing_s if after_landing else behaviour.disarm_without_takeoff_s
        return event if 0.0 < wait_s <= (time_us - self._since_us) * 1e-6 else None

    def _makes_progress(self, now: Standing) -> bool:
        """Tell whether a takeoff begins, is off the ground, or sets a record of height, depth or thrust."""
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
