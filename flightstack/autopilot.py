"""The autopilot: one tick from state to rotor speeds, and what commands and events do to it. No I/O, no clock."""

from __future__ import annotations

import math

import numpy as np

from flightstack.commander.arming_checks import arming_refusals
from flightstack.commander.conditions import LinkFacts, StateSource
from flightstack.commander.failsafe import PHASE_OF_MODE, Action, Decision, Failsafe, Phase
from flightstack.commander.ground_watch import GroundWatch
from flightstack.commander.supervisor import EVENTS_OF_ACTION, Supervisor
from flightstack.commander.transitions import RULES, Event, Facts, Need, Outcome, Status, transition
from flightstack.contract import FloatArray, LoopFlags, LoopRow, LoopStatus
from flightstack.control.backend import ControlBackend
from flightstack.geodesy import GeoPoint
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.params import guidance_params
from flightstack.guidance.setpoints import OffboardSetpoint, Sticks
from flightstack.guidance.speeds import SpeedOverrides
from flightstack.modes import Mode
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle
from flightstack.plan_keeper import PlanKeeper
from flightstack.snapshot import CRITICAL, EMERGENCY, INFO, NOTICE, WARNING, Recorder, Snapshot, Text

AIRBORNE_MODES = (Mode.TAKEOFF, Mode.MISSION)
"""Modes that make a standing vehicle fly, now or later."""
STREAM_MODES = (Mode.OFFBOARD, Mode.POSITION, Mode.ALTITUDE)
"""Modes in which a stream from the ground says where to fly, and whether to leave the ground."""

USERS_CHOICES: dict[Event, Phase] = {
    rule.event: PHASE_OF_MODE[rule.mode]
    for rule in RULES
    if rule.mode is not None and rule.event.name.startswith("SELECT_")
}
"""What a user selects, and the phase of flight that it begins."""


