"""A block of ticks in which nothing is due, as one compiled call on the arrays of the flight stack's parts.

A tick is quiet if it has no event: then it only runs simulator, filter, guidance and loops. Each other part states
beforehand for how long it has nothing to do. The kernels are those of any other tick, and write the same log. The
simulator is in this process, or exchanges its messages with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, TypeAlias

import numpy as np

from flightstack.commander.fault_detector import follow_rotors
from flightstack.control.loops import PythonLoops
from flightstack.core.compiled import IS_DISABLED, direct
from flightstack.core.contract import ByteArray, FloatArray, LoopRow, RecordArray, SingleArray
from flightstack.core.kernels.calls import address_of, as_bytes
from flightstack.estimation.delayed_filter import imu_kernel
from flightstack.estimation.filter_core import PythonCore
from flightstack.estimation.imu_track import RECORD_SIZE, take_wire
from flightstack.flight_log.flight_log import DEFAULT_CAPACITY, Trace
from flightstack.flight_log.sensor_topics import IMU_GROUP
from flightstack.process.assembly import Stack
from flightstack.process.quiet_outer import PassedTicks, QuietOuter
from flightstack.process.quiet_sensors import QuietSensors, estimates_of, estimators_of, sensing_of
from flightstack.simulator_link.battery_frame import BatteryReport
from flightstack.simulator_link.hot_frames import VALID_FLAG
from flightstack.vehicle.quiet_kernel import (
    QUIET_CALLS,
    QUIET_COUNTERS,
    QuietCalls,
    QuietCounters,
    fly_quiet_ticks,
)

_Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of the kernel for one part."""


class QuietSimulator(Protocol):
    """The simulator of quiet ticks: its kernel makes a step with ``commands``, and writes what the vehicle takes."""

    step: int
    """Address of the kernel; see ``QuietCalls``."""
    world: _Arguments
    """The first argument of the kernel."""
    commands: FloatArray
    """Rotor speeds [rad/s], shape (8,)."""
    wires: SingleArray
    """Measurements of the inertial sensors as in HIL_SENSOR, shape (sensors, 6)."""
    values: SingleArray
    """Measurements in HIL_SENSOR of the first one, shape (13,)."""
    news: RecordArray
    """New measurements besides those of the inertial sensors, ``SENSOR_NEWS``, shape (1,)."""
    gps: ByteArray
    """Payload of HIL_GPS with the newest fix."""

    def room(self) -> int:
        """Return for how many steps the kernel can be called."""
        ...

    def take_reports(self) -> list[tuple[int, BatteryReport]]:
        """Return the reports of the battery since the last call, with their times by the simulator's clock."""
        ...

    def pass_by(self, count: int, result: int) -> None:
        """Count steps that the kernel made, with the result of the last one; may raise."""
        ...


def compiles(stack: Stack) -> bool:
    """Return True if loops and filters are compiled Python in this process."""
    parts = [(stack.loops, PythonLoops), *((each.core, PythonCore) for each in estimators_of(stack))]
    return not IS_DISABLED and all(type(part) is kind for part, kind in parts)


_CHARGE_ROUNDING = 0.01
"""Of reports, which are in percent: with more charge than that the battery is not low."""


def least_charge(stack: Stack) -> float:
    """Return the charge up to which the vehicle may act on a report of the battery; infinity while it is low."""
    if stack.parts.failsafes.battery_level > 0:  # the next report may end that
        return math.inf
    b = stack.now.behaviour
    return max(b.battery_low, b.battery_critical, b.battery_emergency) + _CHARGE_ROUNDING


