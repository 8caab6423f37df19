"""Events of the flight: failsafes, takeoff and landing, progress of the mission. No I/O, no clock."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from flightstack.commander.failsafe import Action, Failsafe, Phase, phase_of
from flightstack.commander.failsafe_monitor import EVENTS_OF_ACTION, FailsafeMonitor
from flightstack.commander.ground_monitor import GroundMonitor, Standing
from flightstack.commander.transitions import Event
from flightstack.core.enums import STREAM_MODES, Mode, Severity
from flightstack.core.periods import NEVER_US
from flightstack.guidance.navigator import Navigator
from flightstack.vehicle.flight_state import FlightState, Journal
from flightstack.vehicle.mode_control import ModeControl, Takeoff
from flightstack.vehicle.plans import FlightArea, Mission

AIRBORNE_MODES = (Mode.TAKEOFF, Mode.MISSION)
"""Modes that take off, at once or after a delay."""

_LEAVE_GROUND = frozenset((*AIRBORNE_MODES, *STREAM_MODES))
"""Modes in which an armed vehicle on the ground may begin to fly in any tick."""

# used in every outer tick: a member of an enumeration takes seven times as long to look up as a name
_MISSION, _TAKEOFF = Mode.MISSION, Mode.TAKEOFF


class Lift(NamedTuple):
    """State and thrust target of a landed vehicle in an outer tick with loops that run."""

    time_us: int
    down_m: float
    down_m_s: float
    thrust_n: float


class FlightMonitor:
    """Generates events from failsafes, guidance and the land detector, once per outer tick."""

    def __init__(
        self,
        now: FlightState,
        journal: Journal,
        modes: ModeControl,
        failsafes: FailsafeMonitor,
        ground: GroundMonitor,
        mission: Mission,
        area: FlightArea,
        takeoff: Takeoff,
        navigator: Navigator,
        weight_n: float,
    ) -> None:
        self._now = now
        self._journal = journal
        self._modes = modes
        self._failsafes = failsafes
        self._ground = ground
        self._mission = mission
        self._area = area
        self._takeoff = takeoff
        self._navigator = navigator
        self._weight_n = weight_n

    def update(self) -> None:
        """Evaluate the newest state and apply the events that follow."""
        now, failsafes, navigator = self._now, self._failsafes, self._navigator
        self._ground.update(now.time_us, float(now.state[5]))
        failsafes.position_is_controlled = now.flying and not (now.attitude_is_given or now.rests)
        failsafes.on_ground = now.landed or navigator.touches_ground
        conditions = failsafes.update(now.time_us, now.status, now.landed, now.setpoint, now.row)
        if conditions is not None:
            self._apply_failsafes(conditions)
        if not now.status.armed:
            return
        for rotor in failsafes.take_unmeasured():
            self._journal.say(
                Severity.WARNING, f"Rotor {rotor}: speed not measured, failures of it are not detected"
            )
        if now.landed or navigator.landed:
            self._update_ground()
        mode = now.status.mode
        if mode is _MISSION:
            self._update_mission()
        elif mode is _TAKEOFF and now.flying and self._takeoff.is_reached:
            self._modes.apply(Event.TAKEOFF_REACHED)
        elif now.landed and mode in STREAM_MODES and self._modes.takes_off() is not now.flying:
            self._modes.choose_loops()

    def is_nominal(self) -> bool:
        """Return True if the next update, with started loops, changes nothing unless the new state makes an event."""
        armed, mode = self._now.status
        if not armed or mode in STREAM_MODES or self._now.landed is not self._navigator.landed:
            return False
        return self._failsafes.is_nominal(self._phase, mode)

    @property
    def _phase(self) -> Phase:
        armed, mode = self._now.status
        return phase_of(armed, self._now.landed, mode, self._navigator.goes_elsewhere)

    def stands(self) -> bool:
        """Return True if the next update of a vehicle on the ground changes nothing, as ``is_nominal``."""
        (armed, mode), now = self._now.status, self._now
        if not now.landed or (armed and (mode in _LEAVE_GROUND or not self._navigator.landed)):
            return False
        return self._failsafes.is_nominal(self._phase, mode)

    @property
    def stands_until_us(self) -> int:
        """Time before which the vehicle, if it stays on the ground, is not disarmed."""
        now = self._now
        goes_on = now.flying and self._flies_on
        return self._ground.due_us(goes_on=goes_on, behaviour=now.behaviour) if now.status.armed else NEVER_US

    def pass_by(self, time_us: int, found: int, fell_us: int, lifts: Iterable[Lift]) -> None:
        """Follow updates up to ``time_us`` that did nothing; arguments as in ``Autopilot.pass_outer``."""
        if fell_us:
            self._ground.note_fall(fell_us)
        for at_us, down_m, down_m_s, thrust_n in lifts:
            standing = Standing(self._flies_on, True, down_m, down_m_s, thrust_n / self._weight_n)
            self._ground.follow(at_us, standing)
        if self._now.status.armed and not self._now.flying:
            self._ground.stand()
        self._failsafes.pass_by(time_us, found)

    def _apply_failsafes(self, conditions: frozenset[Failsafe]) -> None:
        """Evaluate the failsafes and apply their decision."""
        now, failsafes = self._now, self._failsafes
        before = failsafes.decision
        for severity, text in failsafes.evaluate(conditions, self._phase):
            self._journal.say(severity, text)
        decision = failsafes.decision
        acts = decision.action > Action.WARN
        goes_on = self._journal.failsafe_acts and failsafes.demands_action
        if (acts and decision != before) or (acts or goes_on) is not self._journal.failsafe_acts:
            self._journal.failsafe_acts = acts or goes_on
            self._journal.status(now.status)
        if not acts:
            return
        if Failsafe.POSITION_ERROR in failsafes.active:
            self._navigator.reset_reference(now.state)
        for event in EVENTS_OF_ACTION.get(decision.action, ()):
            if self._modes.apply(event) is None:
                failsafes.action_applied()
                break

    def _update_ground(self) -> None:
        """Update takeoff and landing, and apply a due disarming on the ground."""
        now, landed = self._now, self._navigator.landed
        if landed != now.landed:
            now.landed = landed
            self._ground.took_off_or_landed(now.time_us)
            if landed:
                now.landing_us = now.time_us
                self._area.set_ground_here()
            else:
                now.takeoff_us = now.takeoff_us or now.time_us
            self._journal.landed(landed)
            self._modes.choose_loops()
        event = self._due_on_ground() if landed else None
        if event is Event.NO_TAKEOFF:
            waits = now.status.mode is _MISSION and not now.flying
            if waits and self._mission.takes_off():
                self._ground.restart_timer(now.time_us)
                return
            self._journal.say(Severity.WARNING, "Disarmed: no takeoff")
        if event is not None:
            self._modes.apply(event)

    def _due_on_ground(self) -> Event | None:
        """Return the event due on the ground: disarming after a landing, or without a takeoff."""
        now = self._now
        lift = float(now.attitude_target[4]) / self._weight_n
        standing = Standing(self._flies_on, now.flying, float(now.state[2]), float(now.state[5]), lift)
        return self._ground.due_event(now.time_us, standing, now.behaviour)

    @property
    def _flies_on(self) -> bool:
        """True if the mode goes on with the flight after a landing."""
        mode = self._now.status.mode
        return mode in AIRBORNE_MODES or (mode in STREAM_MODES and self._now.flying)

    def _update_mission(self) -> None:
        """Report progress of the mission, and apply the events of its end."""
        now = self._now
        if self._mission.report_progress():
            self._modes.choose_loops()
        if now.progress.wants_return:
            now.mission_complete = True
            self._journal.say(Severity.INFO, "Mission finished: returning home")
            self._modes.apply(Event.MISSION_ASKS_RETURN)
        elif now.progress.finished:
            now.mission_complete = True
            self._journal.say(Severity.INFO, "Mission finished")
            self._modes.apply(Event.MISSION_FINISHED)
