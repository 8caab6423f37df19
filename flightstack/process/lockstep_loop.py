"""Ticks in lockstep with the simulator's process: one or many for each call, whose answers go to the simulator."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from flightstack.core.contract import FloatArray
from flightstack.process.assembly import Stack
from flightstack.process.connections import SimulatorPace
from flightstack.process.quiet_block import QuietBlock, compiles
from flightstack.process.quiet_exchange import ExchangedSteps, Span
from flightstack.process.quiet_sensors import estimators_of
from flightstack.transports import compiled_socket
from flightstack.transports.tcp import LinkClosedError, TcpClient
from flightstack.vehicle.autopilot import Lockstep


class Ran(NamedTuple):
    """What a call of ``QuietLockstep.run`` did."""

    ticks: int
    unsent: memoryview | None
    """The rest of the newest answer, empty if all of it was sent; None if it is not sealed yet."""
    received: memoryview | None
    """Bytes that the link is to take, empty if the peer closed the connection; None if nothing was received."""


class QuietLockstep:
    """Runs ticks in lockstep with a simulator whose messages are those of a quiet step, and leaves others to Python."""

    def __init__(self, stack: Stack, lockstep: Lockstep, connection: socket.socket) -> None:
        self._stack, self._lockstep, self._connection = stack, lockstep, connection
        self._autopilot = stack.parts.autopilot
        self._is_possible = compiled_socket.IS_AVAILABLE and compiles(stack)
        self._steps: ExchangedSteps | None = None
        self._block: QuietBlock | None = None

    def is_ready(self) -> bool:
        """Return True if ``run`` can be called; the first call that finds it possible loads the kernels."""
        if not self._is_possible or not self._stack.simulator.answers_exactly:
            return False
        return self._block is not None or self._prepare()

    def _prepare(self) -> bool:
        inbox = self._stack.simulator.sensors
        if inbox is not None and inbox.imu_count != len(estimators_of(self._stack)):
            return False
        self._steps = ExchangedSteps(self._stack, self._connection.fileno())
        self._block = QuietBlock(self._stack, self._steps)
        return True

    @property
    def commands(self) -> FloatArray:
        """The newest commands, rotor speeds [rad/s], shape (8,)."""
        assert self._steps is not None
        return self._steps.commands

    @property
    def waited_ns(self) -> int:
        """Sum of the waits for a state in the last call that count as pauses of the simulator."""
        assert self._steps is not None
        return int(self._steps.record["waited_ns"][0])

    @property
    def took_ns(self) -> Any:
        """Durations of the ticks of the last call whose answer it sent."""
        assert self._steps is not None
        return self._steps.took_ns

    @property
    def ended_ns(self) -> int:
        """Time at which the newest state of the last call was there."""
        assert self._steps is not None
        return int(self._steps.record["ended_ns"][0])

    def run(self, span: Span, most: Callable[[int], int]) -> Ran:
        """Run the tick of the newest state and those that follow; ``most`` returns how many may follow a number."""
        steps, block = self._steps, self._block
        assert steps is not None
        assert block is not None
        steps.begin(span)
        link = self._stack.simulator
        stamp_us = link.stamp_us
        if self._autopilot.next_outer == 0 and self._lockstep.is_due:
            ticks = block.run_periods(most(0)) or 1  # 0: the outer tick alone, in Python
        else:
            steps.commands[:] = self._lockstep.tick(span.began_ns)
            ticks = 1
        is_over = self._autopilot.next_outer == 0 and time.monotonic_ns() >= span.deadline_ns
        if not is_over and steps.socket.sent < 0 and self._lockstep.is_quiet:
            count = min(block.count(runs_on=True), most(ticks))
            if count > 0:
                ticks += block.run(count)
        if link.stamp_us != stamp_us and link.sensors is not None:
            link.sensors.pass_by(self._stack.now.time_us, link.stamp_us)
        sent = steps.socket.sent
        unsent = None if sent < 0 else link.actuators.frame[sent:]
        return Ran(ticks, unsent, steps.socket.received)


class LockstepLoop:
    """Runs the ticks of the newest states and answers them."""

    def __init__(self, stack: Stack, simulator: TcpClient) -> None:
        self._stack, self._simulator = stack, simulator
        self._lockstep = Lockstep(stack.simulator, stack.autopilot, stack.rates.interval_us)
        self._quiet = QuietLockstep(stack, self._lockstep, simulator.socket)
        self._divisor, self._interval_us = stack.rates.divisor, stack.rates.interval_us
        self._answered = 0  # states
        self.pace = SimulatorPace()
        """Recognises a simulator that waits between states."""
        self.serves_ground = False
        """True if the last call of ``run`` ended an outer period: ground links may be due."""

    @property
    def ends_period(self) -> bool:
        """True after the last state of an outer period, and at the start."""
        return self._answered % self._divisor == 0

    def run(
        self, deadline_ns: int, next_log_us: int, may_run_on: bool, serves_pauses: bool = False
    ) -> memoryview | None:
        """Run the tick of the newest state, which was received, and answer it.

        With ``may_run_on``, receive and answer more states up to ``deadline_ns`` of the monotonic clock, and up to the
        end of the outer period after ``next_log_us`` of the vehicle's; with ``serves_pauses``, up to the next pause of
        the simulator if one is expected. Return bytes that were received besides; raise LinkClosedError.
        """
        began_ns = time.monotonic_ns()
        self.pace.note_tick(began_ns)
        if may_run_on and self._quiet.is_ready():
            span = Span(began_ns, deadline_ns, serves_pauses and self.pace.may_pause())
            return self._run_on(span, next_log_us)
        stack = self._stack
        commands = self._lockstep.tick(began_ns)
        self._simulator.send(stack.simulator.answer(commands, stack.now.status.armed))
        stack.timing.tick(began_ns, time.monotonic_ns())
        self._answered += 1
        self.serves_ground = self.ends_period
        return None

    def _run_on(self, span: Span, next_log_us: int) -> memoryview | None:
        stack, quiet = self._stack, self._quiet
        ran = quiet.run(span, partial(self._most, next_log_us))
        self._answered += ran.ticks
        self.serves_ground = self.ends_period
        if ran.unsent is None:
            self._simulator.send(stack.simulator.answer(quiet.commands, stack.now.status.armed))
        elif ran.unsent:
            self._simulator.send(ran.unsent)
        ended_ns = time.monotonic_ns()
        stack.timing.ticks_took(quiet.took_ns)
        if ran.unsent is None:
            stack.timing.tick(quiet.ended_ns, ended_ns)
        self.pace.note_wait(ended_ns, quiet.waited_ns)
        if ran.received is not None and not ran.received:
            raise LinkClosedError
        return ran.received

    def _most(self, next_log_us: int, ticks: int) -> int:
        """Return how many ticks may follow ``ticks``: up to the end of the outer period after which the log is written.

        That is the first one that ends after ``next_log_us``, or the present one if the link has a notice.
        """
        left = -(self._answered + ticks) % self._divisor
        if not (ticks or left):  # a period begins
            left = self._divisor
        if self._stack.simulator.steps.has_notices:
            return left
        ahead_us = next_log_us - self._stack.now.time_us - left * self._interval_us
        period_us = self._divisor * self._interval_us
        return left + max(0, -(-ahead_us // period_us)) * self._divisor
