"""What events do to mode and arming, and which loops and which guidance fly then. No I/O, no clock."""

from __future__ import annotations

from flightstack.commander.arming_checks import arming_refusals
from flightstack.commander.ground_watch import GroundWatch
from flightstack.commander.transitions import Event, Facts, Need, Outcome, Status, transition
from flightstack.control.backend import ControlBackend
from flightstack.core.geodesy import GeoPoint
from flightstack.core.modes import STREAM_MODES, Mode
from flightstack.guidance.speeds import SpeedOverrides
from flightstack.plan.jumps import takes_off
from flightstack.vehicle.plan_keeper import PlanKeeper
from flightstack.vehicle.snapshot import CRITICAL, NOTICE, WARNING, Text


class ModeKeeper(PlanKeeper):
    """The part of the autopilot that applies events, as the table of ``commander.transitions`` says."""

    backend: ControlBackend
    _takeoff_altitude_m: float
    """Of the next takeoff, above the origin of the local frame."""
    has_state: bool
    """Whether a state has arrived yet."""

    def __init__(self, home: GeoPoint) -> None:
        super().__init__(home)
        self._flying = False
        self._loops_begin = False  # in this tick
        self._ground = GroundWatch()
        self._throttle = 0.0

    # ------------------------------------------------------------------ what is

    @property
    def facts(self) -> Facts:
        """What the transition table asks about."""
        known = self.supervisor.arming_facts(self.now.status.mode, self.has_state)
        return Facts(
            state_is_valid=known.state_is_valid and known.state_is_fresh,
            upright=known.upright,
            landed=self.now.landed,
            has_mission=bool(self.items),
            mission_takes_off=self._mission_takes_off(),
            manual_fresh=known.manual_fresh,
            offboard_fresh=known.offboard_fresh,
        )

    def _mission_takes_off(self, first: int | None = None) -> bool:
        """Return whether a standing vehicle leaves the ground from item ``first``, or the current one, on."""
        progress = self._navigator.progress
        current = 0 if progress.finished else progress.current  # a finished mission begins anew
        return takes_off(self.items, current if first is None else first)

    def arming_refusals(self, mode: Mode | None = None, first: int | None = None) -> tuple[str, ...]:
        """Return every reason for which the vehicle would not arm now, or in ``mode``; empty when it would.

        ``first`` is the item that will be the mission's current one, if it is another.
        """
        mode = self.now.status.mode if mode is None else mode
        known = self.supervisor.arming_facts(mode, self.has_state)
        known = known._replace(throttle=self._throttle, mode_fault=self._fault_on_ground(mode, first) or "")
        known = known._replace(is_at_rest=self._ground.is_at_rest(self.now.time_us))
        return arming_refusals(known, self._behaviour)

    def _fault_on_ground(self, mode: Mode, first: int | None) -> str | None:
        """Return why ``mode`` does not take a standing vehicle into the air, now or later, or None."""
        if mode in (Mode.RETURN, Mode.LAND):
            return f"{mode.name.lower()} mode cannot take off: select another mode first"
        if mode is not Mode.MISSION:
            return None
        if not self.items:
            return Need.MISSION.value
        return self._mission_refusal() if self._mission_takes_off(first) else Need.TAKES_OFF.value

    def say(self, severity: int, text: str) -> None:
        """Tell the operator and the log."""
        self.now.texts.append(Text(severity, text))
        self._recorder.text(self.now.time_us, severity, text)

    # ------------------------------------------------------------------ events

    def _apply(self, event: Event, takeoff_altitude_m: float | None = None) -> str | None:
        """Let an event happen; return why it was refused, or None."""
        before = self.now.status
        outcome: Outcome = transition(before, self.facts, event)
        if outcome.refusal is not None:
            return outcome.refusal
        if event is Event.SELECT_TAKEOFF:
            refusal = self._set_takeoff_altitude(takeoff_altitude_m)
            if refusal is not None:
                return refusal
        if event is Event.SELECT_MISSION and before.armed:
            refusal = self._mission_refusal()
            if refusal is not None:
                return refusal
        if self._begins_return(before, outcome.status) and self._return_place() is None:
            if before.mode is not Mode.LAND:
                self.say(WARNING, "No place to return to is inside the geofence: landing")
            return self._apply(Event.SELECT_LAND)
        self._adopt(before, outcome.status, event)
        return None

    def _set_takeoff_altitude(self, above_home_m: float | None) -> str | None:
        """Take the altitude of a takeoff, for None the parameter's above home and vehicle; return why not, or None."""
        stands_m = self._stands_above_home_m()
        default_m = max(stands_m, 0.0) + self._behaviour.takeoff_altitude_m
        altitude = default_m if above_home_m is None else above_home_m
        if altitude - stands_m < self._behaviour.altitude_acceptance_m < altitude:
            return f"takeoff altitude {altitude:g} m is not above the vehicle, which is at {stands_m:.4g} m above home"
        if not altitude > self._behaviour.altitude_acceptance_m:
            return f"takeoff altitude {altitude:g} m is too low"
        if altitude > self.limits.max_altitude_m:
            return f"takeoff altitude {altitude:g} m is above {self.limits.max_altitude_m:g} m"
        self._takeoff_altitude_m = altitude + self.places.home.altitude_m
        return None

    @property
    def home_at_takeoff_m(self) -> float:
        """Altitude above the sea of home as it will be when the vehicle takes off: it may come along on arming."""
        comes_along = not self.now.status.armed and self._home_follows and self.facts.state_is_valid
        return (
            self.places.frame.origin.altitude_m - float(self._state[2])
            if comes_along
            else self.home.altitude_m
        )

    def _stands_above_home_m(self) -> float:
        """Return the height of a standing vehicle above home as it will be when it takes off; 0 if it is not known."""
        if not self.facts.state_is_valid:
            return 0.0
        return self.places.frame.origin.altitude_m - float(self._state[2]) - self.home_at_takeoff_m

    def _begins_return(self, before: Status, after: Status) -> bool:
        return after.mode is Mode.RETURN and before.mode is not Mode.RETURN and not self.now.landed

    def _check_mission_anew(self) -> None:
        """Hold instead of flying a mission that home or limits have made one to refuse."""
        status = self.now.status
        refusal = self._mission_refusal() if status.armed and status.mode is Mode.MISSION else None
        if refusal is not None:
            self.say(WARNING, f"Mission held: {refusal}")
            self._apply(Event.SELECT_HOLD)

    def _mission_is_gone(self) -> None:
        if self.now.status.mode is Mode.MISSION:
            self._apply(Event.SELECT_HOLD)  # not a user's choice: failsafes are not overridden

    def _adopt(self, before: Status, after: Status, event: Event) -> None:
        self.now.status = after
        if after.armed and not before.armed:
            self._begin_flight()
        if before.armed and not after.armed:  # the log ends with disarming: its last words come first
            in_air = not self.now.landed
            if in_air:
                self._ground.dropped(self.now.time_us)
            self.say(CRITICAL if in_air else NOTICE, "Disarmed in the air" if in_air else "Disarmed")
        if after != before:
            self._recorder.status(self.now.time_us, after)
        if after.armed and not before.armed:
            self.say(NOTICE, "Armed")
        if not after.armed:
            self.now.landed = True
            self._navigator.set_speed(SpeedOverrides())
        if after.mode is Mode.MISSION and before.mode is not Mode.MISSION:
            self.now.mission_complete = False
            if self._navigator.progress.finished and self.items:
                self.restart_mission()  # before the loops are chosen: a finished mission does not rise
        if event in (Event.TAKEOFF_REACHED, Event.MISSION_FINISHED):
            if event is Event.MISSION_FINISHED:
                self._navigator.hold_at_last_item()
            self._choose_loops()
        else:
            reentered = event in (Event.SELECT_TAKEOFF, Event.SELECT_HOLD)
            self._choose_loops(entering=after.mode is not before.mode or reentered)

    def _begin_flight(self) -> None:
        """Forget the flight before: the vehicle arms."""
        self.now.armed_us = self.now.time_us
        self.now.takeoff_us = self.now.landing_us = 0
        self.supervisor.armed()
        self._ground.armed(self.now.time_us)
        self._takeoff_altitude_m += self._bring_home()
        self.now.landed = True
        self._stands_here()
        self._navigator.rest_at(self._state)  # guidance may remember a flight that ended in the air

    # ------------------------------------------------------------------ loops and guidance

    def _choose_loops(self, entering: bool = False) -> None:
        """Start or stop the loops, and let guidance enter the mode."""
        status = self.now.status
        flying = status.armed and (not self.now.landed or self._rises())
        starting = flying and not self._flying
        if starting:
            self.backend.reset(self._state)
            self._loops_begin = True
            self._navigator.rest_at(self._state)
        if entering:
            place = (self._return_place() or self.places.home) if status.mode is Mode.RETURN else None
            if place is not None:
                self._navigator.return_to(place.north_m, place.east_m, -place.altitude_m)
            self._find_ground(place)
        if starting or (flying and entering):
            self._navigator.enter(status.mode, self._takeoff_altitude_m)
        self._flying = flying

    def _rises(self) -> bool:
        """Tell whether the mode makes a standing vehicle leave the ground."""
        mode = self.now.status.mode
        if mode in STREAM_MODES:
            return self._navigator.wants_to_rise(mode, -self._stood.altitude_m)
        return mode is Mode.TAKEOFF or (mode is Mode.MISSION and self._navigator.mission_flies)