class QuietBlock:
    """Runs quiet ticks of a vehicle for which ``compiles`` is True, and of a simulator of its time step."""

    def __init__(self, stack: Stack, simulator: QuietSimulator) -> None:
        loops = stack.loops
        assert isinstance(loops, PythonLoops)
        self._stack, self._simulator, self._loops = stack, simulator, loops
        self._estimation, self._autopilot = stack.estimation, stack.parts.autopilot
        self._estimates = estimates_of(stack)
        self._outer = QuietOuter(stack, loops)
        self._sensors = QuietSensors(stack, simulator.values, simulator.news, simulator.gps)
        self._interval_us, self._divisor = stack.rates.interval_us, stack.rates.divisor
        self.waited = False
        """True if the last tick of ``run`` waited for Python."""
        self.on_passed: Callable[[PassedTicks], None] | None = None
        """Called after the kernel with its ticks, before anything else follows them."""
        self._passed = PassedTicks(stack.now, self._divisor, self._interval_us)
        self._counters = np.zeros(1, QUIET_COUNTERS)
        self._fraction, self._idle = np.zeros(1), np.zeros(LoopRow.SIZE)
        self._no_log = Trace(DEFAULT_CAPACITY, LoopRow.SIZE, lambda: None)
        self._no_imu_log = Trace(DEFAULT_CAPACITY, RECORD_SIZE, lambda: None)
        sensing = sensing_of(stack, simulator.wires)
        constant = self._constant(sensing)
        changing = self._changing(0, False, self._no_log, self._no_imu_log)
        self._fly = partial(direct(fly_quiet_ticks, *constant, *changing), *constant)

    def _addresses(self, sensing: _Arguments) -> RecordArray:
        """Return the addresses of the kernels."""
        now, faults = self._stack.now, self._stack.parts.failsafes.faults
        row, loops = self._no_log.rows[0], self._loops
        calls = QuietCalls(
            self._simulator.step,
            address_of(loops.kernel, now.state, 1.0, now.rotor_speed, loops.memory, row),
            address_of(follow_rotors, row, faults.rotors, faults.lags),
            *(0,) * (len(QuietCalls._fields) - 3),
        )
        if self._estimation is not None:
            track, record = self._estimation.feed.lanes[0].newest.imu_track, self._no_imu_log.rows[0]
            calls = calls._replace(
                take=address_of(take_wire, track.memory, sensing[0][0], 0.0, 1, record),
                estimate=address_of(imu_kernel, self._estimation.estimators[0].memory, track.ring[0]),
                **self._sensors.calls,
            )
        return np.array([calls], QUIET_CALLS)

    def _constant(self, sensing: _Arguments) -> _Arguments:
        """Return the arguments of the kernel that stay."""
        loops, simulator, faults = self._loops, self._simulator, self._stack.parts.failsafes.faults
        now = self._stack.now
        control = (
            now.state, now.rotor_speed, as_bytes(loops.memory), self._fraction, loops.fraction_step, self._idle,
            as_bytes(faults.rotors), as_bytes(faults.lags),
        )  # fmt: skip
        return (
            (self._addresses(sensing), self._outer.calls), self._counters, self._interval_us, self._divisor,
            simulator.world, simulator.commands, sensing, self._sensors.constant, control,
        )  # fmt: skip

    def _changing(self, count: int, is_taken: bool, log: Trace, imu_log: Trace) -> _Arguments:
        """Return the other arguments of the kernel."""
        now, estimation, link = self._stack.now, self._estimation, self._stack.simulator
        estimate = self._estimates[0 if estimation is None else estimation.feed.selected]
        return (
            count, is_taken, self._autopilot.next_outer, now.time_us, link.stamp_us - link.time_us,
            link.flags(now.status.armed) | VALID_FLAG, self._flies, now.row, estimate, self._sensors.following(),
            self._outer.arguments(), (log.rows, log.times_us, log.n), (imu_log.rows, imu_log.times_us, imu_log.n),
        )  # fmt: skip

    @property
    def _flies(self) -> bool:
        return self._stack.now.flying and not self._stack.now.rests

    def _logs(self) -> tuple[Trace, Trace]:
        """Return the traces of the inner loop and of the inertial sensor; without a log, some that are not recorded."""
        log, estimation = self._stack.recorder.log, self._estimation
        imu_log = None if estimation is None else estimation.recorder.trace(IMU_GROUP)
        return self._no_log if log is None else log.inner, imu_log or self._no_imu_log

    def _room(self, is_taken: bool) -> int:
        """Return how many ticks ``run`` can run: 0 if a log is full, or if the plant's steps need Python."""
        log, imu_log = self._logs()
        steps = min(self._simulator.room(), imu_log.capacity - imu_log.n, self._sensors.room())
        return min(steps + is_taken, log.capacity - log.n)

    def _quiet_intervals(self, time_us: int) -> int:
        """Return after how many of the next intervals there is nothing but the loops to run; ``time_us`` is now."""
        if self._estimation is None:
            return DEFAULT_CAPACITY
        return (self._estimation.quiet_until_us(measures=True) - 1 - time_us) // self._interval_us

    def count(self, *, runs_on: bool = False) -> int:
        """Return how many ticks ``run`` can run after the present one, which is over.

        They end before the next outer tick, unless ``runs_on`` and the next outer ticks are nominal.
        """
        autopilot, time_us = self._autopilot, self._stack.now.time_us
        most = autopilot.quiet_ticks
        if runs_on and autopilot.is_nominal():
            inner = autopilot.next_outer
            most = inner + self._outer.room(time_us + (inner + 1) * self._interval_us)
        return max(0, min(most, self._quiet_intervals(time_us), self._room(is_taken=False)))

    def run_periods(self, most: int) -> int:
        """Run the outer tick on the newest state and the ticks that follow it while nothing happens, ``most`` at most.

        Return their number; 0 if nothing but the outer tick was run, in Python.
        """
        time_us, done, happened = self._stack.now.time_us + self._interval_us, 0, False
        if self._estimation is not None:
            had_state = self._stack.now.has_state
            self._estimation.update(time_us)
            happened = self._stack.journal.has_events or self._stack.now.has_state is not had_state
        if happened:  # its messages are sent at the end of this period
            most = min(most, self._divisor)
        if self._autopilot.is_nominal():
            intervals = max(0, self._quiet_intervals(time_us))
            most = min(most, 1 + intervals, self._outer.room(time_us), self._room(is_taken=True))
            done = self.run(most, is_taken=True) if most > 0 else 0
        if not done:
            self._simulator.commands[:] = self._autopilot.tick(time_us)
        self.waited |= happened
        return done

    def run_on(self, most: int) -> int:
        """Run the ticks that follow the present one, ``most`` at most, and return their number."""
        count = min(most, self.count(runs_on=True))
        return self.run(count) if count > 0 else 0

    def run(self, count: int, is_taken: bool = False) -> int:
        """Run ``count`` ticks, or fewer.

        With ``is_taken``, vehicle and estimator have the state of the first one, which is run in any case. Return the
        number of ticks. Raise what the simulator raises.
        """
        stack, recorded = self._stack, self._stack.recorder.log
        log, imu_log = self._logs()
        now, flies = stack.now, self._flies
        self._fraction[0] = self._loops.fraction
        if not flies:
            self._loops.idle(now.state, now.rotor_speed, now.status.armed, self._idle)
        if self.on_passed is not None:
            self._passed.begin()
        self._fly(*self._changing(count, is_taken, log, imu_log))
        done = QuietCounters(*self._counters[0].item())
        self._loops.fraction = float(self._fraction[0])
        rows = log.rows[log.n :]
        if recorded is not None:
            log.n += done.ticks
        if imu_log is not self._no_imu_log:
            imu_log.n += done.sensed
        return self._count(rows, done)

    def _count(self, rows: FloatArray, done: QuietCounters) -> int:
        """Bring all parts to the time of the kernel, and run a tick that waits; return the number of ticks.

        ``rows`` are those of the ticks. A tick waits after a reset of the estimate, or for an event of the outer loop.
        """
        stack, interval_us, began_us = self._stack, self._interval_us, self._stack.now.time_us
        ticks, flown, result, sensed, waits = done
        self.waited = waits > 0
        if self.on_passed is not None and ticks:
            self._passed.end(rows[:ticks], self._outer.rows, self._autopilot.next_outer)
            self.on_passed(self._passed)
        if flown:
            stack.simulator.pass_by(flown)
        last_outer = self._outer.pass_by(stack.recorder.log, began_us, interval_us, rows)
        reports = self._simulator.take_reports()
        if last_outer is not None or reports:
            boot_us = stack.simulator.stamp_us - stack.simulator.time_us
            last_us = began_us + interval_us * (0 if last_outer is None else last_outer + 1)
            self._outer.take_reports([(at_us - boot_us, report) for at_us, report in reports], last_us)
        if waits or last_outer != ticks - 1:
            stack.simulator.has_arrived = True
        if ticks:
            self._autopilot.pass_by(ticks, began_us + ticks * interval_us, rows[ticks - 1])
        self._sensors.count_rows()
        if flown:
            self._simulator.pass_by(flown, result)
        if sensed:
            self._sensors.pass_by(began_us + (ticks + waits) * interval_us, interval_us)
        if waits:
            self._simulator.commands[:] = self._autopilot.tick(began_us + (ticks + 1) * interval_us)
        return int(ticks + waits)
