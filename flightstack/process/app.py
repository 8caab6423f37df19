"""Main loop of the flight stack process: connects clock, transports and autopilot."""

from __future__ import annotations

import contextlib
import math
import select
import signal
import time
from dataclasses import replace
from types import FrameType

from flightstack.core.enums import Mode, Severity
from flightstack.core.errors import ConfigError, TargetError
from flightstack.firmware.choice import PYTHON, SERIAL, parse_loops
from flightstack.params.config import StackConfig
from flightstack.process.assembly import Stack, reboot_config, transfer_state
from flightstack.process.clock import DeadlineScheduler, minimise_timer_slack
from flightstack.process.connections import (
    GroundConnection,
    check_deadline,
    connect_simulator,
    serve_while_idle,
    simulator_end,
    wait_for_state,
)
from flightstack.process.lockstep_loop import LockstepLoop
from flightstack.process.process_config import (
    EXIT_LOST,
    EXIT_OK,
    EXIT_TIMEOUT,
    EXIT_USAGE,
    Ended,
    ProcessConfig,
    RebootRequestedError,
    complain,
)
from flightstack.process.process_files import ProcessFiles
from flightstack.process.quiet_exchange import compile_kernels
from flightstack.transports.cpu_affinity import AffinityFollower
from flightstack.transports.tcp import LinkClosedError, TcpClient
from flightstack.vehicle.estimation import Estimation

GROUND_POLL_NS = 500_000
GROUND_IDLE_NS = 5_000_000
"""Intervals of polling the ground links with and without traffic; a poll takes 40 µs."""
GROUND_BUSY_NS = 50_000_000
"""Time after received data in which the ground links are also served while waiting for the simulator.

Mission items are requested one at a time: served every outer tick alone, a transfer of 1000 items takes 10 s. Not while
states follow each other at full speed: then the outer ticks are frequent enough.
"""
GROUND_SHARE = 0.4
"""Maximum share of a real-time tick for sending to ground stations; the rest is sent in the next ticks."""
REPORT_S = 0.2
FIRST_CONTACT_S = 60.0
"""Timeout of the first message from a required ground station."""


