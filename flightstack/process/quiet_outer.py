"""Hands the arrays of monitor, guidance and outer loop to the kernel of nominal outer ticks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from operator import is_not
from typing import Any

import numpy as np

from flightstack.commander.fault_detector import detect
from flightstack.control.loops import PythonLoops
from flightstack.core.arrays import store_outer_row
from flightstack.core.contract import STATE_SIZE, FloatArray, LoopFlags, LoopRow, RecordArray
from flightstack.core.enums import Mode
from flightstack.core.kernels.calls import address_of
from flightstack.flight_log.flight_log import DEFAULT_CAPACITY, FlightLog, Trace
from flightstack.flight_log.topics import OUTER
from flightstack.guidance.fence import fence_step
from flightstack.guidance.kernels import GoalArrays, goal_kernel, levelling_kernel
from flightstack.guidance.land_detector import LEVELLING_LIFT
from flightstack.guidance.mission import MissionProgress
from flightstack.guidance.navigator import LEVEL_S
from flightstack.process.assembly import Stack
from flightstack.simulator_link.battery_frame import BatteryReport
from flightstack.vehicle.flight_monitor import Lift
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.outer_kernel import (
    FLIES,
    LEVELS,
    LIFTS,
    OUTER_CALLS,
    OUTER_MARKS,
    PROGRESS,
    RESTS,
    OuterCalls,
    OuterMarks,
)

_NEVER_M = -1.0
"""A distance to the takeoff altitude that is never reached."""
_FLAGS = {FLIES: LoopFlags.OUTER_DUE, LIFTS: LoopFlags.OUTER_DUE, LEVELS: LoopFlags.SET_TARGET}
"""Flags in the log, by phase; none while the loops are stopped."""


def _bytes(memory: Any) -> Any:
    return memory.reshape(-1).view(np.uint8)


class QuietOuter:
    """Nominal outer ticks of a vehicle whose loops are compiled Python."""

    def __init__(self, stack: Stack, loops: PythonLoops) -> None:
        parts, now = stack.parts, stack.now
        self._now, self._recorder = now, stack.recorder
        self._divisor = stack.rates.divisor
        self._period_us = self._divisor * stack.rates.interval_us
        self._navigator, self._autopilot = parts.navigator, parts.autopilot
        self._fence, self._faults = parts.failsafes.fence, parts.failsafes.faults
        self._takeoff, self._link = parts.takeoff, stack.simulator
        self._marks = np.zeros(1, OUTER_MARKS)
        self._state = _bytes(now.state)
        self._seen = np.zeros_like(self._state)
        self._progress = np.zeros(1, PROGRESS)
        self._control = loops.outer_arrays
        columns = OUTER.size + len(self._recorder.estimate)
        self._no_log = Trace(DEFAULT_CAPACITY, columns, lambda: None)
        self._key: tuple[Any, ...] = (None,) * 11
        self._arguments: tuple[Any, ...] = ()
        self._phase, self._trace = FLIES, self._no_log
        self._thrust_n = 0.0  # of the target before the kernel
        self._loops, self._rested = loops, np.zeros(STATE_SIZE)
        self._seen_bytes = b""
        self._progress_is: MissionProgress | None = None
        self.calls = self._addresses(loops)
        """Addresses of the kernels."""

    def _addresses(self, loops: PythonLoops) -> RecordArray:
        now, faults, fence, goal = self._now, self._faults, self._fence, self._navigator.goal
        target, _last_target, memory, parameters, last, outer_dt_s = self._control
        calls = OuterCalls(
            fence=address_of(fence_step, *fence.areas, fence.limits, now.state, fence.breach),
            detect=address_of(
                detect, now.state, now.setpoint, now.row, faults.rotors, faults.detectors, faults.limits, False, 1.0
            ),
            guide=address_of(
                goal_kernel, 0, now.state, goal.trajectory, goal.mission, goal.plan, goal.jumps_left,
                goal.mode_target, goal.land, target, 1.0, goal.params, 1.0, now.setpoint,
            ),
            command=address_of(
                loops.outer_kernel, now.state, now.setpoint, memory, parameters, last, outer_dt_s, target
            ),
            level=address_of(levelling_kernel, target, 1.0, 1.0, target),
            store=address_of(
                store_outer_row, self._no_log.rows[0], now.state, now.setpoint, target, 0
            ),
        )  # fmt: skip
        return np.array([calls], OUTER_CALLS)

    def room(self, time_us: int) -> int:
        """Return for how many ticks from the outer tick at ``time_us`` the open log takes rows without other work."""
        log, most = self._recorder.log, self._ticks_before(self._autopilot.nominal_until_us, time_us)
        if log is None:
            return min(most, self._divisor * self._no_log.capacity)
        return min(most, self._divisor * (log.outer.capacity - log.outer.n))

    @property
    def rows(self) -> FloatArray:
        """The log's rows of the kernel's outer ticks."""
        at, outers = int(self._marks[0]["at"]), int(self._marks[0]["outers"])
        return self._trace.rows[at : at + outers]

    def take_reports(self, reports: Iterable[tuple[int, BatteryReport]], last_us: int) -> None:
        """Give the vehicle the reports of the battery, with their times, and record it in the kernel's outer ticks.

        ``last_us`` is the time of the last one.
        """
        outers = int(self._marks[0]["outers"])
        first_us = last_us - (outers - 1) * self._period_us
        for time_us, report in reports:
            self._record_battery(first_us, min(last_us, time_us - 1))
            self._link.take_battery(report, time_us)
        self._record_battery(first_us, last_us)

    def _record_battery(self, first_us: int, last_us: int) -> None:
        """Record the battery in those of the outer ticks from ``first_us`` to ``last_us`` in which it is due."""
        recorder = self._recorder
        while recorder.log is not None:
            ticks = max(0, -((first_us - recorder.battery_due_us) // self._period_us))
            time_us = first_us + ticks * self._period_us
            if time_us > last_us:
                break
            recorder.battery(time_us)

    def _ticks_before(self, until_us: int, time_us: int) -> int:
        """Return how many ticks precede the first outer tick from ``until_us`` on, from that at ``time_us``."""
        return self._divisor * max(0, -((time_us - until_us) // self._period_us))

    def arguments(self) -> tuple[Any, ...]:
        """Return the kernel's argument ``outer``."""
        now, log, link = self._now, self._recorder.log, self._link
        trace = self._no_log if log is None else log.outer
        self._phase, self._trace, self._thrust_n = self._autopilot.phase, trace, float(self._control[0][4])
        self._marks["at"], self._marks["found"] = trace.n, self._faults.found
        if link.seen is not self._seen_bytes:
            self._seen_bytes = link.seen
            self._seen[:] = np.frombuffer(link.seen, np.uint8) if link.seen else 0
        if now.progress is not self._progress_is:
            self._progress_is = now.progress
            self._progress[0] = now.progress.current, now.progress.reached
        goal = self._navigator.goal
        key = (
            goal.plan, goal.jumps_left, self._navigator.modes, self._fence.arguments, self._faults.limits, trace,
            now.status.mode, self._takeoff.altitude_m, now.behaviour, now.status.armed, self._phase,
        )  # fmt: skip
        if any(map(is_not, key, self._key)):
            self._key, self._arguments = key, self._made(now.status.mode, goal, trace)
        return self._arguments

    def _made(self, mode: Mode, goal: GoalArrays, trace: Trace) -> tuple[Any, ...]:
        setpoint, faults, fence = self._now.setpoint, self._faults, self._fence.arguments
        memories = (
            goal.trajectory, goal.mission, goal.mode_target, goal.land, goal.jumps_left, setpoint, faults.detectors,
            faults.rotors, fence[-1],
        )  # fmt: skip
        views = tuple(_bytes(memory) for memory in memories)
        acceptance_m = self._now.behaviour.altitude_acceptance_m if mode is Mode.TAKEOFF else _NEVER_M
        is_mission, flags = mode is Mode.MISSION, int(_FLAGS.get(self._phase, 0))
        return (
            self._marks,
            (
                self._state, self._seen, float(self._takeoff.altitude_m), float(acceptance_m), is_mission,
                self._progress, self._phase, self._now.status.armed,
            ),
            fence,
            (faults.rotors, faults.detectors, faults.limits),
            (
                self._navigator.modes[mode], goal.trajectory, goal.mission, goal.plan, goal.jumps_left,
                goal.mode_target, goal.land, goal.params, goal.dt_s, setpoint,
            ),
            (*self._control, LEVELLING_LIFT * self._navigator.params.weight_n, goal.dt_s / LEVEL_S),
            (trace.rows, trace.times_us, OUTER.size, self._recorder.estimate, flags),
            (views, tuple(np.zeros_like(view) for view in views)),
        )  # fmt: skip

    def pass_by(self, log: FlightLog | None, began_us: int, interval_us: int, rows: Any) -> int | None:
        """Bring monitor, link and log to the time of the kernel; ``rows`` are those of the inner loop.

        Return the index of the last outer tick among the ticks, None without one.
        """
        marks = OuterMarks(*self._marks[0].item())
        if not marks.outers:
            return None
        last = marks.last
        time_us = began_us + (last + 1) * interval_us
        lifts: Iterable[Lift] = ()
        if self._phase == LIFTS:
            lifts = self._lifts(slice(marks.at, marks.at + marks.outers))
        elif self._phase == RESTS:
            self._rested[6:10] = self._control[0][:4]
            self._loops.reset(self._rested)
        if log is not None:
            log.outer.n += marks.outers
        self._seen_bytes = self._seen.tobytes()
        self._link.pass_outer(time_us, self._seen_bytes, marks.changed_us)
        is_new = marks.changed_us == time_us
        self._autopilot.pass_outer(time_us, is_new, rows[last], marks.found, marks.fell_us, lifts)
        return last

    def _lifts(self, ticks: slice) -> Iterable[Lift]:
        """Return what the monitor of the ground takes in outer ticks: the thrust is that of the tick before."""
        rows, times_us = self._trace.rows[ticks], self._trace.times_us[ticks].tolist()
        down_m, down_m_s = rows[:, OUTER.state + 2].tolist(), rows[:, OUTER.state + 5].tolist()
        thrust_n = [self._thrust_n, *rows[:-1, OUTER.target_thrust].tolist()]
        return map(Lift, times_us, down_m, down_m_s, thrust_n)


