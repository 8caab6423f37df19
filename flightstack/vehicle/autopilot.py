"""The autopilot: one tick from state to rotor speeds, and what it notices on the way. No I/O, no clock."""

from __future__ import annotations

import numpy as np

from flightstack.commander.conditions import LinkFacts, StateSource
from flightstack.commander.failsafe import Action, Failsafe, phase_of
from flightstack.commander.ground_watch import Standing
from flightstack.commander.supervisor import EVENTS_OF_ACTION, Supervisor
from flightstack.commander.transitions import Event
from flightstack.control.backend import ControlBackend
from flightstack.core.contract import FloatArray, LoopFlags, LoopRow, LoopStatus
from flightstack.core.geodesy import GeoPoint
from flightstack.core.modes import STREAM_MODES, Mode
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.params import guidance_params
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle
from flightstack.vehicle.flight_requests import FlightRequests
from flightstack.vehicle.snapshot import INFO, WARNING, Recorder, Snapshot

AIRBORNE_MODES = (Mode.TAKEOFF, Mode.MISSION)
"""Modes that make a standing vehicle fly, now or later."""

# what a tick asks for: a member of an enumeration takes seven times as long to look up as a name
_MISSION, _TAKEOFF = Mode.MISSION, Mode.TAKEOFF
_COMMANDS = LoopRow.ROTOR_COMMAND
_OUTER_DUE, _SET_TARGET, _RESET = int(LoopFlags.OUTER_DUE), int(LoopFlags.SET_TARGET), int(LoopFlags.RESET)


