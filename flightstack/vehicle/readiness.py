"""Readiness to arm and to change mode. No I/O, no clock."""

from __future__ import annotations

from flightstack.commander.arming_checks import arming_refusals
from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.commander.ground_monitor import GroundMonitor
from flightstack.commander.transitions import Facts, Need
from flightstack.core.enums import Mode
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.mission import Mission


class Readiness:
    """Provides the facts of the transition table and the results of the arming checks."""

    def __init__(
        self, now: FlightState, failsafes: FailsafeMonitor, ground: GroundMonitor, mission: Mission
    ) -> None:
        self._now = now
        self._failsafes = failsafes
        self._ground = ground
        self._mission = mission

    @property
    def facts(self) -> Facts:
        """Facts that the transition table needs."""
        now = self._now
        known = self._failsafes.arming_facts(now.status.mode, now.has_state)
        return Facts(
            state_is_valid=known.state_is_valid and known.state_is_fresh,
            upright=known.upright,
            landed=now.landed,
            has_mission=bool(self._mission.items),
            mission_takes_off=self._mission.takes_off(),
            manual_fresh=known.manual_fresh,
            offboard_fresh=known.offboard_fresh,
        )

    def arming_refusals(self, mode: Mode | None = None, first: int | None = None) -> tuple[str, ...]:
        """Return every reason against arming, in the current mode or in ``mode``; empty if the vehicle would arm.

        ``first`` is the first mission item (default: the current one).
        """
        now = self._now
        mode = now.status.mode if mode is None else mode
        known = self._failsafes.arming_facts(mode, now.has_state)
        known = known._replace(throttle=now.throttle, mode_fault=self._fault_on_ground(mode, first) or "")
        known = known._replace(is_at_rest=self._ground.is_at_rest(now.time_us))
        return arming_refusals(known, now.behaviour)

    def _fault_on_ground(self, mode: Mode, first: int | None) -> str | None:
        """Return the reason that ``mode`` cannot take off, or None."""
        if mode in (Mode.RETURN, Mode.LAND):
            return f"{mode.name.lower()} mode cannot take off: select another mode first"
        if mode is not Mode.MISSION:
            return None
        if not self._mission.items:
            return Need.MISSION.value
        return self._mission.refusal() if self._mission.takes_off(first) else Need.TAKES_OFF.value
