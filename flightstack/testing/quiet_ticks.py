"""The ticks between two outer ticks in which nothing is due, without bytes between flight stack and simulator.

An exchange of bytes encodes, checks and decodes two or three frames, and asks each part whether it has something to do:
three quarters of an inner tick. Here each part states beforehand for how long it has not. The parts that then remain
(plant, inertial sensors, filter, inner loop) are those of any other tick, and write the same log. If all of them are
compiled, one kernel runs a block of ticks on their arrays.
"""

from __future__ import annotations

from functools import partial
from typing import Any, TypeAlias

import numpy as np

from flightstack.commander.fault_detector import follow_rotors
from flightstack.control.loops import PythonLoops
from flightstack.core.compiled import IS_DISABLED, direct
from flightstack.core.contract import STATE_SIZE, FloatArray, LoopRow, RecordArray
from flightstack.core.kernel_calls import address_of
from flightstack.estimation.delayed_filter import imu_kernel
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.filter_core import PythonCore
from flightstack.estimation.imu_track import RECORD_SIZE, take_wire
from flightstack.flight_log.flight_log import DEFAULT_CAPACITY, Trace
from flightstack.flight_log.sensor_topics import IMU_GROUP
from flightstack.process.assembly import Stack
from flightstack.simulator_link.hot_frames import VALID_FLAG, ActuatorsFrame
from flightstack.testing.quiet_outer import QuietOuter
from flightstack.testing.quiet_slow import QuietSlow
from flightstack.vehicle.autopilot import Lockstep
from flightstack.vehicle.quiet_kernel import (
    QUIET_CALLS,
    QUIET_COUNTERS,
    QuietCalls,
    QuietCounters,
    fly_quiet_ticks,
)
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.layout import CONTACT
from sim_bridge.sensors.imu import measure_imu
from sim_bridge.sensors.layout import IMU, MOTION
from sim_bridge.simulator import Simulator

_Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of the kernel for one part."""


def _estimators(stack: Stack) -> tuple[Estimator, ...]:
    return () if stack.estimation is None else stack.estimation.estimators


def compiles(stack: Stack, simulator: Simulator) -> bool:
    """Return True if all parts of a quiet tick are compiled Python in this process."""
    parts: list[tuple[Any, type]] = [(stack.loops, PythonLoops), (simulator.plant, CompiledPlant)]
    parts += [(estimator.core, PythonCore) for estimator in _estimators(stack)]
    measures = simulator.sensors is not None and len(simulator.sensors.imu_wires) == len(_estimators(stack))
    return (
        not IS_DISABLED
        and all(type(part) is kind for part, kind in parts)
        and (measures or (stack.estimation is None and simulator.sensors is None))
    )


def _bytes(record: Any) -> Any:
    """Return the bytes of records or of a frame."""
    return np.frombuffer(record, np.uint8)


def _sensing(stack: Stack, simulator: Simulator) -> _Arguments:
    sensors, truth = simulator.sensors, simulator.frame
    if sensors is None or stack.estimation is None:  # nothing happens on the true state
        return (
            np.zeros(1, MOTION), np.zeros(0, IMU), truth.state, truth.rotor_speed_rad_s, np.zeros((0, 0, 0)),
            np.zeros((0, 0), np.float32), (np.zeros(0, np.uint8),), ((np.zeros((0, 0)), np.zeros(0, np.int64)),),
            (np.zeros(0, np.uint8),), np.zeros(RECORD_SIZE),
        )  # fmt: skip
    imus, tracks = sensors.imus, [lane.newest.imu_track for lane in stack.estimation.feed.lanes]
    return (
        imus.motion, imus.records, truth.state, truth.rotor_speed_rad_s, imus.noise, sensors.wires,
        tuple(_bytes(track.memory) for track in tracks), tuple((track.ring, track.taken) for track in tracks),
        tuple(_bytes(estimator.memory) for estimator in stack.estimation.estimators), np.zeros(RECORD_SIZE),
    )  # fmt: skip


def _estimates(stack: Stack) -> list[_Arguments]:
    """Return what the filter of each inertial sensor writes."""
    found: list[_Arguments] = []
    for number, estimator in enumerate(_estimators(stack)):
        memory = estimator.memory
        resets = tuple(memory["resets"][kind]["number"] for kind in ("position", "velocity", "yaw"))
        found.append((number, memory["state"][0], memory["flags"]["aligned"], resets))
    no_resets = np.zeros(1), np.zeros(1), np.zeros(1)
    return found or [(0, np.zeros(STATE_SIZE), np.zeros(1, np.int64), no_resets)]


class QuietBlock:
    """Runs quiet ticks of a vehicle and a simulator for which ``compiles`` is True."""

    def __init__(self, stack: Stack, simulator: Simulator, actuators: ActuatorsFrame) -> None:
        loops, plant = stack.loops, simulator.plant
        assert isinstance(loops, PythonLoops)
        assert isinstance(plant, CompiledPlant)
        self._stack, self._simulator, self._actuators = stack, simulator, actuators
        self._loops, self._plant = loops, plant
        self._sensors, self._estimation = simulator.sensors, stack.estimation
        self._estimates = _estimates(stack)
        self.outer = QuietOuter(stack, loops)
        self._slow = QuietSlow(simulator, stack.estimation, stack.simulator.truth)
        self._interval_us, self._divisor = simulator.interval_us, stack.rates.divisor
        self.waited = False
        """True if the last tick of ``run`` waited for Python."""
        self._counters = np.zeros(1, QUIET_COUNTERS)
        self._fraction, self._idle = np.zeros(1), np.zeros(LoopRow.SIZE)
        self._no_log = Trace(DEFAULT_CAPACITY, LoopRow.SIZE, lambda: None)
        self._no_imu_log = Trace(DEFAULT_CAPACITY, RECORD_SIZE, lambda: None)
        sensing = _sensing(stack, simulator)
        constant = self._constant(self._addresses(sensing), sensing)
        changing = self._changing(0, False, self._no_log, self._no_imu_log)
        self._fly = partial(direct(fly_quiet_ticks, *constant, *changing), *constant)

    def _addresses(self, sensing: _Arguments) -> RecordArray:
        """Return the addresses of the kernels."""
        now, faults, commands = (
            self._stack.now,
            self._stack.parts.failsafes.faults,
            self._actuators.rotor_speed_rad_s,
        )
        row, plant, loops = self._no_log.rows[0], self._plant, self._loops
        calls = QuietCalls(
            address_of(plant.kernel, plant.memory, commands, 0, 1, plant.output),
            address_of(loops.kernel, now.state, 1.0, now.rotor_speed, loops.memory, row),
            address_of(follow_rotors, row, faults.rotors, faults.lags),
            *(0, 0, 0),
        )
        if self._estimation is not None:
            track, record = self._estimation.feed.lanes[0].newest.imu_track, self._no_imu_log.rows[0]
            calls = calls._replace(
                measure=address_of(measure_imu, *sensing[:6]),
                take=address_of(take_wire, track.memory, sensing[5][0], 0.0, 1, record),
                estimate=address_of(imu_kernel, self._estimation.estimators[0].memory, track.ring[0]),
            )
        return np.array([calls], QUIET_CALLS)

    def _constant(self, calls: Any, sensing: _Arguments) -> _Arguments:
        """Return the arguments of the kernel that stay."""
        stack, simulator, loops = self._stack, self._simulator, self._loops
        now, faults, plant = stack.now, stack.parts.failsafes.faults, self._plant
        plant_part = (
            _bytes(plant.memory), self._actuators.rotor_speed_rad_s, simulator.steps, _bytes(plant.output), CONTACT,
            _bytes(simulator.frame.frame), _bytes(stack.simulator.frame),
        )  # fmt: skip
        control = (
            now.state, now.rotor_speed, _bytes(loops.memory), self._fraction, loops.fraction_step, self._idle,
            _bytes(faults.rotors), _bytes(faults.lags),
        )  # fmt: skip
        return (
            (calls, self.outer.calls, self._slow.calls), self._counters, self._interval_us, self._divisor, plant_part,
            sensing, self._slow.constant, control,
        )  # fmt: skip

    def _changing(self, count: int, is_taken: bool, log: Trace, imu_log: Trace) -> _Arguments:
        """Return the other arguments of the kernel."""
        now, estimation = self._stack.now, self._estimation
        boot_us = self._simulator.time_us - self._stack.simulator.time_us
        estimate = self._estimates[0 if estimation is None else estimation.feed.selected]
        return (
            count, is_taken, self._stack.parts.autopilot.next_outer, now.time_us, self._actuators.flags, self._flies,
            now.row, estimate, self._slow.following(boot_us), self.outer.arguments(),
            (log.rows, log.times_us, log.n), (imu_log.rows, imu_log.times_us, imu_log.n),
        )  # fmt: skip

    @property
    def _flies(self) -> bool:
        return self._stack.now.flying and not self._stack.now.rests

    def fits(self, simulator: Simulator, actuators: ActuatorsFrame) -> bool:
        """Return True if this block flies with these parts, and the simulator has its sensors as at the start."""
        return (
            actuators is self._actuators
            and simulator is self._simulator
            and simulator.sensors is self._sensors
        )

    def _logs(self) -> tuple[Trace, Trace]:
        """Return the traces of the inner loop and of the inertial sensor; without a log, some that are not recorded."""
        log, estimation = self._stack.recorder.log, self._estimation
        imu_log = None if estimation is None else estimation.recorder.trace(IMU_GROUP)
        return self._no_log if log is None else log.inner, imu_log or self._no_imu_log

    def room(self, is_taken: bool = False) -> int:
        """Return how many ticks ``run`` can run: 0 if a log is full or a fault acts between steps."""
        log, imu_log = self._logs()
        advances = min(self._plant.quiet_steps() // self._simulator.steps, imu_log.capacity - imu_log.n)
        if self._sensors is not None:
            advances = min(advances, self._sensors.imus.rows_left(), self._slow.room())
        return min(advances + is_taken, log.capacity - log.n)

    def run(self, count: int, is_taken: bool = False) -> int:
        """Run ``count`` ticks, ``room`` at most, or fewer, but one at least.

        With ``is_taken``, vehicle and estimator have the state of the first one. Return their number. Raise
        PlantDivergedError.
        """
        stack, recorded = self._stack, self._stack.recorder.log
        log, imu_log = self._logs()
        now, flies = stack.now, self._flies
        self._fraction[0] = self._loops.fraction
        if not flies:
            self._loops.idle(now.state, now.rotor_speed, now.status.armed, self._idle)
        self._fly(*self._changing(count, is_taken, log, imu_log))
        done = self._done()
        ticks = done.ticks
        self._loops.fraction = float(self._fraction[0])
        rows = log.rows[log.n :]
        if recorded is not None:
            log.n += ticks
        if imu_log is not self._no_imu_log:
            imu_log.n += done.sensed
        return self._count(rows, done)

    def _done(self) -> QuietCounters:
        return QuietCounters(*self._counters[0].item())

    def _count(self, rows: FloatArray, done: QuietCounters) -> int:
        """Bring all parts to the time of the kernel, and run a tick that waits; return the number of ticks.

        ``rows`` are those of the ticks. A tick waits after a reset of the estimate, or for an event of the outer loop.
        """
        stack, interval_us, began_us = self._stack, self._interval_us, self._stack.now.time_us
        ticks, flown, result, sensed, waits = done
        self.waited = waits > 0
        if flown:
            stack.simulator.pass_by(flown)
        last_outer = self.outer.pass_by(stack.recorder.log, began_us, interval_us, rows)
        if waits or last_outer != ticks - 1:
            stack.simulator.has_arrived = True
        if ticks:
            stack.parts.autopilot.pass_by(ticks, began_us + ticks * interval_us, rows[ticks - 1])
        fields, mag, baro = self._slow.pass_by()
        if flown:
            self._simulator.pass_by(flown, result, fields)
        if self._estimation is not None and sensed:
            self._estimation.pass_by(began_us + (ticks + waits) * interval_us, interval_us, mag, baro)
        if waits:
            commands = stack.parts.autopilot.tick(began_us + (ticks + 1) * interval_us)
            self._actuators.rotor_speed_rad_s[:] = commands
        return int(ticks + waits)


class QuietTicks:
    """Runs the quiet ticks of a flight stack and a simulator whose steps are equal."""

    def __init__(
        self, stack: Stack, lockstep: Lockstep, simulator: Simulator, actuators: ActuatorsFrame
    ) -> None:
        self._link, self._lockstep = stack.simulator, lockstep
        self._autopilot, self._estimation = stack.parts.autopilot, stack.estimation
        self._inbox = stack.simulator.sensors
        self._now, self._interval_us = stack.now, stack.rates.interval_us
        self.is_idle = False
        """True if all ticks of the last call of ``run_periods`` were compiled ones: the vehicle had no event."""
        self._block = QuietBlock(stack, simulator, actuators) if compiles(stack, simulator) else None

    def count(self, simulator: Simulator, actuators: ActuatorsFrame) -> int:
        """Return how many of the next ticks are quiet. The last tick's answer was taken and is not applied yet."""
        if not (self._is_in_step(simulator) and self._lockstep.is_quiet):
            return 0
        block = self._fitting(simulator, actuators)
        count = min(
            self._autopilot.quiet_ticks,
            self._quiet_intervals(simulator, self._now.time_us, block is not None),
        )
        return count if block is None or count <= 0 else min(count, block.room())

    def _is_in_step(self, simulator: Simulator) -> bool:
        """Return True if the simulator's next state comes one interval of the vehicle after the newest one."""
        return simulator.interval_us == self._interval_us and simulator.stamp_us == self._link.stamp_us

    def _fitting(self, simulator: Simulator, actuators: ActuatorsFrame) -> QuietBlock | None:
        """Return the compiled ticks, None if a part of them is not compiled, or is not that of the start."""
        block = self._block
        return block if block is not None and block.fits(simulator, actuators) else None

    def _quiet_intervals(self, simulator: Simulator, time_us: int, measures: bool) -> int:
        """Return after how many of the next intervals there is nothing but the loops to run; ``time_us`` is now.

        With ``measures``, magnetometer and barometer are part of it.
        """
        count = simulator.quiet_intervals(measures)
        if self._estimation is not None:
            count = min(count, (self._estimation.quiet_until_us(measures) - 1 - time_us) // self._interval_us)
        return max(0, count)

    def run_periods(self, simulator: Simulator, actuators: ActuatorsFrame, most: int) -> int:
        """Run the outer tick on the newest state and the ticks that follow it while nothing happens, ``most`` at most.

        Return their number; 0 if vehicle and simulator are not in step, or not compiled, or if the next tick is not an
        outer one: after a jump of the clock there were ticks without a state, or a state without a tick.
        """
        block = self._fitting(simulator, actuators)
        is_due = self._autopilot.next_outer == 0 and self._lockstep.is_due
        if block is None or not (is_due and self._is_in_step(simulator)):
            return 0
        time_us, done = self._now.time_us + self._interval_us, 0
        if self._estimation is not None:
            self._estimation.update(time_us)
        if self._autopilot.is_nominal():
            intervals = self._quiet_intervals(simulator, time_us, measures=True)
            most = min(most, 1 + intervals, block.outer.room(time_us), block.room(is_taken=True))
            done = block.run(most, is_taken=True) if most > 0 else 0
        self.is_idle = done > 0 and not block.waited
        if not done:
            actuators.rotor_speed_rad_s[:] = self._autopilot.tick(time_us)
        self._answer(simulator, actuators, done - 1)
        return done or 1

    def run(self, simulator: Simulator, actuators: ActuatorsFrame, count: int) -> int:
        """Run ``count`` ticks, as many as ``count`` returned at most, and return how many; set ``actuators``.

        There are fewer after a reset of the estimate, which may change what is quiet.
        """
        block = self._fitting(simulator, actuators)
        done = self._run_ticks(simulator, actuators, count) if block is None else block.run(count)
        self._answer(simulator, actuators, done)
        return done

    def _answer(self, simulator: Simulator, actuators: ActuatorsFrame, intervals: int) -> None:
        """End a call of ``intervals`` of the simulator: the newest commands are the answer to the newest state."""
        actuators.flags = self._link.flags(self._now.status.armed) | VALID_FLAG
        if self._inbox is not None and intervals > 0:
            self._inbox.pass_by(self._now.time_us, simulator.stamp_us)

    def _run_ticks(self, simulator: Simulator, actuators: ActuatorsFrame, count: int) -> int:
        """Run the ticks one after another, each part by itself."""
        link, tick, interval_us = self._link, self._autopilot.tick, self._interval_us
        commands, frame, time_us = actuators.rotor_speed_rad_s, simulator.frame, self._now.time_us
        estimation, sensors = self._estimation, simulator.sensors
        for _ in range(count):
            simulator.apply(actuators)
            link.frame[:] = frame.frame
            link.pass_by(1)
            time_us += interval_us
            if estimation is not None:
                assert sensors is not None
                estimation.update_imus(time_us, interval_us, sensors.imu_wires)
            commands[:] = tick(time_us)
        return count
