"""Readiness to arm, transitions of mode and arming, takeoff, start of loops and guidance. No I/O, no clock."""

from __future__ import annotations

from flightstack.commander.arming_checks import arming_refusals
from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.commander.ground_monitor import GroundMonitor
from flightstack.commander.transitions import Event, Facts, Need, Status, transition
from flightstack.control.backend import ControlBackend
from flightstack.core.enums import STREAM_MODES, Mode, Severity
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.params import SpeedOverrides
from flightstack.guidance.safe_places import SafePlaces, plan_limits
from flightstack.vehicle.flight_state import FlightState, Journal
from flightstack.vehicle.plans import FlightArea, Mission


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
            position_is_known=self._failsafes.position_is_known,
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


class Takeoff:
    """Holds the altitude to which TAKEOFF mode climbs."""

    def __init__(self, now: FlightState, places: SafePlaces, area: FlightArea, readiness: Readiness) -> None:
        self._now = now
        self._area = area
        self._readiness = readiness
        self._places = places
        self.altitude_m = now.behaviour.takeoff_altitude_m
        """Target altitude above the origin of the local frame."""

    def set_altitude(self, above_home_m: float | None) -> str | None:
        """Set the altitude above home; None stands for MIS_TAKEOFF_ALT above both home and vehicle.

        Return the refusal, or None.
        """
        b = self._now.behaviour
        limit_m, vehicle_m = plan_limits(b).max_altitude_m, self._vehicle_above_home_m()
        altitude = max(vehicle_m, 0.0) + b.takeoff_altitude_m if above_home_m is None else above_home_m
        if altitude - vehicle_m < b.altitude_acceptance_m < altitude:
            return f"takeoff altitude {altitude:g} m is not above the vehicle, which is at {vehicle_m:.4g} m above home"
        if not altitude > b.altitude_acceptance_m:
            return f"takeoff altitude {altitude:g} m is too low"
        if altitude > limit_m:
            return f"takeoff altitude {altitude:g} m is above {limit_m:g} m"
        self.altitude_m = altitude + self._places.home.altitude_m
        return None

    @property
    def is_reached(self) -> bool:
        """True if the vehicle is at the takeoff altitude, within NAV_MC_ALT_RAD."""
        error_m = float(self._now.state[2]) + self.altitude_m
        return abs(error_m) <= self._now.behaviour.altitude_acceptance_m

    @property
    def home_altitude_m(self) -> float:
        """Altitude of home above sea level at the takeoff: home may move to the vehicle on arming."""
        moves = (
            not self._now.status.armed and self._area.home_follows and self._readiness.facts.state_is_valid
        )
        return self._above_sea_m() if moves else self._area.home.altitude_m

    def _vehicle_above_home_m(self) -> float:
        """Return the height of the vehicle above home at the takeoff; 0 if it is unknown."""
        if not self._readiness.facts.state_is_valid:
            return 0.0
        return self._above_sea_m() - self.home_altitude_m

    def _above_sea_m(self) -> float:
        return self._places.frame.origin.altitude_m - float(self._now.state[2])


