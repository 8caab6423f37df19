"""The autopilot: one tick from state to rotor speeds, and what commands and events do to it. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from flightstack.commander.transitions import Event, Facts, Outcome, Status, transition
from flightstack.contract import FloatArray, LoopRow, LoopStatus
from flightstack.control.backend import ControlBackend
from flightstack.geodesy import GeoPoint
from flightstack.guidance.mission import NAV_DELAY, TAKEOFF
from flightstack.guidance.navigator import MissionProgress, Navigator
from flightstack.guidance.params import guidance_params
from flightstack.guidance.plan_table import plan_table
from flightstack.modes import Mode
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle
from flightstack.plan import MissionItem, Rejection, check_mission
from flightstack.plan.check import Limits

EMERGENCY, ALERT, CRITICAL, ERROR, WARNING, NOTICE, INFO = range(7)
"""MAV_SEVERITY of texts."""

COS_MAX_ARMING_TILT = math.cos(math.radians(30.0))
HELD = LoopStatus.INPUT_NOT_FINITE | LoopStatus.OUTPUT_NOT_FINITE
AIRBORNE_MODES = (Mode.TAKEOFF, Mode.MISSION)
"""Modes that make a standing vehicle fly, now or later."""


class Recorder(Protocol):
    """Where the autopilot writes what happens; ``logging.recorder`` makes a flight log of it."""

    def inner_row(self, time_us: int) -> FloatArray:
        """Return the row, shape (48,), that the inner loop fills in this tick."""

    def outer(
        self, time_us: int, state: FloatArray, setpoint: FloatArray, attitude_target: FloatArray
    ) -> None:
        """Record one outer tick."""

    def status(self, time_us: int, status: Status) -> None:
        """Record a change of mode or arming."""

    def landed(self, time_us: int, landed: bool) -> None:
        """Record a change of the land detector."""

    def mission(self, time_us: int, progress: MissionProgress, count: int) -> None:
        """Record progress of the mission."""

    def text(self, time_us: int, severity: int, text: str) -> None:
        """Record a text."""


DISARMED = Status()
NO_PROGRESS = MissionProgress(0, -1, False, False)


class Text(NamedTuple):
    """A text for the operator."""

    severity: int
    text: str


@dataclass
class Snapshot:
    """What telemetry reads: the arrays are live, the rest is copied once per change."""

    state: FloatArray
    setpoint: FloatArray
    attitude_target: FloatArray
    row: FloatArray
    time_us: int = 0
    status: Status = DISARMED
    landed: bool = True
    progress: MissionProgress = NO_PROGRESS
    mission_count: int = 0
    mission_complete: bool = False
    reached: list[int] = field(default_factory=list)
    """Mission items reached that telemetry has yet to announce."""
    texts: list[Text] = field(default_factory=list)


class Autopilot:
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
    ) -> None:
        """Use ``state`` (13,) and ``rotor_speed_rad_s`` (8,), which the simulator link writes in place."""
        self.behaviour = behaviour
        self.home = home
        self.items: tuple[MissionItem, ...] = ()
        self._divisor = divisor
        self._backend = backend
        self._recorder = recorder
        self._navigator = Navigator(guidance_params(behaviour, vehicle.weight_n), outer_hz)
        self._state = state
        self._rotor_speed = rotor_speed_rad_s
        self._tick = 0
        self._flying = False
        self._faults = 0
        self._armed_us = 0
        self._landed_us = 0
        self._has_flown = False
        self._takeoff_altitude_m = behaviour.takeoff_altitude_m
        self.has_state = False  # set once a state has arrived
        idle_row = np.zeros(LoopRow.SIZE)
        self.now = Snapshot(state, self._navigator.setpoint, backend.attitude_target, idle_row)

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
            if self._flying or now.status.mode is Mode.MISSION:  # a mission also waits on the ground
                self._navigator.step(now.status.mode, state, now.attitude_target)
        row = self._recorder.inner_row(time_us)
        if self._flying:
            self._backend.step(state, now.setpoint, self._rotor_speed, outer_due, row)
        else:
            self._backend.idle(state, self._rotor_speed, now.status.armed, row)
        now.row = row
        if outer_due:
            self._recorder.outer(time_us, state, now.setpoint, now.attitude_target)
        commands: FloatArray = row[LoopRow.ROTOR_COMMAND]
        return commands

    # ------------------------------------------------------------------ events of the flight

    def _supervise(self, time_us: int) -> None:
        """Turn what guidance and the land detector found into events; once per outer tick."""
        self._watch_input()
        if not self.now.status.armed:
            return
        self._watch_ground(time_us)
        mode = self.now.status.mode
        if mode is Mode.MISSION:
            self._watch_mission(time_us)
        elif mode is Mode.TAKEOFF and self._flying and self._takeoff_is_reached():
            self.happen(Event.TAKEOFF_REACHED)

    def _watch_input(self) -> None:
        faults = int(self.now.row[LoopRow.STATUS]) & HELD
        if faults == self._faults:
            return
        self._faults = faults
        if faults & LoopStatus.INPUT_NOT_FINITE:
            self.say(CRITICAL, "State is not finite: the loops hold their last output")
        elif faults:
            self.say(CRITICAL, "Controller output is not finite: the loops hold their last output")
        else:
            self.say(NOTICE, "State and controller output are finite again")

    def _watch_ground(self, time_us: int) -> None:
        landed = self._navigator.landed
        if landed != self.now.landed:
            self.now.landed = landed
            self._landed_us = time_us
            self._has_flown = True
            self._recorder.landed(time_us, landed)
            self.say(INFO, "Landing detected" if landed else "Takeoff detected")
            self._choose_loops()
        if not landed:
            return
        b = self.behaviour
        if self._has_flown:
            if self._waited(time_us, self._landed_us, b.disarm_after_landing_s) and not self._is_taking_off():
                self.happen(Event.LANDED_LONG_ENOUGH)
        elif self._waited(time_us, self._armed_us, b.disarm_without_takeoff_s):
            self.say(WARNING, "Disarmed: no takeoff")
            self.happen(Event.NO_TAKEOFF)

    def _is_taking_off(self) -> bool:
        """After a landing, only a mission that goes on flying keeps the vehicle armed."""
        return self.now.status.mode in AIRBORNE_MODES

    @staticmethod
    def _waited(time_us: int, since_us: int, wait_s: float) -> bool:
        return wait_s >= 0.0 and (time_us - since_us) * 1e-6 >= wait_s

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
            self.happen(Event.MISSION_ASKS_RETURN)
        elif progress.finished:
            self.now.mission_complete = True
            self.say(INFO, "Mission finished")
            self.happen(Event.MISSION_FINISHED)

    def _takeoff_is_reached(self) -> bool:
        return abs(float(self._state[2]) + self._takeoff_altitude_m) <= self.behaviour.altitude_acceptance_m

    # ------------------------------------------------------------------ commands

    @property
    def facts(self) -> Facts:
        """What the transition table asks about."""
        qx, qy = float(self._state[7]), float(self._state[8])
        finite = bool(np.isfinite(self._state).all())
        return Facts(
            state_is_valid=finite and self.has_state,
            upright=finite and 1.0 - 2.0 * (qx * qx + qy * qy) >= COS_MAX_ARMING_TILT,
            landed=self.now.landed,
            has_mission=bool(self.items),
            mission_begins_with_takeoff=self._mission_begins_with_takeoff(),
        )

    def _mission_begins_with_takeoff(self) -> bool:
        for item in self.items:
            if item.command < NAV_DELAY:  # the first item that moves the vehicle
                return item.command == TAKEOFF
        return False

    def happen(self, event: Event, takeoff_altitude_m: float | None = None) -> str | None:
        """Apply an event; return why it was refused, or None."""
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
            self._takeoff_altitude_m = altitude
        self._adopt(before, outcome.status, event)
        return None

    def _adopt(self, before: Status, after: Status, event: Event) -> None:
        self.now.status = after
        if after.armed and not before.armed:
            self._armed_us = self.now.time_us
            self._has_flown = False
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
        rises = status.mode is Mode.TAKEOFF or (status.mode is Mode.MISSION and self._navigator.mission_flies)
        flying = status.armed and (not self.now.landed or rises)
        starting = flying and not self._flying
        if starting:
            self._backend.reset(self._state)
            self._navigator.rest_at(self._state)
        if starting or (flying and entering):
            self._navigator.enter(status.mode, self._takeoff_altitude_m)
        self._flying = flying

    # ------------------------------------------------------------------ mission

    @property
    def limits(self) -> Limits:
        """Limits of a mission."""
        b = self.behaviour
        return Limits(max_first_distance_m=b.first_waypoint_distance_m, max_distance_m=b.waypoint_distance_m)

    def check_mission(self, items: Sequence[MissionItem]) -> Rejection | None:
        """Tell why the vehicle would refuse a mission, or None."""
        return check_mission(items, self.home, self.limits)

    def set_mission(self, items: Sequence[MissionItem]) -> None:
        """Take a mission that was checked; one that is being flown begins anew with its first item."""
        self.items = tuple(items)
        self._navigator.set_plan(*plan_table(self.items, self.home))
        self._mission_changed()
        if not self.items and self.now.status.mode is Mode.MISSION:
            self.happen(Event.SELECT_HOLD)

    def set_current_item(self, seq: int) -> str | None:
        """Make ``seq`` the current item; return why not, or None."""
        if not 0 <= seq < len(self.items):
            return f"there is no mission item {seq}"
        self._navigator.set_current(seq)
        self._mission_changed()
        return None

    def restart_mission(self) -> None:
        """Begin the mission anew: its first item is the current one, jumps count from zero."""
        self._navigator.restart_plan()
        self._mission_changed()

    def _mission_changed(self) -> None:
        now = self.now
        now.progress = self._navigator.progress
        now.mission_count = len(self.items)
        now.mission_complete = False
        self._recorder.mission(now.time_us, now.progress, len(self.items))

    # ------------------------------------------------------------------ texts

    def say(self, severity: int, text: str) -> None:
        """Tell the operator and the log."""
        self.now.texts.append(Text(severity, text))
        self._recorder.text(self.now.time_us, severity, text)