class Autopilot(PlanKeeper):
    """Ties commander, guidance and control loops together."""

    def __init__(
        self,
        vehicle: Vehicle,
        backend: ControlBackend,
        behaviour: Behaviour,
        home: GeoPoint,
        divisor: int,
        outer_hz: float,
        recorder: Recorder,
        state: FloatArray,
        rotor_speed_rad_s: FloatArray,
        source: StateSource,
    ) -> None:
        """Use ``state`` (13,) and ``rotor_speed_rad_s`` (8,), which ``source`` writes in place."""
        super().__init__(home)
        self._vehicle = vehicle
        self._behaviour = behaviour
        self.supervisor = Supervisor(vehicle, behaviour, outer_hz, divisor, state, source)
        self._divisor = divisor
        self._backend = backend
        self._recorder = recorder
        self._navigator = Navigator(guidance_params(behaviour, vehicle.weight_n), outer_hz)
        self._max_thrust_n = 2.0 * vehicle.weight_n if vehicle.ideal_rotors else vehicle.max_thrust_n
        self._state = state
        self._rotor_speed = rotor_speed_rad_s
        self._tick = 0
        self._flying = False
        self._target_is_given = False  # by guidance, in place of the outer loop's
        self._loops_begin = False  # in this tick
        self._ground = GroundWatch()
        self._throttle = 0.0
        self._takeoff_altitude_m = behaviour.takeoff_altitude_m
        self.has_state = False  # set once a state has arrived
        idle_row = np.zeros(LoopRow.SIZE)
        self._good_row = idle_row.copy()
        self.now = Snapshot(state, self._navigator.setpoint, backend.attitude_target, idle_row)
        self._set_bounds()

    # ------------------------------------------------------------------ the tick

    def tick(self, time_us: int) -> FloatArray:
        """Run one inner tick on the newest state; return the rotor speed commands [rad/s], shape (8,)."""
        now = self.now
        now.time_us = time_us
        state = self._state
        outer_due = self._tick % self._divisor == 0
        self._tick += 1
        if outer_due:
            self._supervise(time_us)
            self._guide()
        row, flags = self._recorder.inner_row(time_us), 0
        if not self._flying:
            self._backend.idle(state, self._rotor_speed, now.status.armed, row)
            self.supervisor.follow_rotors(row)
        elif self.supervisor.holds_rotors:
            row[:] = self._good_row
            row[LoopRow.STATUS] = LoopStatus.INPUT_STALE
        else:
            aims = outer_due and not self._target_is_given
            self._backend.step(state, now.setpoint, self._rotor_speed, aims, row)
            self.supervisor.follow_rotors(row)
            flags = LoopFlags.OUTER_DUE if aims else LoopFlags.SET_TARGET
            if self._loops_begin:
                flags |= LoopFlags.RESET
                self._loops_begin = False
        now.row = row
        if outer_due:
            if self.supervisor.state_is_new:  # what the loops make of a frozen state is nothing to hold
                self._good_row[:] = row
            self._recorder.outer(time_us, state, now.setpoint, now.attitude_target, flags)
        commands: FloatArray = row[LoopRow.ROTOR_COMMAND]
        return commands

    def _guide(self) -> None:
        """Let guidance say where to fly; it rests while the state is not to be flown by."""
        now = self.now
        mode = now.status.mode
        waits = mode is Mode.MISSION  # a mission also waits on the ground
        if self.supervisor.holds_rotors or not (self._flying or waits):
            return
        navigator, target = self._navigator, None
        navigator.step(mode, self._state, now.attitude_target)
        if self._flying and navigator.flies_attitude(mode):
            target = navigator.attitude_target
        elif self._flying and navigator.touches_ground:
            target = navigator.level_target(self._state, now.attitude_target)
        if target is not None:
            self._backend.set_attitude_target(target)
        self._target_is_given = target is not None

    # ------------------------------------------------------------------ events of the flight

    def _supervise(self, time_us: int) -> None:
        """Turn what failsafes, guidance and the land detector found into events; once per outer tick."""
        self._watch_failsafes(time_us)
        if not self.now.status.armed:
            return
        self._watch_ground(time_us)
        mode = self.now.status.mode
        if mode is Mode.MISSION:
            self._watch_mission(time_us)
        elif mode is Mode.TAKEOFF and self._flying and self._takeoff_is_reached():
            self._apply(Event.TAKEOFF_REACHED)
        elif mode in STREAM_MODES and self.now.landed and self._rises() is not self._flying:
            self._choose_loops()

    def _watch_failsafes(self, time_us: int) -> None:
        now, supervisor = self.now, self.supervisor
        flies_attitude = self._navigator.flies_attitude(now.status.mode)
        supervisor.position_is_controlled = self._flying and not flies_attitude
        acted = supervisor.decision
        goes = self._navigator.goes_elsewhere
        for severity, text in supervisor.step(time_us, now.status, now.landed, now.setpoint, now.row, goes):
            self.say(severity, text)
        decision: Decision = supervisor.decision
        if decision.action <= Action.WARN:
            return
        if decision != acted:
            self._recorder.status(time_us, now.status, failsafe=True)
        if Failsafe.POSITION_ERROR in supervisor.failsafes:
            self._navigator.take_up(self._state)
        for event in EVENTS_OF_ACTION.get(decision.action, ()):
            if self._apply(event) is None:
                supervisor.took_over()
                break

    def _watch_ground(self, time_us: int) -> None:
        landed = self._navigator.landed
        if landed != self.now.landed:
            self.now.landed = landed
            self._ground.changed(time_us)
            if landed:
                self.now.landing_us = time_us
            else:
                self.now.takeoff_us = self.now.takeoff_us or time_us
            self._recorder.landed(time_us, landed)
            self.say(INFO, "Landing detected" if landed else "Takeoff detected")
            self._choose_loops()
        if not landed:
            return
        mode = self.now.status.mode  # after a landing, only who goes on flying stays armed
        is_taking_off = mode in AIRBORNE_MODES or (mode in STREAM_MODES and self._flying)
        event = self._ground.event(time_us, is_taking_off, self._behaviour)
        if event is Event.NO_TAKEOFF:
            self.say(WARNING, "Disarmed: no takeoff")
        if event is not None:
            self._apply(event)

    def _watch_mission(self, time_us: int) -> None:
        progress = self._navigator.progress
        if progress != self.now.progress:
            reached = self._navigator.reached_items()
            for seq in reached:
                self.now.reached.append(seq)
                self._recorder.mission(time_us, progress._replace(reached=seq), len(self.items))
                self.say(INFO, f"Mission item {seq} reached")
            if not reached:
                self._recorder.mission(time_us, progress, len(self.items))
            self.now.progress = progress
            self._choose_loops()
        if progress.wants_return:
            self.now.mission_complete = True
            self.say(INFO, "Mission finished: returning home")
            self._apply(Event.MISSION_ASKS_RETURN)
        elif progress.finished:
            self.now.mission_complete = True
            self.say(INFO, "Mission finished")
            self._apply(Event.MISSION_FINISHED)

    def _takeoff_is_reached(self) -> bool:
        return abs(float(self._state[2]) + self._takeoff_altitude_m) <= self.behaviour.altitude_acceptance_m

    # ------------------------------------------------------------------ commands

    @property
    def behaviour(self) -> Behaviour:
        """The parameters of guidance and commander."""
        return self._behaviour

    @property
    def links(self) -> LinkFacts:
        """What is known of the ground links; each service writes its own field."""
        return self.supervisor.links

    @property
    def failsafes(self) -> tuple[Failsafe, ...]:
        """Active failsafes in order of priority."""
        return self.supervisor.failsafes

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

    def arming_refusals(self, mode: Mode | None = None) -> tuple[str, ...]:
        """Return every reason for which the vehicle would not arm now, or in ``mode``; empty when it would."""
        known = self.supervisor.arming_facts(self.now.status.mode if mode is None else mode, self.has_state)
        return arming_refusals(known._replace(throttle=self._throttle), self._behaviour)

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
        refusal = self.supervisor.refusal(phase) or self._apply(event, takeoff_altitude_m)
        if refusal is None:
            self.supervisor.override(phase)
        return refusal

    def terminate(self, reason: str) -> None:
        """Stop the rotors for good: nothing flies again before a reboot."""
        self.say(EMERGENCY, f"Flight terminated: {reason}")
        self._apply(Event.TERMINATE)

    def _apply(self, event: Event, takeoff_altitude_m: float | None = None) -> str | None:
        before = self.now.status
        outcome: Outcome = transition(before, self.facts, event)
        if outcome.refusal is not None:
            return outcome.refusal
        if event is Event.SELECT_TAKEOFF:
            altitude = self.behaviour.takeoff_altitude_m if takeoff_altitude_m is None else takeoff_altitude_m
            if not altitude > self.behaviour.altitude_acceptance_m:
                return f"takeoff altitude {altitude:g} m is too low"
            if altitude > self.limits.max_altitude_m:
                return f"takeoff altitude {altitude:g} m is above {self.limits.max_altitude_m:g} m"
            self._takeoff_altitude_m = altitude + self.places.home.altitude_m
        if event is Event.SELECT_MISSION:
            refusal = self._mission_refusal()
            if refusal is not None:
                return refusal
        if self._begins_return(before, outcome.status) and self._return_place() is None:
            if before.mode is not Mode.LAND:
                self.say(WARNING, "No place to return to is inside the geofence: landing")
            return self._apply(Event.SELECT_LAND)
        self._adopt(before, outcome.status, event)
        return None

    def _begins_return(self, before: Status, after: Status) -> bool:
        return after.mode is Mode.RETURN and before.mode is not Mode.RETURN and not self.now.landed

    def start_mission(self, first: int | None) -> str | None:
        """Select the mission, from item ``first`` if it is given, and arm where need be; return why not, or None.

        A start that is refused changes nothing: everything is asked first.
        """
        phase = USERS_CHOICES[Event.SELECT_MISSION]
        arms = not self.now.status.armed
        refusal = transition(self.now.status, self.facts, Event.SELECT_MISSION).refusal
        refusal = refusal or self._mission_refusal()
        if refusal is None and arms:
            refusal = "; ".join(self.arming_refusals(Mode.MISSION)) or None
        refusal = refusal or self.supervisor.refusal(phase)
        if refusal is not None:
            return refusal
        if first is not None:
            self.set_current_item(first)
        refusal = self._apply(Event.SELECT_MISSION)
        if refusal is not None:
            return refusal
        self.supervisor.override(phase)
        return self.happen(Event.ARM) if arms else None

    def _check_mission_anew(self) -> None:
        """Hold instead of flying a mission that home or limits have made one to refuse."""
        status = self.now.status
        refusal = self._mission_refusal() if status.armed and status.mode is Mode.MISSION else None
        if refusal is not None:
            self.say(WARNING, f"Mission held: {refusal}")
            self._apply(Event.SELECT_HOLD)

    def _adopt(self, before: Status, after: Status, event: Event) -> None:
        self.now.status = after
        if after.armed and not before.armed:
            self.now.armed_us = self.now.time_us
            self.now.takeoff_us = self.now.landing_us = 0
            self.supervisor.armed()
            self._ground.armed(self.now.time_us)
            self._takeoff_altitude_m += self._bring_home()
            self.now.landed = True
        if before.armed and not after.armed:  # the log ends with disarming: its last words come first
            in_air = not self.now.landed
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
        if event in (Event.TAKEOFF_REACHED, Event.MISSION_FINISHED):
            if event is Event.MISSION_FINISHED:
                self._navigator.hold_at_last_item()
            self._choose_loops()
        else:
            reentered = event in (Event.SELECT_TAKEOFF, Event.SELECT_HOLD)
            self._choose_loops(entering=after.mode is not before.mode or reentered)

    def _choose_loops(self, entering: bool = False) -> None:
        """Start or stop the loops, and let guidance enter the mode."""
        status = self.now.status
        flying = status.armed and (not self.now.landed or self._rises())
        starting = flying and not self._flying
        if starting:
            self._backend.reset(self._state)
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

    def _mission_is_gone(self) -> None:
        if self.now.status.mode is Mode.MISSION:
            self._apply(Event.SELECT_HOLD)  # nobody chose a mode: failsafes are not overridden

    def _rises(self) -> bool:
        """Tell whether the mode makes a standing vehicle leave the ground."""
        mode = self.now.status.mode
        if mode in STREAM_MODES:
            return self._navigator.wants_to_rise(mode, float(self._state[2]))
        return mode is Mode.TAKEOFF or (mode is Mode.MISSION and self._navigator.mission_flies)

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

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Fly by other parameters, from the next outer tick on."""
        limits, self._behaviour = self.limits, behaviour
        self._navigator.set_params(guidance_params(behaviour, self._vehicle.weight_n))
        self.supervisor.set_behaviour(behaviour)
        self._set_bounds()
        if self.limits != limits:
            self._check_mission_anew()

    # ------------------------------------------------------------------ texts

    def say(self, severity: int, text: str) -> None:
        """Tell the operator and the log."""
        self.now.texts.append(Text(severity, text))
        self._recorder.text(self.now.time_us, severity, text)
