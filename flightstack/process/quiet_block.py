"""A block of ticks in which nothing is due, as one compiled call on the arrays of the flight stack's parts.

A tick is quiet if it has no event: then it only runs simulator, filter, guidance and loops. Each other part states
beforehand for how long it has nothing to do. The kernels are those of any other tick, and write the same log. The
simulator is in this process, or exchanges its messages with it.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, Protocol, TypeAlias

import numpy as np

from flightstack.commander.estimate_checks import LIMITS, watch_estimate
from flightstack.commander.fault_detector import follow_rotors
from flightstack.control.loops import PythonLoops
from flightstack.core.compiled import IS_DISABLED, direct
from flightstack.core.contract import (
    STATE_SIZE,
    ByteArray,
    FloatArray,
    LoopRow,
    RecordArray,
    SingleArray,
    Vector3,
)
from flightstack.core.kernel_calls import address_of, as_bytes
from flightstack.estimation.delayed_filter import imu_kernel, push_kernel
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.filter_core import PythonCore
from flightstack.estimation.fusion import GNSS_SIZE
from flightstack.estimation.health import WATCH
from flightstack.estimation.imu_track import RECORD_SIZE, take_wire
from flightstack.estimation.rings import MAG_RING
from flightstack.estimation.sensor_feed import SlowSamples, fix_row, fix_sample
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, MagSample
from flightstack.flight_log.flight_log import DEFAULT_CAPACITY, FlightLog, Trace
from flightstack.flight_log.sensor_recorder import GLOBAL_INTERVAL_US, NEVER_US, TRUTH_INTERVAL_US
from flightstack.flight_log.sensor_topics import (
    BARO_GROUP,
    GNSS_GROUP,
    IMU_GROUP,
    MAG_GROUP,
    TRUTH_GLOBAL_GROUP,
    TRUTH_GROUP,
)
from flightstack.process.assembly import Stack
from flightstack.process.quiet_outer import QuietOuter
from flightstack.simulator_link.gps_kernels import FIX_SIZE, FixRow
from flightstack.simulator_link.hot_frames import VALID_FLAG
from flightstack.simulator_link.sensor_frames import HIL_VALUES
from flightstack.vehicle.estimation import HEALTH_US, Estimation
from flightstack.vehicle.quiet_kernel import (
    QUIET_CALLS,
    QUIET_COUNTERS,
    QuietCalls,
    QuietCounters,
    fly_quiet_ticks,
)
from flightstack.vehicle.slow_kernel import SLOW_MARKS, SlowMarks

_Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of the kernel for one part."""


_GROUPS = (MAG_GROUP, BARO_GROUP, GNSS_GROUP, TRUTH_GROUP, TRUTH_GLOBAL_GROUP)
"""In the order of the kernel's counters of new rows."""


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

    def pass_by(self, count: int, result: int) -> None:
        """Count steps that the kernel made, with the result of the last one; may raise."""
        ...


def estimators_of(stack: Stack) -> tuple[Estimator, ...]:
    """Return the estimators of a vehicle that flies on its sensors."""
    return () if stack.estimation is None else stack.estimation.estimators


def compiles(stack: Stack) -> bool:
    """Return True if loops and filters are compiled Python in this process."""
    parts = [(stack.loops, PythonLoops), *((each.core, PythonCore) for each in estimators_of(stack))]
    return not IS_DISABLED and all(type(part) is kind for part, kind in parts)


def _sensing(stack: Stack, simulator: QuietSimulator) -> _Arguments:
    spare = np.zeros(RECORD_SIZE)
    if stack.estimation is None:  # nothing happens on the true state
        no_bytes = np.zeros(0, np.uint8)
        rings = ((np.zeros((0, 0)), np.zeros(0, np.int64)),)
        return np.zeros((0, 0), np.float32), (no_bytes,), rings, (no_bytes,), spare
    tracks = [lane.newest.imu_track for lane in stack.estimation.feed.lanes]
    return (
        simulator.wires,
        tuple(as_bytes(track.memory) for track in tracks),
        tuple((track.ring, track.taken) for track in tracks),
        tuple(as_bytes(estimator.memory) for estimator in stack.estimation.estimators),
        spare,
    )


