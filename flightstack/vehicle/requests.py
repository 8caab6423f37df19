"""Flight requests of users and companions, and their refusals. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.commander.failsafe import PHASE_OF_MODE, Phase
from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.commander.transitions import RULES, Event, Need, transition
from flightstack.core.enums import Mode, Severity
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.setpoints import Sticks
from flightstack.plan import MissionItem
from flightstack.vehicle.flight_state import FlightState, Journal
from flightstack.vehicle.mode_control import ModeControl, Readiness
from flightstack.vehicle.plans import Mission

PHASE_OF_REQUEST: dict[Event, Phase] = {
    rule.event: PHASE_OF_MODE[rule.mode] for rule in RULES if rule.mode is not None and rule.selects
}
"""Events that select a mode, and the phase of flight that each enters."""


class FlightRequests:
    """Applies requests, or returns the reason of the refusal."""

    def __init__(
        self,
        now: FlightState,
        journal: Journal,
        modes: ModeControl,
        readiness: Readiness,
        failsafes: FailsafeMonitor,
        mission: Mission,
        navigator: Navigator,
    ) -> None:
        self._now = now
        self._journal = journal
        self._modes = modes
        self._readiness = readiness
        self._failsafes = failsafes
        self._mission = mission
        self._navigator = navigator

    # ------------------------------------------------------------------ modes and arming

    def request(self, event: Event, takeoff_altitude_m: float | None = None) -> str | None:
        """Apply ``event`` for a user; return the refusal, or None.

        A refusal to arm lists all reasons. A mode selection overrides the active failsafes that can be overridden.
        ``takeoff_altitude_m`` is above home.
        """
        if event in PHASE_OF_REQUEST:
            return self._select(event, PHASE_OF_REQUEST[event], takeoff_altitude_m)
        if event is Event.ARM:
            reasons = self._readiness.arming_refusals()
            if reasons:
                return "; ".join(reasons)
        refusal = self._modes.apply(event)
        if refusal is None and event is Event.ARM:
            self._modes.check_mission_in_flight()  # home may have moved to the vehicle
        return refusal

    def _select(self, event: Event, phase: Phase, takeoff_altitude_m: float | None = None) -> str | None:
        refusal = self._failsafe_refusal(phase) or self._modes.apply(event, takeoff_altitude_m)
        if refusal is None:
            self._failsafes.override(phase)
        return refusal

    def _failsafe_refusal(self, phase: Phase) -> str | None:
        """Return the reason that an active failsafe denies ``phase``, or None. Applies to an armed vehicle only."""
        return self._failsafes.refusal(phase) if self._now.status.armed else None

    def start_mission(self, first: int | None) -> str | None:
        """Select MISSION, from item ``first`` if given, and arm if disarmed; return the refusal, or None.

        All checks come first: a refused start changes nothing.
        """
        phase = PHASE_OF_REQUEST[Event.SELECT_MISSION]
        arms = not self._now.status.armed
        if arms:
            refusal = "; ".join(self._readiness.arming_refusals(Mode.MISSION, first)) or None
        else:
            facts = self._readiness.facts._replace(mission_takes_off=self._mission.takes_off(first))
            refusal = transition(self._now.status, facts, Event.SELECT_MISSION).refusal
            refusal = refusal or self._mission.refusal() or self._failsafe_refusal(phase)
        if refusal is not None:
            return refusal
        if first is not None:
            self._mission.set_current(first)
        refusal = self._modes.apply(Event.SELECT_MISSION)
        if refusal is not None:
            return refusal
        self._failsafes.override(phase)
        return self.request(Event.ARM) if arms else None

    def terminate(self, reason: str) -> None:
        """Stop the rotors; the vehicle does not fly again before a reboot."""
        self._journal.say(Severity.EMERGENCY, f"Flight terminated: {reason}")
        self._modes.apply(Event.TERMINATE)

    # ------------------------------------------------------------------ guided flight

    def take_sticks(self, sticks: Sticks) -> None:
        """Take the newest stick positions, for POSITION and ALTITUDE mode."""
        self._now.throttle = sticks.up
        self._navigator.set_sticks(sticks)

    def go_to(
        self, north_m: float, east_m: float, down_m: float, yaw_rad: float, speed_m_s: float
    ) -> str | None:
        """Fly to a position [m NED] and hold there; NaN keeps a value. Return the refusal, or None."""
        if not self._now.status.armed or self._now.landed:
            return Need.IN_AIR.value
        moves = math.isfinite(north_m) or math.isfinite(down_m)
        refusal = self._select(Event.SELECT_HOLD, Phase.GOTO if moves else Phase.HOLD)
        if refusal is None:
            self._navigator.reposition(north_m, east_m, down_m, yaw_rad, speed_m_s)
        return refusal

    def set_speeds(self, **speeds: float) -> None:
        """Override speeds [m/s] (fields of ``SpeedOverrides``) until disarmed; NaN restores the parameter."""
        self._navigator.set_speed(self._navigator.speeds._replace(**speeds))

    # ------------------------------------------------------------------ mission

    def set_mission(self, items: Sequence[MissionItem]) -> None:
        """Set a checked mission; no items clear it."""
        self._mission.set(items)
        if not items:
            self._modes.mission_cleared()