_SETPOINT = slice(OUTER.setpoint, OUTER.target_attitude)
_TARGET = slice(OUTER.target_attitude, OUTER.loop_flags)


class PassedTicks:
    """The ends of the outer periods in a compiled call, to which what telemetry of the motion reads can be set back.

    It is for the time between the kernel and all that follows it: the vehicle's time is that of before the call.
    """

    def __init__(self, now: FlightState, divisor: int, interval_us: int) -> None:
        self._now, self._divisor, self._interval_us = now, divisor, interval_us
        self._before = now.setpoint.copy(), now.attitude_target.copy()
        self._inner: FloatArray = np.zeros((0, LoopRow.SIZE))
        self._outer: FloatArray = np.zeros((0, OUTER.size))
        self._first = 0

    def begin(self) -> None:
        """Keep setpoint and attitude target of before the call."""
        now = self._now
        self._before[0][:], self._before[1][:] = now.setpoint, now.attitude_target

    def end(self, inner: FloatArray, outer: FloatArray, next_outer: int) -> None:
        """Take the rows of the loops; the first outer tick of the call came after ``next_outer`` ticks."""
        self._inner, self._outer = inner, outer
        self._first = next_outer - 1 if next_outer else self._divisor - 1

    def from_time(self, time_us: int) -> Iterator[int]:
        """Set the vehicle back to the end of each period from ``time_us`` on, and yield its time; then to now."""
        now, interval_us, began_us = self._now, self._interval_us, self._now.time_us
        after = now.state.copy(), now.setpoint.copy(), now.attitude_target.copy(), now.row
        earliest = -(-(time_us - began_us) // interval_us) - 1
        late = max(0, -(-(earliest - self._first) // self._divisor))
        for index in range(self._first + late * self._divisor, len(self._inner), self._divisor):
            now.time_us, now.row = began_us + (index + 1) * interval_us, self._inner[index]
            now.state[:] = now.row[LoopRow.STATE]
            now.setpoint[:], now.attitude_target[:] = self._targets(index)
            yield now.time_us
        now.state[:], now.setpoint[:], now.attitude_target[:], now.row = after
        now.time_us = began_us

    def _targets(self, index: int) -> tuple[FloatArray, FloatArray]:
        """Return setpoint and attitude target in the tick ``index``, which ends a period."""
        at = (index - self._first) // self._divisor - (1 if self._first != self._divisor - 1 else 0)
        if at < 0:
            return self._before
        return self._outer[at, _SETPOINT], self._outer[at, _TARGET]