def _estimates(stack: Stack) -> list[_Arguments]:
    """Return what the filter of each inertial sensor writes."""
    found: list[_Arguments] = []
    for number, estimator in enumerate(estimators_of(stack)):
        memory = estimator.memory
        resets = tuple(memory["resets"][kind]["number"] for kind in ("position", "velocity", "yaw"))
        found.append((number, memory["state"][0], memory["flags"]["aligned"], resets))
    no_resets = np.zeros(1), np.zeros(1), np.zeros(1)
    return found or [(0, np.zeros(STATE_SIZE), np.zeros(1, np.int64), no_resets)]


class QuietSensors:
    """The sensors that are not inertial, health, and the log of the truth, of a vehicle that flies on its sensors.

    Of one that flies on the true state: nothing is due.
    """

    def __init__(self, stack: Stack, values: SingleArray, news: RecordArray, gps: ByteArray) -> None:
        """``values``, ``news`` and ``gps`` are those of ``QuietSimulator``."""
        estimation = self._estimation = stack.estimation
        self._no_traces = [Trace(DEFAULT_CAPACITY, group.columns, lambda: None) for group in _GROUPS]
        self._log: FlightLog | None = None
        self._traces = self._no_traces
        """Those of the log."""
        self._marks = np.zeros(1, SLOW_MARKS)
        self._marks["fix"] = math.nan
        self._fix: GnssSample | None = None
        """The sample that is noted in the marks."""
        self._place = np.zeros(5)
        """Origin of the estimate, as ``GnssReceiver`` has that of the simulator."""
        self._marks["truth_us"] = self._marks["global_us"] = self._marks["health_us"] = NEVER_US
        self.push = self.watch = 0
        """Addresses of the kernels that give a filter a measurement, and update the health."""
        offset_m, place, watch, limits = np.zeros(3), np.zeros(5), np.zeros(1, WATCH), np.zeros(1, LIMITS)
        if estimation is not None:
            memory, track = estimation.estimators[0].memory, estimation.feed.lanes[0].newest.imu_track
            watch, limits = estimation.watch, estimation.limits
            self.push = address_of(push_kernel, memory, MAG_RING, np.zeros(4))
            self.watch = address_of(watch_estimate, memory, watch, track.memory, limits, False, False, 0.0)
            offset_m, place = estimation.recorder.offset_m, estimation.recorder.place
        scratch = np.zeros(4), np.zeros(4), np.zeros(2), np.zeros(2)
        gnss = gps, self._place, np.zeros(FIX_SIZE), np.zeros(GNSS_SIZE), np.zeros(GNSS_SIZE)
        truth = stack.simulator.truth, offset_m, place, TRUTH_INTERVAL_US, GLOBAL_INTERVAL_US
        health = watch, limits, HEALTH_US
        self.constant: tuple[Any, ...] = (
            self._marks,
            news,
            values.view(HIL_VALUES),
            scratch,
            truth,
            health,
            gnss,
        )
        """Argument ``slow`` of the kernel."""

    def room(self) -> int:
        """Return for how many ticks the logs suffice."""
        return min(trace.capacity - trace.n for trace in self._open_traces())

    def following(self) -> tuple[Any, ...]:
        """Return the argument ``following`` of the kernel; call once before each of its calls."""
        marks, estimation, delays_s = self._marks, self._estimation, (0.0, 0.0, 0.0)
        conditions = 0, False, False
        if estimation is not None:
            params = estimation.estimators[0].params
            delays_s = float(params.mag_delay_s), float(params.baro_delay_s), float(params.gnss_delay_s)
            self._begin(estimation)
            marks["truth_us"], marks["global_us"] = estimation.recorder.truth_due_us
            marks["health_us"], conditions = estimation.begin_watch()
        logs = tuple((trace.rows, trace.times_us, trace.n) for trace in self._open_traces())
        return delays_s, logs, conditions

    def _begin(self, estimation: Estimation) -> None:
        """Note the newest fix and the origin of the estimate; nothing is new."""
        marks, frame, newest = self._marks, estimation.estimators[0].frame, estimation.samples.gnss
        marks["mag_us"] = marks["baro_us"] = marks["gnss_us"] = 0
        for name in ("mag_rows", "baro_rows", "gnss_rows", "truth_rows", "global_rows"):
            marks[name] = 0
        if newest is not self._fix and newest is not None:
            self._fix, marks["fix"][0] = newest, fix_row(newest)
        if frame is not None:
            self._place[:] = (*frame.origin, *frame.scales)

    def _open_traces(self) -> list[Trace]:
        """Return the traces of the open log; without one, traces that are not recorded."""
        log = None if self._estimation is None else self._estimation.recorder.log
        if log is not self._log:
            self._log = log
            self._traces = self._no_traces if log is None else [log.sampled[group.name] for group in _GROUPS]
        return self._traces

    def count_rows(self) -> None:
        """Count the new rows of the log."""
        marks = SlowMarks(*self._marks[0].item())
        if self._estimation is None or marks.truth_us == NEVER_US:
            return
        self._estimation.recorder.pass_by((marks.truth_us, marks.global_us))
        rows = marks.mag_rows, marks.baro_rows, marks.gnss_rows, marks.truth_rows, marks.global_rows
        for trace, new in zip(self._open_traces(), rows, strict=True):
            trace.n += new

    def pass_by(self, time_us: int, interval_us: int) -> None:
        """Bring the estimation to ``time_us``."""
        assert self._estimation is not None
        marks = SlowMarks(*self._marks[0].item())
        mag = MagSample(marks.mag_us * 1e-6, Vector3(*marks.field_gauss.tolist())) if marks.mag_us else None
        baro = (
            BaroSample(marks.baro_us * 1e-6, marks.pressure_hpa, marks.altitude_m, marks.temperature_c)
            if marks.baro_us
            else None
        )
        gnss = fix_sample(marks.gnss_us * 1e-6, FixRow(*marks.fix.tolist())) if marks.gnss_us else None
        self._fix = gnss or self._fix
        self._estimation.pass_by(time_us, interval_us, SlowSamples(mag, baro, gnss), marks.health_us)


