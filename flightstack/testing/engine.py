"""Flight stack and simulator in one process: they exchange the bytes of their sockets in lockstep."""

from __future__ import annotations

import io
import math
from collections.abc import Callable

from flightstack.control.backend import ControlBackend
from flightstack.firmware.targets import make_loops
from flightstack.flight_log.flight_log import FlightLog
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.process import compile_helper
from flightstack.process.assembly import Stack, build, reboot_config, transfer_state
from flightstack.process.config_check import vehicle_of
from flightstack.process.quiet_outer import PassedTicks
from flightstack.services.logs.log_store import NO_LOGS, LogStore
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.hot_frames import VALID_FLAG, ActuatorsFrame
from flightstack.testing.quiet_ticks import QuietTicks
from flightstack.testing.setup import Setup
from flightstack.vehicle.autopilot import Lockstep
from sim_bridge.server.failure_command import inject_failure
from sim_bridge.simulator import SIMULATOR_COMPONENT, Simulator

_PLANT = "flightstack.testing.setup:compile_plant"
_TIMING_US = 1_000_000
"""Interval of ``loop_timing`` in the log."""
MARGIN_S = 1e-6
"""Above the rounding of times in seconds, below their resolution."""


_BYTES = ("tick", "advance", "states", "take_answer")
"""Methods of ``Engine`` with which another one changes what the parts exchange."""


class LogBuffer(io.BytesIO):
    """A log file in memory, readable after it was closed."""

    content = b""

    def __init__(self, boot_s: float) -> None:
        super().__init__()
        self.boot_s = boot_s
        """Simulated time at which the vehicle was switched on: times of the log count from there."""

    def close(self) -> None:
        """Close the file and keep its content."""
        self.content = self.getvalue()
        super().close()


