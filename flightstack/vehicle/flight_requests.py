"""What users and companions may ask of a flight, and when it is granted. No I/O, no clock."""

from __future__ import annotations

import math

from flightstack.commander.failsafe import PHASE_OF_MODE, Phase
from flightstack.commander.transitions import RULES, Event, Need, transition
from flightstack.core.modes import Mode
from flightstack.guidance.params import guidance_params
from flightstack.guidance.setpoints import OffboardSetpoint, Sticks
from flightstack.guidance.speeds import SpeedOverrides
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle
from flightstack.vehicle.mode_keeper import ModeKeeper
from flightstack.vehicle.snapshot import EMERGENCY

USERS_CHOICES: dict[Event, Phase] = {
    rule.event: PHASE_OF_MODE[rule.mode] for rule in RULES if rule.mode is not None and rule.selects
}
"""What a user selects, and the phase of flight that it begins."""


class FlightRequests(ModeKeeper):
    """The part of the autopilot that does what it is asked, or says why not."""

    _vehicle: Vehicle
    _max_thrust_n: float

    # ------------------------------------------------------------------ modes and arming

    def happen(self, event: Event, takeoff_altitude_m: float | None = None) -> str | None:
        """Apply what a user asks for; return why it was refused, or None.

        Arming is refused with all reasons at once. A mode that a user selects overrides the failsafes of the moment,
        where they can be overridden.
        """
        if event in USERS_CHOICES:
            return self._select(event, USERS_CHOICES[event], takeoff_altitude_m)
        if event is Event.ARM:
            reasons = self.arming_refusals()
            if reasons:
                return "; ".join(reasons)
        refusal = self._apply(event)
        if refusal is None and event is Event.ARM:
            self._check_mission_anew()  # home has come along
        return refusal

    def _select(self, event: Event, phase: Phase, takeoff_altitude_m: float | None = None) -> str | None:
        """Let a user begin ``phase`` by ``event``; return why not, or None."""
        refusal = self._failsafe_refusal(phase) or self._apply(event, takeoff_altitude_m)
        if refusal is None:
            self.supervisor.override(phase)
        return refusal

    def _failsafe_refusal(self, phase: Phase) -> str | None:
        """Return why a failsafe denies flying in ``phase``, or None; failsafes deny a disarmed vehicle nothing."""
        return self.supervisor.refusal(phase) if self.now.status.armed else None

    def start_mission(self, first: int | None) -> str | None:
        """Select the mission, from item ``first`` if it is given, and arm where need be; return why not, or None.

        A start that is refused changes nothing: everything is asked first.
        """
        phase = USERS_CHOICES[Event.SELECT_MISSION]
        arms = not self.now.status.armed
        if arms:
            refusal = "; ".join(self.arming_refusals(Mode.MISSION, first)) or None
        else:
            facts = self.facts._replace(mission_takes_off=self._mission_takes_off(first))
            refusal = transition(self.now.status, facts, Event.SELECT_MISSION).refusal
            refusal = refusal or self._mission_refusal() or self._failsafe_refusal(phase)
        if refusal is not None:
            return refusal
        if first is not None:
            self.set_current_item(first)
        refusal = self._apply(Event.SELECT_MISSION)
        if refusal is not None:
            return refusal
        self.supervisor.override(phase)
        return self.happen(Event.ARM) if arms else None

    def terminate(self, reason: str) -> None:
        """Stop the rotors for good: nothing flies again before a reboot."""
        self.say(EMERGENCY, f"Flight terminated: {reason}")
        self._apply(Event.TERMINATE)

    # ------------------------------------------------------------------ guided flight

    def take_offboard(self, setpoint: OffboardSetpoint) -> None:
        """Remember the newest offboard setpoint; it is flown in OFFBOARD."""
        self._navigator.set_offboard(setpoint, self._max_thrust_n)

    def take_sticks(self, sticks: Sticks) -> None:
        """Remember the sticks; they are flown in POSITION and ALTITUDE."""
        self._throttle = sticks.up
        self._navigator.set_sticks(sticks)

    def go_to(
        self, north_m: float, east_m: float, down_m: float, yaw_rad: float, speed_m_s: float
    ) -> str | None:
        """Hold at a place [m NED]; NaN leaves what is. Return why not, or None."""
        if not self.now.status.armed or self.now.landed:
            return Need.IN_AIR.value
        goes = math.isfinite(north_m) or math.isfinite(down_m)
        refusal = self._select(Event.SELECT_HOLD, Phase.GOTO if goes else Phase.HOLD)
        if refusal is None:
            self._navigator.reposition(north_m, east_m, down_m, yaw_rad, speed_m_s)
        return refusal

    @property
    def speeds(self) -> SpeedOverrides:
        """Speeds that were commanded in place of the parameters'."""
        return self._navigator.speeds

    def set_speeds(self, speeds: SpeedOverrides) -> None:
        """Fly at other speeds until disarmed."""
        self._navigator.set_speed(speeds)

    # ------------------------------------------------------------------ parameters

    @property
    def behaviour(self) -> Behaviour:
        """The parameters of guidance and commander."""
        return self._behaviour

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Fly by other parameters, from the next outer tick on."""
        limits, self._behaviour = self.limits, behaviour
        self._navigator.set_params(guidance_params(behaviour, self._vehicle.weight_n))
        self.supervisor.set_behaviour(behaviour)
        self._set_bounds()
        if self.limits != limits:
            self._check_mission_anew()
