"""One tick of the autopilot, from the newest state to rotor speed commands, and its ticks in lockstep. No I/O."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.control.backend import ControlBackend
from flightstack.core.contract import FloatArray, LoopFlags, LoopRow, LoopStatus
from flightstack.core.enums import Mode, Severity
from flightstack.core.periods import NEVER_US
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.guidance.navigator import Navigator
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.state_steps import is_gap
from flightstack.vehicle.flight_monitor import FlightMonitor, Lift
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.outer_kernel import FLIES, LEVELS, LIFTS, RESTS, STANDS

# module constants for every tick: looking up an enumeration member takes seven times as long
_MISSION = Mode.MISSION
_COMMANDS = LoopRow.ROTOR_COMMAND
_OUTER_DUE, _SET_TARGET, _RESET = int(LoopFlags.OUTER_DUE), int(LoopFlags.SET_TARGET), int(LoopFlags.RESET)
STALL_NS = 1_000_000_000
"""If states arrive whose time has not changed for this wall time, the vehicle clock advances with wall time."""


class TickingAutopilot(Protocol):
    """An autopilot for the clock that drives it."""

    now: FlightState

    def tick(self, time_us: int) -> FloatArray:
        """Run one inner tick; return the rotor speed commands [rad/s], shape (8,)."""
        ...


class Autopilot:
    """Runs commander, guidance and control loops at their rates."""

    def __init__(
        self,
        now: FlightState,
        monitor: FlightMonitor,
        failsafes: FailsafeMonitor,
        navigator: Navigator,
        backend: ControlBackend,
        recorder: FlightRecorder,
        divisor: int,
    ) -> None:
        """Run the outer loop every ``divisor`` ticks."""
        self.now = now
        self._monitor = monitor
        self._failsafes = failsafes
        self._navigator = navigator
        self._backend = backend
        self._recorder = recorder
        self._divisor = divisor
        self._tick = 0
        self._good_row = now.row.copy()

    def tick(self, time_us: int) -> FloatArray:
        """Run one inner tick on the newest state; return the rotor speed commands [rad/s], shape (8,)."""
        now, failsafes = self.now, self._failsafes
        now.time_us = time_us
        outer_due = self._tick % self._divisor == 0
        self._tick += 1
        if outer_due:
            self._recorder.battery(time_us)
            self._monitor.update()
            self._guide()
        row, flags = self._recorder.inner_row(time_us), 0
        if now.rests or not now.flying:
            self._backend.idle(now.state, now.rotor_speed, now.status.armed, row)
            failsafes.follow_rotors(row)
        elif failsafes.states.holds_rotors:
            self._backend.hold()
            row[:] = self._good_row
            row[LoopRow.STATUS] = LoopStatus.INPUT_STALE
        else:
            runs_outer = outer_due and not now.attitude_is_given
            self._backend.step(now.state, now.setpoint, now.rotor_speed, runs_outer, row)
            failsafes.follow_rotors(row)
            flags = _OUTER_DUE if runs_outer else _SET_TARGET
            if now.loops_reset:
                flags |= _RESET
                now.loops_reset = False
        now.row = row
        if outer_due:
            if failsafes.states.is_new:  # hold no commands computed from a stale state
                self._good_row[:] = row
            self._recorder.outer(time_us, now.state, now.setpoint, now.attitude_target, flags)
        commands: FloatArray = row[_COMMANDS]
        return commands

    @property
    def next_outer(self) -> int:
        """Number of ticks before that of the next outer loop."""
        return -self._tick % self._divisor

    @property
    def quiet_ticks(self) -> int:
        """Number of the next ticks that run no outer loop, and do not hold the rotors."""
        return 0 if self._failsafes.states.holds_rotors else self.next_outer

    def is_nominal(self) -> bool:
        """Return True if the next outer tick does nothing but these, unless the new state makes an event.

        In flight it guides and controls, on the ground it leaves the rotors at idle speed, or begins or ends a flight.
        """
        now = self.now
        if not now.flying:
            return self._monitor.stands()
        return (now.rests or not now.loops_reset) and self._monitor.is_nominal()

    @property
    def phase(self) -> int:
        """Phase of the next outer tick if it is nominal."""
        now = self.now
        if not now.flying:
            return STANDS
        if now.landed:
            return LIFTS
        if now.rests:
            return RESTS
        return LEVELS if now.attitude_is_given else FLIES

    @property
    def nominal_until_us(self) -> int:
        """Time from which an outer tick on the ground is not nominal, because it disarms."""
        return self._monitor.stands_until_us if self.now.landed or not self.now.flying else NEVER_US

    def pass_outer(
        self, time_us: int, is_new: bool, row: FloatArray, found: int, fell_us: int, lifts: Iterable[Lift]
    ) -> None:
        """Follow nominal outer ticks, whose kernels ran. The last was at ``time_us`` and wrote ``row``.

        Its state ``is_new``, or as before. ``found`` are its bits of ``detect``; ``fell_us`` is the time of the last
        fall, 0 for none. ``lifts`` has an element for each tick of a vehicle that began to lift off.
        """
        self._failsafes.states.is_new = is_new
        if is_new:
            self._good_row[:] = row
        self._monitor.pass_by(time_us, found, fell_us, lifts)

    def pass_by(self, count: int, time_us: int, row: FloatArray) -> None:
        """Count inner ticks whose kernels ran up to ``row`` at ``time_us``."""
        now = self.now
        self._tick += count
        now.time_us, now.row = time_us, row
        if now.flying and not now.rests:
            now.loops_reset = False

    def _guide(self) -> None:
        """Advance guidance, and reset the loops at ground contact. Hold both while the state is stale."""
        now, navigator = self.now, self._navigator
        flying = now.flying
        rested, now.rests = now.rests, False
        armed, mode = now.status
        waits = armed and mode is _MISSION  # on the ground before takeoff
        if self._failsafes.states.holds_rotors or not (flying or waits):
            return
        target = None
        touched = navigator.touches_ground
        navigator.step(mode, now.state, now.attitude_target, self._failsafes.rotor_thrust_n)
        flies_attitude = navigator.flies_attitude(mode)
        if touched and not navigator.touches_ground:  # it climbs, or was in the air
            navigator.reset_reference(now.state)
        touches = flying and navigator.touches_ground and not flies_attitude
        now.rests = touches and navigator.rests
        if rested or now.rests or (touches and not touched):  # integrators hold the contact forces
            self._backend.reset(now.state)
            now.loops_reset = True
        if flying and flies_attitude:
            target = navigator.attitude_target
        elif touches and not now.rests:
            target = navigator.levelling_target(now.attitude_target)
        if target is not None:
            self._backend.set_attitude_target(target)
        now.attitude_is_given = target is not None


class Lockstep:
    """Runs the ticks on the simulator's clock. Wall time is an argument.

    The step of the loops is fixed and independent of the simulator's. Each state is followed by the ticks that its time
    makes due: one tick if both steps are equal, two of 2 ms after a state 4 ms later, and none after an early or
    repeated state, which is answered with the last commands. Loops, timers and failsafes thus all count simulator time.
    """

    def __init__(self, link: SimulatorEndpoint, autopilot: TickingAutopilot, interval_us: int) -> None:
        self._link = link
        self._autopilot = autopilot
        self._now = autopilot.now
        self._interval_us = interval_us
        self._begun = False
        self._lead_us = 0  # advance of the vehicle clock while the simulator clock stood still
        self._seen_us = 0  # simulator time at the last call of ``_update_stall``
        self._seen_ns = 0  # wall time then
        self._stalled = False

    def tick(self, now_ns: int) -> FloatArray:
        """Run the ticks that the newest state makes due; return the commands to answer it with."""
        time_us = self._now.time_us + self._interval_us
        if self._link.time_us + self._lead_us == time_us and self._begun:  # the usual case
            return self._autopilot.tick(time_us)
        return self._catch_up(now_ns)

    @property
    def is_due(self) -> bool:
        """True if the next tick is that of the newest state, one interval after the last, and nothing else waits."""
        time_us = self._now.time_us + self._interval_us
        return self._begun and not self._lead_us and self._link.is_quiet(time_us)

    @property
    def is_quiet(self) -> bool:
        """True if the last tick was that of the newest state, and the vehicle's clock is the simulator's."""
        return self._begun and not self._lead_us and self._link.is_quiet(self._now.time_us)

    def _catch_up(self, now_ns: int) -> FloatArray:
        link, interval_us = self._link, self._interval_us
        if not self._begun:
            self._begun = True
            self._seen_us, self._seen_ns = link.time_us, now_ns
            return self._autopilot.tick(link.time_us)
        self._update_stall(now_ns)
        due_us = link.time_us + self._lead_us - self._now.time_us
        ticks = (due_us + interval_us // 2) // interval_us  # rounded: clocks have a resolution of 1 µs
        arrived = link.has_arrived
        if is_gap(due_us):  # ticks before the last one must not use the state after the gap as new
            link.has_arrived = False
        for left in reversed(range(ticks)):
            if left == 0:
                link.has_arrived = arrived
            self._autopilot.tick(self._now.time_us + interval_us)
        commands: FloatArray = self._now.row[LoopRow.ROTOR_COMMAND]
        return commands

    def _update_stall(self, now_ns: int) -> None:
        """Detect a stall of the simulator clock, and advance the vehicle clock by wall time during it."""
        if self._link.time_us != self._seen_us:
            self._seen_us, self._seen_ns = self._link.time_us, now_ns
            if self._stalled:
                self._stalled = False
                self._link.steps.tell(Severity.NOTICE, "Simulator clock runs again")
        elif self._stalled:
            passed_us = (now_ns - self._seen_ns) // 1000
            self._lead_us += passed_us
            self._seen_ns += passed_us * 1000
        elif now_ns - self._seen_ns > STALL_NS:
            self._stalled, self._seen_ns = True, now_ns
            self._link.steps.tell(Severity.CRITICAL, "Simulator clock stands still")