class ModeControl:
    """Applies events by the transition table of ``commander.transitions``."""

    def __init__(
        self,
        now: FlightState,
        journal: Journal,
        readiness: Readiness,
        failsafes: FailsafeMonitor,
        ground: GroundMonitor,
        mission: Mission,
        area: FlightArea,
        takeoff: Takeoff,
        navigator: Navigator,
        backend: ControlBackend,
    ) -> None:
        self._now = now
        self._journal = journal
        self._readiness = readiness
        self._failsafes = failsafes
        self._ground = ground
        self._mission = mission
        self._area = area
        self._takeoff = takeoff
        self._navigator = navigator
        self._backend = backend

    # ------------------------------------------------------------------ events

    def apply(self, event: Event, takeoff_altitude_m: float | None = None) -> str | None:
        """Apply an event; return the refusal, or None. ``takeoff_altitude_m`` is above home."""
        before = self._now.status
        outcome = transition(before, self._readiness.facts, event)
        refusal = outcome.refusal
        if refusal is None and event is Event.SELECT_TAKEOFF:
            refusal = self._takeoff.set_altitude(takeoff_altitude_m)
        if refusal is None and event is Event.SELECT_MISSION and before.armed:
            refusal = self._mission.refusal()
        if refusal is not None:
            return refusal
        if self._begins_return(before, outcome.status) and self._area.return_place() is None:
            if before.mode is not Mode.LAND:
                self._journal.say(Severity.WARNING, "No place to return to is inside the geofence: landing")
            return self.apply(Event.SELECT_LAND)
        self._adopt(before, outcome.status, event)
        return None

    def check_mission_in_flight(self) -> None:
        """Hold if a change of home or limits makes the mission in flight invalid."""
        status = self._now.status
        refusal = self._mission.refusal() if status.armed and status.mode is Mode.MISSION else None
        if refusal is not None:
            self._journal.say(Severity.WARNING, f"Mission held: {refusal}")
            self.apply(Event.SELECT_HOLD)

    def mission_cleared(self) -> None:
        """Hold if the mission in flight was cleared. Unlike a mode selection, this overrides no failsafe."""
        if self._now.status.mode is Mode.MISSION:
            self.apply(Event.SELECT_HOLD)

    def _begins_return(self, before: Status, after: Status) -> bool:
        return after.mode is Mode.RETURN and before.mode is not Mode.RETURN and not self._now.landed

    def _adopt(self, before: Status, after: Status, event: Event) -> None:
        now, journal = self._now, self._journal
        now.status = after
        if after.armed and not before.armed:
            self._begin_flight()
        if before.armed and not after.armed:  # before the status record, which ends the log
            if now.landed:
                journal.say(Severity.NOTICE, "Disarmed")
            else:
                self._ground.note_fall(now.time_us)
                journal.say(Severity.CRITICAL, "Disarmed in the air")
        if after != before:
            journal.status(after)
        if after.armed and not before.armed:
            journal.say(Severity.NOTICE, "Armed")
        if not after.armed:
            now.landed = True
            self._navigator.set_speed(SpeedOverrides())
        if after.mode is Mode.MISSION and before.mode is not Mode.MISSION:
            self._mission.restart_if_finished()  # before ``choose_loops``: a finished mission does not take off
        if event is Event.MISSION_FINISHED:
            self._navigator.hold_at_last_item()
        continues = event in (Event.TAKEOFF_REACHED, Event.MISSION_FINISHED)
        reentered = event in (Event.SELECT_TAKEOFF, Event.SELECT_HOLD)
        self.choose_loops(entering=not continues and (after.mode is not before.mode or reentered))

    def _begin_flight(self) -> None:
        """Reset the state of the last flight on arming."""
        now = self._now
        now.armed_us = now.time_us
        now.takeoff_us = now.landing_us = 0
        self._failsafes.armed()
        self._ground.armed(now.time_us)
        self._takeoff.altitude_m += self._area.move_home_on_arming()
        now.landed = True
        self._area.set_ground_here()
        # guidance may hold the end of a flight that was disarmed in the air
        self._navigator.reset_on_ground(now.state)

    # ------------------------------------------------------------------ loops and guidance

    def choose_loops(self, entering: bool = False) -> None:
        """Start or stop the loops; with ``entering``, guidance enters the mode."""
        now = self._now
        flying = now.status.armed and (not now.landed or self.takes_off())
        starting = flying and not now.flying
        if starting:
            self._backend.reset(now.state)
            now.loops_reset = True
            self._navigator.reset_on_ground(now.state)
        if entering:
            place = self._area.return_destination() if now.status.mode is Mode.RETURN else None
            if place is not None:
                self._navigator.return_to(place.north_m, place.east_m, -place.altitude_m)
            self._area.find_ground(place)
        if starting or (flying and entering):
            self._navigator.enter(now.status.mode, self._takeoff.altitude_m)
        now.flying = flying

    def takes_off(self) -> bool:
        """Return True if the mode makes a vehicle on the ground take off now."""
        mode = self._now.status.mode
        if mode in STREAM_MODES:
            return self._navigator.wants_to_rise(mode, self._area.stood_down_m)
        return mode is Mode.TAKEOFF or (mode is Mode.MISSION and self._navigator.mission_flies)