class Engine:
    """Advances vehicle and simulator by one exchange at a time."""

    def __init__(
        self,
        setup: Setup,
        flight_logs: LogStore = NO_LOGS,
        wrap_loops: Callable[[ControlBackend], ControlBackend] = lambda loops: loops,
    ) -> None:
        """Build both; raise ConfigError. ``wrap_loops`` may replace the control loops."""
        self.logs: list[LogBuffer] = []
        """One log for each flight, oldest first."""
        self.config = setup.stack_config()
        self._open: FlightLog | None = None
        self._boot_us = 0
        self._flight_logs = flight_logs
        self._wrap_loops = wrap_loops
        later = compile_helper.estimator_tasks(self.config)
        compile_helper.start(tasks=(compile_helper.GUIDANCE, _PLANT), later=later)
        self.stack = self._build()
        self._simulator: Simulator = setup.simulator(vehicle_of(self.config))
        self._simulator.set_interval_us(self.stack.rates.interval_us)
        self._codec = Link(1, SIMULATOR_COMPONENT)
        self.actuators = ActuatorsFrame()
        self.machine_ns = 0
        """Machine time of the exchanges: what passes while the simulator's clock stands still."""
        self.was_ready = False
        """True once the vehicle was ready to fly on its state since its boot."""
        self._loses_states = False
        self.step_is_pending = False
        """True if the simulator is to advance after the newest tick, which ``run`` or ``settle`` does."""
        self._changes_bytes = any(getattr(type(self), name) is not getattr(Engine, name) for name in _BYTES)
        self._begin()

    def _build(self) -> Stack:
        return build(
            self.config,
            self._open_log,
            self._flight_logs,
            make=lambda *choice: self._wrap_loops(make_loops(*choice)),
        )

    def _begin(self) -> None:
        """Connect the stack to the simulator: it has its first state."""
        self._endpoint, self._now = self.stack.simulator, self.stack.now
        self._interval_us, self._divisor = self.stack.rates.interval_us, self.stack.rates.divisor
        self.lockstep = Lockstep(self._endpoint, self.stack.autopilot, self._interval_us)
        """Ticks of the vehicle on the simulator's clock."""
        self._missed_us = self._next_timing_us = self._ticks = 0
        self.is_idle = True
        """True if the vehicle had no event since the last end of an outer period."""
        if self.stack.estimation is not None:
            self._simulator.start_sensors(self.config.home)
        self._quiet = QuietTicks(self.stack, self.lockstep, self._simulator, self.actuators)
        self._endpoint.receive(memoryview(self.states()))
        self._now.has_state = self.was_ready = self.stack.estimation is None

    def _open_log(self) -> FlightLog:
        self.logs.append(LogBuffer(self._boot_us * 1e-6))
        self._open = FlightLog(self.logs[-1], len(self.stack.vehicle.rotors))
        return self._open

    @property
    def simulator(self) -> Simulator:
        """The simulator, which has advanced after the newest tick."""
        self.settle()
        return self._simulator

    @simulator.setter
    def simulator(self, simulator: Simulator) -> None:
        self._simulator = simulator

    @property
    def loses_states(self) -> bool:
        """If True, ticks go on without states from the next one on, as in real time when a simulator hangs."""
        return self._loses_states

    @loses_states.setter
    def loses_states(self, loses_states: bool) -> None:
        self.settle()
        self._loses_states = loses_states

    def on_passed(self, call: Callable[[PassedTicks], None] | None) -> None:
        """Call this after compiled calls of ticks."""
        self._quiet.on_passed(call)

    @property
    def is_aligned(self) -> bool:
        """True if the periods of the outer loop are those of messages, as before a jump of the clock."""
        return self._left == self.stack.parts.autopilot.next_outer

    def time_at_s(self, vehicle_us: int) -> float:
        """Return the simulated time at a time of the vehicle [s]."""
        return (self._boot_us + vehicle_us) * 1e-6

    @property
    def time_s(self) -> float:
        """Simulated time since the start of the world [s]; the vehicle counts from its last power cycle."""
        return self.time_at_s(self._now.time_us)

    @property
    def newest_boot_s(self) -> float:
        """Simulated time from which the times of the newest log count [s]."""
        return self.logs[-1].boot_s if self.logs else 0.0

    @property
    def ready_from_s(self) -> float:
        """Time from which a vehicle that waits to be ready may be so; infinite for any other."""
        stack = self.stack
        if stack.estimation is None or self._now.status.armed or stack.is_ready:
            return math.inf
        return self.time_at_s(stack.estimation.health_due_us)

    def note_readiness(self) -> None:
        """Look whether the vehicle is ready; once in each outer tick."""
        self.was_ready = self.was_ready or self.stack.is_ready

    def newest_log(self) -> bytes:
        """Return the log of the newest flight, up to now if it is not over; b"" before the first."""
        if not self.logs:
            return b""
        if self.logs[-1].closed:
            return self.logs[-1].content
        assert self._open is not None
        self._open.flush()
        return self.logs[-1].getvalue()

    def tick(self) -> bool:
        """Run one exchange: state to the stack, actuators back. Return True after an outer tick."""
        link = self._endpoint
        if self._missed_us:
            commands = self.stack.autopilot.tick(link.time_us + self._missed_us)
        else:
            commands = self.lockstep.tick(self.machine_ns)
        for severity, text in link.steps.take_notices():
            self.stack.journal.say(severity, text)
        if self._changes_bytes or not link.answers_exactly:
            self.take_answer(link.answer(commands, self._now.status.armed))
        else:
            self.actuators.rotor_speed_rad_s[:] = commands
            self.actuators.flags = link.flags(self._now.status.armed) | VALID_FLAG
        self._ticks += 1
        return self._ends_period()

    def _ends_period(self) -> bool:
        """Return True after an outer tick; record the timing of the loops when it is due."""
        if self._ticks % self._divisor:
            return False
        if self._now.time_us >= self._next_timing_us:
            self._record_timing()
        return True

    def run(self, most: int, until_s: float = -math.inf) -> tuple[int, bool]:
        """Run a tick and the quiet ones that follow it, ``most`` at most, up to the end of the outer period.

        If nothing happens, run on up to the end of the period at ``until_s``. Return their number, and True after an
        outer tick. As after ``tick``, the newest answer is not applied yet: the caller sets ``step_is_pending``.
        """
        count, ends = self._run(most, until_s)
        if ends:
            self.is_idle = True
        return count, ends

    def _run(self, most: int, until_s: float) -> tuple[int, bool]:
        if self._changes_bytes or self._loses_states or self._missed_us > 0:
            self.settle()
            return 1, self.tick()
        done = self._run_quiet(self._most(most, until_s))
        if not done:
            self.settle()
            done = self._run_from_outer(self._most(most, until_s))
        if done and not self._left:
            return done, self._ends_period() and not (self.is_idle and self.time_s < until_s - MARGIN_S)
        if not done:
            self.is_idle = False
            if self.tick():
                return 1, True
            done = 1
        count = min(most - done, self._left, self._quiet.count(self._simulator, self.actuators))
        if count > 0:
            count = self._quiet.run(self._simulator, self.actuators, count)
            self._count(count, count)
            return done + count, self._ends_period()
        return done, False

    @property
    def _left(self) -> int:
        """Ticks up to the end of the outer period."""
        return -self._ticks % self._divisor

    def _most(self, most: int, until_s: float) -> int:
        """Return how many ticks may run without an exchange of messages at ``until_s``, ``most`` at most."""
        if self._left:
            return min(most, self._left)
        period_s = self._divisor * self._interval_us * 1e-6
        until_timing_s = (self._next_timing_us - self._now.time_us) * 1e-6
        idle_s = min(until_s - self.time_s, until_timing_s)
        periods = 1 + math.floor((idle_s - MARGIN_S) / period_s) if idle_s > period_s else 1
        return min(most, periods * self._divisor)

    def _run_quiet(self, most: int) -> int:
        """Run the pending step and the ticks that follow it while nothing happens; return their number, or 0."""
        if not (self.step_is_pending and self._endpoint.answers_exactly):
            return 0
        self.step_is_pending = False
        done = self._quiet.run_on(self._simulator, self.actuators, most)
        if done:
            self.is_idle = self.is_idle and self._quiet.is_idle
            self._count(done, done)
        else:
            self.step_is_pending = True
        return done

    def _run_from_outer(self, most: int) -> int:
        """Run an outer tick that exchanges no bytes, with the quiet ones that follow it; return their number, or 0."""
        if self._left or not self._endpoint.answers_exactly:
            return 0
        done = self._quiet.run_periods(self._simulator, self.actuators, most)
        if done:
            self.is_idle = self.is_idle and self._quiet.is_idle
            self._count(done, done - 1)
        return done

    def _count(self, ticks: int, intervals: int) -> None:
        self._ticks += ticks
        self.machine_ns += intervals * self._interval_us * 1000

    def _record_timing(self) -> None:
        time_us = self._now.time_us
        self._next_timing_us = time_us + _TIMING_US
        fields = self.stack.report.log_fields(time_us // self._interval_us)
        self.stack.recorder.timing(time_us, **fields)

    def settle(self) -> None:
        """Let the simulator make the pending step."""
        if self.step_is_pending:
            self.advance()

    def advance(self) -> None:
        """Advance the simulator by one interval with the newest actuators, and send the stack its state."""
        self.step_is_pending = False
        self._simulator.apply(self.actuators)
        self.machine_ns += self._interval_us * 1000
        if self._loses_states:
            self._missed_us += self._interval_us
        elif self._changes_bytes or not self._send_directly():
            self._send_states(self._endpoint)

    def _send_directly(self) -> bool:
        """Pass state and sensors to the stack without bytes; return False if there are further messages."""
        simulator, link = self._simulator, self._endpoint
        if not simulator.sends_state_alone or (simulator.sensors is None) is not (link.sensors is None):
            return False
        measurements = () if simulator.sensors is None else simulator.sensors.measurements
        if not measurements and simulator.sensors is not None:
            return False
        link.take(simulator.time_us, simulator.frame, measurements)
        return True

    def _send_states(self, endpoint: SimulatorEndpoint) -> None:
        if not endpoint.receive(memoryview(self.states())):
            raise AssertionError("the flight stack refuses a frame of the simulator")

    def states(self) -> bytes | memoryview:
        """Return the bytes that the simulator sends for one step."""
        return self._simulator.outgoing()

    def take_answer(self, answer: bytes | memoryview) -> None:
        """Take the stack's actuators."""
        if not self.actuators.open(answer):
            raise AssertionError("the simulator refuses a frame of the flight stack")

    def pass_requests(self) -> None:
        """Pass the vehicle's requests to the simulator, and the answers back."""
        requests = self.stack.simulator.take_requests()
        for request in self._codec.decode(requests) if requests else ():
            result = inject_failure(self._simulator, request.param1, request.param2, request.param3)
            ack = mavlink.MAVLink_command_ack_message(request.command, result)
            self.stack.simulator.receive(memoryview(self._codec.encode(ack)))

    def power_cycle(self, off_s: float) -> None:
        """Switch the vehicle off for ``off_s`` and on again: rotors stop, plans and parameters survive."""
        self.settle()
        old = self.stack
        old.recorder.close()
        self.actuators = ActuatorsFrame()  # all zero: disarmed
        steps_off = round(off_s * old.rates.inner_hz)
        for _ in range(steps_off):
            self._simulator.apply(self.actuators)
        self._send_states(old.simulator)  # the new vehicle's clock begins here
        self._boot_us += old.now.time_us + steps_off * old.rates.interval_us
        old.loops.close()
        self.config = reboot_config(old, self.config)
        self.stack = self._build()
        transfer_state(old, self.stack)
        self._begin()

    def close(self) -> None:
        """Close the log and the loops, which may hold a process."""
        self.stack.recorder.close()
        self.stack.loops.close()