class App:
    """Runs the flight stack until it is stopped or loses the simulator or a required ground station."""

    def __init__(self, config: StackConfig, process: ProcessConfig) -> None:
        self._process = process
        self._config = config
        self._files = ProcessFiles(process, self._prepare_reboot)
        self.stack = self._files.build(config)
        self._files.adopt(self.stack, config)
        if config.lockstep:
            compile_kernels(self.stack)
        self._next: tuple[Stack, StackConfig] | None = None
        self._ground = GroundConnection(process.ports, self.stack.ground)
        self._lockstep = config.lockstep
        self._stop_signal = 0
        self._began_s = time.monotonic()
        self._next_report_s = self._began_s + REPORT_S
        self._next_log_us = 0
        self._next_ground_ns = 0
        self._busy_until_ns = 0
        self._poller = select.poll()  # simulator and ground links
        self._serves_pauses = False
        self._follower: AffinityFollower | None = None

    # ------------------------------------------------------------------ lifecycle

    def run(self) -> int:
        """Run the process; return the exit code."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        simulator: TcpClient | None = None
        end = Ended(EXIT_LOST, "")
        try:
            simulator = self._connect()
            self._fly(simulator)
        except Ended as ended:
            end = ended
        except TargetError as error:
            self.stack.recorder.discard_row()
            end = Ended(EXIT_TIMEOUT, str(error))
        except ConfigError as error:  # at a reboot
            end = Ended(EXIT_USAGE, str(error))
        except LinkClosedError:
            end = Ended(EXIT_OK, "stopped") if self._stop_signal else simulator_end(self.stack)
        finally:
            self._close(simulator, end)
        return end.code

    def _connect(self) -> TcpClient:
        """Connect to the simulator, and reboot on request while waiting."""
        while True:
            try:
                return connect_simulator(self._process, self._serve_while_waiting)
            except RebootRequestedError:
                self._reboot()

    def _fly(self, simulator: TcpClient) -> None:
        """Wait for the first state and run the loops until the process ends, with reboots on request."""
        holds_time, waits = self._process.wait_for_start, True
        self._poller.register(simulator, select.POLLIN)
        self._ground.register(self._poller)
        simulator.send(self.stack.simulator.initial_requests(self.stack.rates.interval_us))
        while True:
            try:
                if waits:
                    wait_for_state(simulator, self.stack, self._process, self._serve_while_waiting)
                waits = False
                if holds_time:
                    if self.stack.estimation is not None:
                        waits = True
                        self._run(simulator, self.stack.estimation)
                        waits = False
                    self._hold_time(simulator)
                holds_time = False
                self._run(simulator)
            except RebootRequestedError:
                self._reboot()
                if not holds_time:  # the last state was answered: the simulator sends the next one
                    waits = True

    def _prepare_reboot(self) -> str | None:
        """Build the stack for a reboot; return why it failed, in which case the current one continues."""
        config = reboot_config(self.stack, self._config)
        is_exclusive = (
            parse_loops(config.loops).kind == SERIAL
        )  # a serial port opens once: test with other loops
        try:
            tested = replace(config, loops=PYTHON) if is_exclusive else config
            stack = self._files.build(tested)
        except (ConfigError, TargetError) as error:
            complain(f"not rebooted: {error}")
            return f"not rebooted: {error}"
        if (problem := self._files.unsaved_parameters()) is not None:
            stack.loops.close()
            return f"not rebooted: {problem}"
        self._next = None if is_exclusive else (stack, config)
        return None

    def _reboot(self) -> None:
        """Replace the current stack by the prepared one."""
        old = self.stack
        old.recorder.close()
        self._files.update()
        self._ground.detach(time.monotonic())  # sends the acknowledgement of the command
        self._files.close_loops()
        config = reboot_config(old, self._config)
        new, config = self._next or (self._files.build(config), config)
        self._next = None
        self._files.adopt(new, config)
        self.stack = new
        self._ground.attach(new.ground)
        self._next_log_us = 0
        transfer_state(old, new)
        new.journal.say(Severity.NOTICE, "Rebooted")
        complain("rebooted")

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._stop_signal = number

    def _close(self, simulator: TcpClient | None, end: Ended) -> None:
        """Close logs and files, and announce the end to the ground stations, with the reason of a failure.

        The simulator is told of an orderly end alone: without it, it reports a loss.
        """
        orderly, reason = end.code == EXIT_OK, str(end)
        if reason:
            complain(reason)
        if reason and not orderly:
            self.stack.journal.say(Severity.CRITICAL, reason[0].upper() + reason[1:])
        self.stack.recorder.close()
        self._files.close_loops()
        if self._next is not None:
            self._next[0].loops.close()
        self._files.close_parameters()
        self._files.update()
        self._files.close_plans()
        self._files.update()
        if reason:
            self._ground.announce_shutdown()
        self._files.close_signing()
        if simulator is not None:
            if orderly:
                with contextlib.suppress(LinkClosedError):
                    armed = self.stack.now.status.armed
                    simulator.send(self.stack.simulator.heartbeat(armed, leaving=True))
            simulator.close()
        self._ground.close()

    # ------------------------------------------------------------------ start

    def _hold_time(self, simulator: TcpClient) -> None:
        """Hold time at zero and serve the ground links until the vehicle flies a mission."""
        now = self.stack.now
        next_heartbeat_s = 0.0
        while not (now.status.armed and now.status.mode is Mode.MISSION):
            self._serve_while_waiting()
            if time.monotonic() >= next_heartbeat_s:  # keeps the simulator from a timeout
                next_heartbeat_s = time.monotonic() + 1.0
                simulator.send(self.stack.simulator.heartbeat(now.status.armed))
            self._send_requests(simulator)
            self._poller.poll(20)
            data = simulator.receive_now()
            if data is not None:
                self.stack.simulator.receive(data)

    # ------------------------------------------------------------------ loops

    def _run(self, simulator: TcpClient, starting: Estimation | None = None) -> None:
        """Run the loops until ``starting`` is ready before an outer tick, whose state stays unanswered."""
        if self._lockstep:
            self._run_lockstep(simulator, starting)
        else:
            self._run_real_time(simulator, starting)

    def _run_lockstep(self, simulator: TcpClient, starting: Estimation | None) -> None:
        """Answer each state with actuator commands; the simulator drives the time."""
        link, loop = self.stack.simulator, LockstepLoop(self.stack, simulator)
        self._follower = AffinityFollower(simulator.socket)
        is_over, fresh = False, True  # fresh: the state received before the start
        owes_ground = False  # the ground links wait until no received bytes do: a reboot would lose them
        while True:
            data = None
            if fresh:
                is_over = is_over or (starting is not None and starting.is_ready())
                if is_over and loop.ends_period:
                    return
                next_log_us = self._next_log_us if starting is None else 0  # no further than this period
                may_run_on = not (owes_ground or is_over)
                data = loop.run(self._next_ground_ns, next_log_us, may_run_on, self._serves_pauses)
                owes_ground = owes_ground or loop.serves_ground
                if loop.ends_period:
                    self._end_period()
                if owes_ground and data is None:
                    owes_ground = False
                    self._between_ticks(simulator)
            if data is None:
                loop.pace.begin_wait(time.monotonic_ns())
                # a command between the end and the next outer tick would act at a time that depends on the machine
                if self._serves_pauses and not is_over and loop.pace.pauses(simulator):
                    serve_while_idle(
                        simulator, self._poller, self.stack, self._process, self._serve_while_idle
                    )
                data = simulator.receive()
            fresh = self._wait_for_simulator(simulator, not is_over) if data is None else link.receive(data)

    def _serve_while_idle(self) -> None:
        """Serve the ground links between two states of the simulator, and check for a stop."""
        if self._serve_ground():
            self._busy_until_ns = time.monotonic_ns() + GROUND_BUSY_NS
        self._check_stop()

    def _wait_for_simulator(self, simulator: TcpClient, serves: bool) -> bool:
        """Serve the ground links, if asked to, until the simulator sends data; return True for a new state."""
        deadline_s = time.monotonic() + self._process.simulator_timeout_s
        while True:
            if serves:
                self._serve_while_waiting()
            else:
                self._check_stop()
            data = simulator.receive()
            if data is not None:
                return self.stack.simulator.receive(data)
            check_deadline(deadline_s, self.stack, self._process)

    def _run_real_time(self, simulator: TcpClient, starting: Estimation | None) -> None:
        """Tick at fixed deadlines on the newest state; the machine's clock drives the time."""
        link, autopilot, timing = self.stack.simulator, self.stack.autopilot, self.stack.timing
        minimise_timer_slack()
        scheduler = DeadlineScheduler(timing)
        self._ground.slice_ns = round(GROUND_SHARE * timing.period_ns)
        interval_us, tick, time_us = self.stack.rates.interval_us, 0, 0
        heard_s = time.monotonic()
        while True:
            time_us += interval_us * scheduler.wait()
            began_ns = time.monotonic_ns()
            data = simulator.receive_now()
            if data is not None and link.receive(data):
                heard_s = began_ns * 1e-9
            if starting is not None and starting.is_ready():
                return
            commands = autopilot.tick(time_us)
            simulator.send(link.answer(commands, autopilot.now.status.armed))
            timing.tick(began_ns, time.monotonic_ns())
            tick += 1
            ends_period = tick % self.stack.rates.divisor == 0
            if ends_period:
                self._end_period()
            if ends_period or self._serves_pauses:
                self._between_ticks(simulator)
                check_deadline(heard_s + self._process.simulator_timeout_s, self.stack, self._process)
            elif self._ground.is_sending:
                self._ground.send()

    def _end_period(self) -> None:
        """Log the timing if it is due, and notices of the link to the simulator."""
        time_us = self.stack.now.time_us
        if time_us >= self._next_log_us:
            self._next_log_us = time_us + 1_000_000
            fields = self.stack.report.log_fields(time_us // self.stack.rates.interval_us)
            self.stack.recorder.timing(time_us, **fields)
            if not self._lockstep:
                self.stack.simulator.steps.compare(self.stack.simulator.time_us, time_us)
        self._report_notices()

    def _between_ticks(self, simulator: TcpClient) -> None:
        """Serve the ground links if they are due, and check for a stop."""
        now_ns = time.monotonic_ns()
        if now_ns < self._next_ground_ns:
            return
        if self._follower is not None:
            self._follower.update()
        heard = self._serve_ground() or self.stack.ground.sends_files
        self._next_ground_ns = now_ns + (GROUND_POLL_NS if heard else GROUND_IDLE_NS)
        self._note_traffic(heard, now_ns)
        self._send_requests(simulator)
        self._check_stop()

    def _note_traffic(self, heard: bool, now_ns: int) -> None:
        """Begin or end to serve the ground links while waiting."""
        if heard:
            self._busy_until_ns = now_ns + GROUND_BUSY_NS
        self._serves_pauses = now_ns < self._busy_until_ns

    def _report_notices(self) -> None:
        """Report problems with the simulator's steps; raise Ended before a mission that cannot be flown."""
        link, now = self.stack.simulator, self.stack.now
        for severity, text in link.steps.take_notices():
            self.stack.journal.say(severity, text)
            complain(text[0].lower() + text[1:])
            if self._process.wait_for_start and now.landed and (refusal := link.step_refusal):
                raise Ended(EXIT_USAGE, refusal)

    def _send_requests(self, simulator: TcpClient) -> None:
        if requests := self.stack.simulator.take_requests():
            simulator.send(requests)

    # ------------------------------------------------------------------ ground links

    def _serve_ground(self) -> bool:
        """Exchange data with ground peers; return True if any was received."""
        now_s = time.monotonic()
        if now_s >= self._next_report_s:
            self._next_report_s = now_s + REPORT_S
            self.stack.report.update(self.stack.now.time_us, now_s)
        heard = self._ground.serve(now_s)
        self._files.update()
        return heard

    def _serve_while_waiting(self) -> None:
        """Check for a stop and serve the ground links."""
        self._check_stop()
        self._serve_ground()

    # ------------------------------------------------------------------ reasons to stop

    def _check_stop(self) -> None:
        if self._stop_signal:
            raise Ended(EXIT_OK, "stopped")
        if self.stack.ground.vehicle.reboot_requested:
            raise RebootRequestedError
        if self.stack.ground.vehicle.shutdown_requested:
            raise Ended(EXIT_OK, "shut down by the ground station")
        limit_s = self._process.exit_on_ground_loss_s
        if limit_s is None:
            return
        heard_s = self.stack.ground.last_heard_s
        now_s = time.monotonic()
        if heard_s > -math.inf and now_s - heard_s > limit_s:
            raise Ended(EXIT_LOST, f"ground station lost: nothing heard for {limit_s:g} s")
        if heard_s == -math.inf and now_s - self._began_s > FIRST_CONTACT_S:
            raise Ended(EXIT_TIMEOUT, f"no ground station within {FIRST_CONTACT_S:g} s")
