"""The ticks between two outer ticks in which nothing is due, without bytes between flight stack and simulator.

An exchange of bytes encodes, checks and decodes two or three frames, and asks each part whether it has something to do:
three quarters of an inner tick. Here each part states beforehand for how long it has not. The parts that then remain
(plant, inertial sensors, filter, inner loop) are those of any other tick, and write the same log.
"""

from __future__ import annotations

from flightstack.process.assembly import Stack
from flightstack.simulator_link.hot_frames import VALID_FLAG, ActuatorsFrame
from flightstack.testing.quiet_block import QuietBlock, compiles
from flightstack.vehicle.lockstep import Lockstep
from sim_bridge.simulator import Simulator


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