class Autopilot(FlightRequests):
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
        self.backend = backend
        """The control loops; their parameters and memory are theirs."""
        self._recorder = recorder
        self._navigator = Navigator(guidance_params(behaviour, vehicle.weight_n), outer_hz)
        self._max_thrust_n = 2.0 * vehicle.weight_n if vehicle.ideal_rotors else vehicle.max_thrust_n
        self._state = state
        self._rotor_speed = rotor_speed_rad_s
        self._tick = 0
        self._target_is_given = False  # by guidance, in place of the outer loop's
        self._rests = False  # on the ground, though not found to be landed yet
        self._takeoff_altitude_m = behaviour.takeoff_altitude_m
        self.has_state = False  # set once a state has arrived
        idle_row = np.zeros(LoopRow.SIZE)
        self._good_row = idle_row.copy()
        self.now = Snapshot(state, self._navigator.setpoint, backend.attitude_target, idle_row)
        self._set_bounds()

    @property
    def links(self) -> LinkFacts:
        """What is known of the ground links; each service writes its own field."""
        return self.supervisor.links

    @property
    def navigator(self) -> Navigator:
        """Guidance: its parameters, setpoint and contact with the ground; read only."""
        return self._navigator

    @property
    def failsafes(self) -> tuple[Failsafe, ...]:
        """Active failsafes in order of priority."""
        return self.supervisor.failsafes

    # ------------------------------------------------------------------ the tick

    def tick(self, time_us: int) -> FloatArray:
        """Run one inner tick on the newest state; return the rotor speed commands [rad/s], shape (8,)."""
        now, supervisor = self.now, self.supervisor
        now.time_us = time_us
        outer_due = self._tick % self._divisor == 0
        self._tick += 1
        if outer_due:
            self._supervise(time_us)
            self._guide()
        row, flags = self._recorder.inner_row(time_us), 0
        if self._rests or not self._flying:
            self.backend.idle(self._state, self._rotor_speed, now.status.armed, row)
            supervisor.follow_rotors(row)
        elif supervisor.states.holds_rotors:
            row[:] = self._good_row
            row[LoopRow.STATUS] = LoopStatus.INPUT_STALE
        else:
            aims = outer_due and not self._target_is_given
            self.backend.step(self._state, now.setpoint, self._rotor_speed, aims, row)
            supervisor.follow_rotors(row)
            flags = _OUTER_DUE if aims else _SET_TARGET
            if self._loops_begin:
                flags |= _RESET
                self._loops_begin = False
        now.row = row
        if outer_due:
            if supervisor.states.is_new:  # what the loops make of a frozen state is nothing to hold
                self._good_row[:] = row
            self._recorder.outer(time_us, self._state, now.setpoint, now.attitude_target, flags)
        commands: FloatArray = row[_COMMANDS]
        return commands

    def _guide(self) -> None:
        """Let guidance say where to fly, or that the vehicle rests; no step while the state is not to be flown by."""
        now, flying = self.now, self._flying
        rested, self._rests = self._rests, False
        armed, mode = now.status
        waits = armed and mode is _MISSION  # on the ground
        if self.supervisor.states.holds_rotors or not (flying or waits):
            return
        navigator, target = self._navigator, None
        touched = navigator.touches_ground
        navigator.step(mode, self._state, now.attitude_target)
        flies_attitude = navigator.flies_attitude(mode)
        if touched and not navigator.touches_ground:  # it climbs, or was in the air
            navigator.take_up(self._state)
        touches = flying and navigator.touches_ground and not flies_attitude
        self._rests = touches and navigator.rests
        if rested or self._rests or (touches and not touched):  # what the loops remember is of the ground
            self.backend.reset(self._state)
            self._loops_begin = True
        if flying and flies_attitude:
            target = navigator.attitude_target
        elif touches and not self._rests:
            target = navigator.levelling_target(now.attitude_target)
        if target is not None:
            self.backend.set_attitude_target(target)
        self._target_is_given = target is not None

    # ------------------------------------------------------------------ events of the flight

    def _supervise(self, time_us: int) -> None:
        """Turn what failsafes, guidance and the land detector found into events; once per outer tick."""
        now, supervisor, navigator = self.now, self.supervisor, self._navigator
        status = now.status
        self._ground.watch(time_us, float(self._state[5]))
        supervisor.position_is_controlled = self._flying and not (self._target_is_given or self._rests)
        supervisor.on_ground = now.landed or navigator.touches_ground
        conditions = supervisor.look(time_us, status, now.landed, now.setpoint, now.row)
        if conditions is not None:
            self._meet_failsafes(time_us, conditions)
            status = now.status
        if not status.armed:
            return
        for rotor in supervisor.take_unmeasured():
            self.say(WARNING, f"Rotor {rotor}: speed not measured, failures of it are not detected")
        if now.landed or navigator.landed:
            self._watch_ground(time_us)
        mode = now.status.mode
        if mode is _MISSION:
            self._watch_mission(time_us)
        elif mode is _TAKEOFF and self._flying and self._takeoff_is_reached():
            self._apply(Event.TAKEOFF_REACHED)
        elif now.landed and mode in STREAM_MODES and self._rises() is not self._flying:
            self._choose_loops()

    def _meet_failsafes(self, time_us: int, conditions: frozenset[Failsafe]) -> None:
        """Let the failsafes judge what is wrong, and carry out what they decide."""
        now, supervisor = self.now, self.supervisor
        acted = supervisor.decision
        phase = phase_of(now.status.armed, now.landed, now.status.mode, self._navigator.goes_elsewhere)
        for severity, text in supervisor.judge(conditions, phase):
            self.say(severity, text)
        decision = supervisor.decision
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
        """Note takeoff and landing, and disarm a vehicle that stands too long."""
        landed = self._navigator.landed
        if landed != self.now.landed:
            self.now.landed = landed
            self._ground.changed(time_us)
            if landed:
                self.now.landing_us = time_us
                self._stands_here()
            else:
                self.now.takeoff_us = self.now.takeoff_us or time_us
            self._recorder.landed(time_us, landed)
            self.say(INFO, "Landing detected" if landed else "Takeoff detected")
            self._choose_loops()
        if not landed:
            return
        mode = self.now.status.mode
        goes_on = mode in AIRBORNE_MODES or (mode in STREAM_MODES and self._flying)
        lift = float(self.now.attitude_target[4]) / self._vehicle.weight_n
        standing = Standing(goes_on, self._flying, float(self._state[2]), float(self._state[5]), lift)
        event = self._ground.event(time_us, standing, self._behaviour)
        if event is Event.NO_TAKEOFF:
            waits = mode is _MISSION and not self._flying
            if waits and self._mission_takes_off():
                self._ground.waits(time_us)
                return
            self.say(WARNING, "Disarmed: no takeoff")
        if event is not None:
            self._apply(event)

    def _watch_mission(self, time_us: int) -> None:
        """Tell of items reached, and what the end of the mission leads to."""
        now, navigator = self.now, self._navigator
        if not (navigator.progress_changed() or now.progress.finished or now.progress.wants_return):
            return
        progress = navigator.progress
        if progress != now.progress:
            reached = navigator.reached_items()
            for seq in reached:
                now.reached.append(seq)
                self._recorder.mission(time_us, progress._replace(reached=seq), len(self.items))
                self.say(INFO, f"Mission item {seq} reached")
            if not reached:
                self._recorder.mission(time_us, progress, len(self.items))
            now.progress = progress
            self._choose_loops()
        if progress.wants_return:
            now.mission_complete = True
            self.say(INFO, "Mission finished: returning home")
            self._apply(Event.MISSION_ASKS_RETURN)
        elif progress.finished:
            now.mission_complete = True
            self.say(INFO, "Mission finished")
            self._apply(Event.MISSION_FINISHED)

    def _takeoff_is_reached(self) -> bool:
        return abs(float(self._state[2]) + self._takeoff_altitude_m) <= self._behaviour.altitude_acceptance_m
