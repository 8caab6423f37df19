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
        self._block = QuietBlock(stack, simulator, actuators) if compiles(stack, simulator) else None

    def count(self, simulator: Simulator) -> int:
        """Return how many of the next ticks are quiet. The last tick's answer was taken and is not applied yet."""
        if simulator.interval_us != self._interval_us or not self._lockstep.is_quiet:
            return 0
        count = min(self._autopilot.quiet_ticks, simulator.quiet_intervals())
        if self._estimation is not None:
            until_us = self._estimation.quiet_until_us
            count = min(count, (until_us - 1 - self._now.time_us) // self._interval_us)
        return count

    def run(self, simulator: Simulator, actuators: ActuatorsFrame, count: int) -> int:
        """Run ``count`` ticks, as many as ``count`` returned at most, and return how many; set ``actuators``.

        There are fewer after a reset of the estimate, which may change what is quiet.
        """
        done = self._run_block(simulator, actuators, count) or self._run_ticks(simulator, actuators, count)
        actuators.flags = self._link.flags(self._now.status.armed) | VALID_FLAG
        if self._inbox is not None:
            self._inbox.pass_by(self._now.time_us, simulator.stamp_us)
        return done

    def _run_block(self, simulator: Simulator, actuators: ActuatorsFrame, count: int) -> int:
        """Run the ticks as one compiled call; return 0 if a part of them is not compiled, or not ready for it."""
        block = self._block
        return block.run(count) if block is not None and block.fits(simulator, actuators) else 0

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