class QuietBlock:
    """Runs quiet ticks of a vehicle for which ``compiles`` is True, and of a simulator of its time step."""

    def __init__(self, stack: Stack, simulator: QuietSimulator) -> None:
        loops = stack.loops
        assert isinstance(loops, PythonLoops)
        self._stack, self._simulator, self._loops = stack, simulator, loops
        self._estimation, self._autopilot = stack.estimation, stack.parts.autopilot
        self._estimates = _estimates(stack)
        self._outer = QuietOuter(stack, loops)
        self._sensors = QuietSensors(stack, simulator.values, simulator.news, simulator.gps)
        self._interval_us, self._divisor = stack.rates.interval_us, stack.rates.divisor
        self.waited = False
        """True if the last tick of ``run`` waited for Python."""
        self._counters = np.zeros(1, QUIET_COUNTERS)
        self._fraction, self._idle = np.zeros(1), np.zeros(LoopRow.SIZE)
        self._no_log = Trace(DEFAULT_CAPACITY, LoopRow.SIZE, lambda: None)
        self._no_imu_log = Trace(DEFAULT_CAPACITY, RECORD_SIZE, lambda: None)
        sensing = _sensing(stack, simulator)
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
            *(0, 0, 0, 0),
        )
        if self._estimation is not None:
            track, record = self._estimation.feed.lanes[0].newest.imu_track, self._no_imu_log.rows[0]
            calls = calls._replace(
                take=address_of(take_wire, track.memory, sensing[0][0], 0.0, 1, record),
                estimate=address_of(imu_kernel, self._estimation.estimators[0].memory, track.ring[0]),
                push=self._sensors.push,
                watch=self._sensors.watch,
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
        time_us, done = self._stack.now.time_us + self._interval_us, 0
        if self._estimation is not None:
            self._estimation.update(time_us)
        if self._autopilot.is_nominal():
            intervals = max(0, self._quiet_intervals(time_us))
            most = min(most, 1 + intervals, self._outer.room(time_us), self._room(is_taken=True))
            done = self.run(most, is_taken=True) if most > 0 else 0
        if not done:
            self._simulator.commands[:] = self._autopilot.tick(time_us)
        return done

    def run(self, count: int, is_taken: bool = False) -> int:
        """Run ``count`` ticks, or fewer.

        With ``is_taken``, vehicle and estimator have the state of the first one, which is run in any case. Return their
        number. Raise what the simulator raises.
        """
        stack, recorded = self._stack, self._stack.recorder.log
        log, imu_log = self._logs()
        now, flies = stack.now, self._flies
        self._fraction[0] = self._loops.fraction
        if not flies:
            self._loops.idle(now.state, now.rotor_speed, now.status.armed, self._idle)
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
        if flown:
            stack.simulator.pass_by(flown)
        last_outer = self._outer.pass_by(stack.recorder.log, began_us, interval_us, rows)
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
