"""The ticks between two outer ticks in which nothing is due, without bytes between flight stack and simulator.

An exchange of bytes encodes, checks and decodes two or three frames, and asks each part whether it has something to do:
three quarters of an inner tick. If all parts are compiled, one kernel runs a block of ticks on their arrays.
"""

from __future__ import annotations

from collections.abc import Callable

from flightstack.process.assembly import Stack
from flightstack.process.quiet_block import QuietBlock, compiles, least_charge
from flightstack.process.quiet_outer import PassedTicks
from flightstack.process.quiet_sensors import estimators_of
from flightstack.simulator_link.hot_frames import VALID_FLAG, ActuatorsFrame
from flightstack.vehicle.autopilot import Lockstep
from flightstack.vehicle.quiet_kernel import LARGEST_RESULT, PAUSES
from sim_bridge import quiet_steps, step_kernel
from sim_bridge.plant.layout import CONTACT
from sim_bridge.quiet_steps import QuietSteps
from sim_bridge.simulator import Simulator

assert (CONTACT, step_kernel.PAUSES) == (LARGEST_RESULT, PAUSES)


def _have_equal_sensors(stack: Stack, simulator: Simulator) -> bool:
    """Return True if each estimator has the inertial sensor of its number, or there are neither."""
    if simulator.sensors is None:
        return stack.estimation is None
    return len(simulator.sensors.imu_wires) == len(estimators_of(stack)) > 0


class QuietTicks:
    """Runs the quiet ticks of a flight stack and a simulator whose steps are equal."""

    def __init__(
        self, stack: Stack, lockstep: Lockstep, simulator: Simulator, actuators: ActuatorsFrame
    ) -> None:
        self._stack, self._link, self._lockstep = stack, stack.simulator, lockstep
        self._autopilot, self._estimation = stack.parts.autopilot, stack.estimation
        self._inbox = stack.simulator.sensors
        self._now, self._interval_us = stack.now, stack.rates.interval_us
        self.is_idle = False
        """True if all ticks of the last ``run_periods`` or ``run_on`` were compiled: the vehicle had no event."""
        self._steps, self._block = None, None
        if compiles(stack) and quiet_steps.compiles(simulator) and _have_equal_sensors(stack, simulator):
            self._steps = QuietSteps(simulator, actuators.rotor_speed_rad_s, stack.simulator.plant.frame)
            self._block = QuietBlock(stack, self._steps)

    def on_passed(self, call: Callable[[PassedTicks], None] | None) -> None:
        """Call this after compiled calls of ticks."""
        if self._block is not None:
            self._block.on_passed = call

    def count(self, simulator: Simulator, actuators: ActuatorsFrame) -> int:
        """Return how many of the next ticks are quiet. The last tick's answer was taken and is not applied yet."""
        if not (self._is_in_step(simulator) and self._lockstep.is_quiet):
            return 0
        block = self._fitting(simulator, actuators)
        if block is not None:
            return min(block.count(), self._quiet_intervals(simulator))
        time_us, count = self._now.time_us, simulator.quiet_intervals(measures=False)
        if self._estimation is not None:
            quiet_us = self._estimation.quiet_until_us(measures=False) - 1 - time_us
            count = min(count, quiet_us // self._interval_us)
        return max(0, min(self._autopilot.quiet_ticks, count))

    def _is_in_step(self, simulator: Simulator) -> bool:
        """Return True if the simulator's next state comes one interval of the vehicle after the newest one."""
        return simulator.interval_us == self._interval_us and simulator.stamp_us == self._link.stamp_us

    def _quiet_intervals(self, simulator: Simulator) -> int:
        fixes = self._estimation is not None and self._estimation.takes_fixes
        return simulator.quiet_intervals(measures=True, fixes=fixes, reports=True)

    def _fitting(self, simulator: Simulator, actuators: ActuatorsFrame) -> QuietBlock | None:
        """Return the compiled ticks, None if a part of them is not compiled, or is not that of the start."""
        steps = self._steps
        if steps is None or not steps.fits(simulator, actuators.rotor_speed_rad_s):
            return None
        steps.least_charge[0] = least_charge(self._stack)
        return self._block

    def run_periods(self, simulator: Simulator, actuators: ActuatorsFrame, most: int) -> int:
        """Run the outer tick on the newest state and the ticks that follow it while nothing happens, ``most`` at most.

        Return their number; 0 if vehicle and simulator are not in step, or not compiled, or if the next tick is not an
        outer one: after a jump of the clock there were ticks without a state, or a state without a tick.
        """
        block = self._fitting(simulator, actuators)
        is_due = self._autopilot.next_outer == 0 and self._lockstep.is_due
        if block is None or not (is_due and self._is_in_step(simulator)):
            return 0
        done = block.run_periods(min(most, 1 + self._quiet_intervals(simulator)))
        self.is_idle = done > 0 and not block.waited
        self._answer(simulator, actuators, done - 1)
        return done or 1

    def run_on(self, simulator: Simulator, actuators: ActuatorsFrame, most: int) -> int:
        """Step the simulator, and run the next tick and those that follow while nothing happens, ``most`` at most.

        Return the number of ticks; 0, with nothing done, if the first one is not quiet or not compiled, or if the
        newest answer is that of a vehicle whose status has changed since.
        """
        block = self._fitting(simulator, actuators)
        if block is None or not (self._is_in_step(simulator) and self._lockstep.is_quiet):
            return 0
        if actuators.flags != self._link.flags(self._now.status.armed) | VALID_FLAG:
            return 0
        done = block.run_on(min(most, self._quiet_intervals(simulator)))
        if done:
            self.is_idle = not block.waited
            self._answer(simulator, actuators, done)
        return done

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
        commands, time_us = actuators.rotor_speed_rad_s, self._now.time_us
        estimation, sensors = self._estimation, simulator.sensors
        for _ in range(count):
            simulator.apply(actuators)
            link.plant.frame[:] = simulator.frame.frame
            link.pass_by(1)
            time_us += interval_us
            if estimation is not None:
                assert sensors is not None
                estimation.update_imus(time_us, interval_us, sensors.imu_wires)
            commands[:] = tick(time_us)
        return count
