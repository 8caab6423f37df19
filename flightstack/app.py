"""The flight stack process: the only place where clock, transports and autopilot meet."""

from __future__ import annotations

import contextlib
import math
import select
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from flightstack.assembly import Stack, build
from flightstack.clock import DeadlineScheduler, ask_for_punctual_sleeps
from flightstack.config import StackConfig
from flightstack.ground.peer import PeerAddress
from flightstack.logging.flight_log import FlightLog
from flightstack.logging.log_files import LogFiles
from flightstack.logging.log_library import LogLibrary
from flightstack.logging.log_tail import FileTail
from flightstack.mavlink.services.log_store import NO_LOGS
from flightstack.mavlink.signing import Signing
from flightstack.modes import Mode
from flightstack.params.identity import SYSTEM_ID
from flightstack.params.saver import ParamSaver
from flightstack.reboot import carry_over, config_after
from flightstack.signing_file import create_key, open_signing, replace_key
from flightstack.snapshot import ERROR, NOTICE
from flightstack.transport.processor import Follower
from flightstack.transport.tcp import LinkClosedError, TcpClient
from flightstack.transport.vehicle_ports import Place, PortsConfig, VehiclePorts

EXIT_OK, EXIT_LOST, EXIT_USAGE, EXIT_TIMEOUT = range(4)
GROUND_POLL_NS = 500_000
GROUND_SHARE = 0.4
"""In real time, sending to ground stations takes so much of a tick at most; what is left waits for the next."""
REPORT_S = 0.2
SECOND_HELLO_S = 1.0
"""Silence after which a simulator is asked for the standard message."""
SIMULATOR_NOTICE_S = 10.0
"""Silence of a connected simulator after which the user is told; it is waited for longer: it may be compiling."""
FIRST_CONTACT_S = 60.0
"""How long a process that must not outlive its ground station waits for the first word from it."""


@dataclass(frozen=True)
class ProcessConfig:
    """What concerns the process and not the flight."""

    simulator_host: str
    simulator_port: int
    simulator_timeout_s: float
    ports: PortsConfig
    log: Path | None
    wait_for_start: bool
    exit_on_ground_loss_s: float | None
    signing_key: Path | None = None
    """File of the key that signs MAVLink; None: nothing is signed."""
    allow_unsigned: bool = False


class Ended(Exception):  # noqa: N818  # not an error: the way out of the loops
    """The process ends, with this exit code and sentence."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code


class RebootRequestedError(Exception):
    """A ground station wants the vehicle to start anew."""


class App:
    """Runs one flight stack until it is told to stop or loses someone it needs."""

    def __init__(self, config: StackConfig, process: ProcessConfig) -> None:
        self._process = process
        self._log_files = LogFiles(process.log)
        self._config = config
        self._saver: ParamSaver | None = None
        self._signing: Signing | None = None
        self.stack: Stack = self._build(config)
        self._ports = VehiclePorts(process.ports)
        self._lockstep = config.lockstep
        self._stop_signal = 0
        for channel, peer in self._ports.first_peers:
            self.stack.ground.add_peer(PeerAddress(channel, *peer), permanent=True)
        self._began_s = time.monotonic()
        self._next_report_s = self._began_s + REPORT_S
        self._next_log_us = 0
        self._next_ground_ns = 0
        self._follower: Follower | None = None
        self._sending: Iterator[tuple[PeerAddress, bytes]] | None = None
        self._slice_ns: int | None = None

    def _build(self, config: StackConfig) -> Stack:
        """Build a stack and join it to the files of this process; raise ConfigError."""
        log = self._process.log
        stack = build(config, self._open_log, NO_LOGS if log is None else LogLibrary(log.parent))
        stack.ground.vehicle.open_log_tail = self._open_tail
        self._signing = self._open_signing(stack)
        if config.params_file is not None:
            system_id = int(stack.params.value(SYSTEM_ID))
            self._saver = ParamSaver(stack.params, stack.loaded_params, Path(config.params_file), system_id)
        return stack

    def _open_signing(self, stack: Stack) -> Signing | None:
        """Sign the ground links if there is to be a key; raise ConfigError."""
        path = self._process.signing_key
        if path is None:
            return None
        if not path.exists():
            create_key(path)
            print(f"flightstack: a new signing key is in {path}", flush=True)
        role = f"vehicle-{self._process.ports.instance}"
        signing = open_signing(path, role, self._process.allow_unsigned)
        stack.ground.use_signing(signing, lambda key: replace_key(path, key))
        return signing

    # ------------------------------------------------------------------ life

    def run(self) -> int:
        """Run to the end; return the exit code."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        simulator: TcpClient | None = None
        code = EXIT_LOST
        try:
            simulator = self._connect()
            simulator.send(self.stack.simulator.hello(self.stack.rates.interval_us))
            self._wait_for_state(simulator)
            self._fly(simulator)
        except Ended as ended:
            if str(ended):
                print(f"flightstack: {ended}", file=sys.stderr, flush=True)
            code = ended.code
        except LinkClosedError:
            code = self._simulator_gone()
        finally:
            self._close(simulator, orderly=code == EXIT_OK)
        return code

    def _fly(self, simulator: TcpClient) -> None:
        """Run the loops until the process ends; a reboot begins anew."""
        holds_time = self._process.wait_for_start
        while True:
            try:
                if holds_time:
                    self._hold_time(simulator)
                holds_time = False
                if self._lockstep:
                    self._run_lockstep(simulator)
                else:
                    self._run_real_time(simulator)
            except RebootRequestedError:
                self._reboot()
                if not holds_time:  # the last state was answered: the next one comes by itself
                    self._wait_for_state(simulator)

    def _reboot(self) -> None:
        old = self.stack
        old.recorder.close()
        for (channel, host, port), data in old.ground.poll(time.monotonic()):  # the command's answer
            self._ports.send(channel, (host, port), data)
        if self._saver is not None:
            self._saver.close()
        if self._signing is not None:
            self._signing.close()
        self._sending = None
        self.stack = self._build(config_after(old, self._config))
        carry_over(old, self.stack)
        self.stack.autopilot.say(NOTICE, "Rebooted")
        print("flightstack: rebooted", file=sys.stderr, flush=True)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._stop_signal = number

    def _simulator_gone(self) -> int:
        now = self.stack.autopilot.now
        if self._stop_signal:
            return EXIT_OK
        at = f"at t={now.time_us * 1e-6:.3f} s"
        if self.stack.simulator.peer_said_goodbye and not now.status.armed:
            print(f"flightstack: the simulator was shut down {at}", file=sys.stderr, flush=True)
            return EXIT_OK
        print(f"flightstack: simulator lost {at}: it closed the connection", file=sys.stderr, flush=True)
        return EXIT_LOST

    def _close(self, simulator: TcpClient | None, orderly: bool) -> None:
        """End the log and, if all is in order, say goodbye: who hears nothing counts us as lost."""
        self.stack.recorder.close()
        if self._saver is not None:
            self._saver.close()
            if (problem := self._saver.take_error()) is not None:
                print(f"flightstack: {problem}", file=sys.stderr, flush=True)
        if orderly:
            for (channel, host, port), data in self.stack.ground.farewell():
                self._ports.send(channel, (host, port), data)
            self._ports.flush()
        if self._signing is not None:
            self._signing.close()
        if simulator is not None:
            if orderly:
                with contextlib.suppress(LinkClosedError):
                    armed = self.stack.autopilot.now.status.armed
                    simulator.send(self.stack.simulator.heartbeat(armed, leaving=True))
            simulator.close()
        self._ports.close()
        if self.stack.recorder.error is not None:
            print(
                f"flightstack: the log is incomplete: {self.stack.recorder.error}",
                file=sys.stderr,
                flush=True,
            )

    def _open_log(self) -> FlightLog | None:
        try:
            return self._log_files.open(len(self.stack.vehicle.rotors))
        except OSError as error:
            path = self._log_files.current
            self.stack.autopilot.say(ERROR, f"No log: {path}: {error.strerror}")
            print(
                f"flightstack: no log can be written to {path}: {error.strerror}", file=sys.stderr, flush=True
            )
            return None

    def _open_tail(self) -> FileTail | None:
        return self._log_files.tail(lambda: self.stack.recorder.is_logging)

    # ------------------------------------------------------------------ start

    def _connect(self) -> TcpClient:
        p = self._process
        try:
            return TcpClient.connect(
                p.simulator_host, p.simulator_port, p.simulator_timeout_s, self._between_tries
            )
        except (TimeoutError, OSError):
            raise Ended(
                EXIT_TIMEOUT,
                f"no simulator at {p.simulator_host}:{p.simulator_port} within {p.simulator_timeout_s:g} s: "
                "start sim-bridge, or name its port with --sim-port",
            ) from None

    def _between_tries(self) -> None:
        self._check_stop()
        self._serve_ground()

    def _wait_for_state(self, simulator: TcpClient) -> None:
        link, interval_us = self.stack.simulator, self.stack.rates.interval_us
        began_s = time.monotonic()
        asked_again = told = False
        while True:
            self._check_stop()
            self._serve_ground()
            data = simulator.receive()
            if data is not None and link.receive(data):
                break
            silent = time.monotonic() - began_s > SECOND_HELLO_S
            if not asked_again and (silent or link.request_refused):
                asked_again = True
                simulator.send(link.second_hello(interval_us))
            if not told and time.monotonic() - began_s > SIMULATOR_NOTICE_S:
                told = True
                self._tell_simulator_silent()
            self._check_simulator(began_s + self._process.simulator_timeout_s)
        self.stack.autopilot.has_state = True

    def _tell_simulator_silent(self) -> None:
        p = self._process
        sentence = f"the simulator at {p.simulator_host}:{p.simulator_port} is connected but sends no state"
        self.stack.autopilot.say(4, f"Waiting: {sentence}")
        print(
            f"flightstack: {sentence} for {SIMULATOR_NOTICE_S:g} s; it hangs, or compiles; waiting up to "
            f"{p.simulator_timeout_s:g} s",
            file=sys.stderr,
            flush=True,
        )

    def _hold_time(self, simulator: TcpClient) -> None:
        """Keep time at zero until the vehicle flies a mission; the ground links go on meanwhile."""
        poller = select.poll()
        poller.register(simulator, select.POLLIN)
        self._ports.register(poller)
        now = self.stack.autopilot.now
        next_sign_s = 0.0
        while not (now.status.armed and now.status.mode is Mode.MISSION):
            self._check_stop()
            self._serve_ground()
            if time.monotonic() >= next_sign_s:  # the simulator waits for an answer: say that we are here
                next_sign_s = time.monotonic() + 1.0
                simulator.send(self.stack.simulator.heartbeat(now.status.armed))
            self._pass_requests(simulator)
            poller.poll(20)
            data = simulator.receive_now()
            if data is not None:
                self.stack.simulator.receive(data)

    # ------------------------------------------------------------------ loops

    def _run_lockstep(self, simulator: TcpClient) -> None:
        """Answer each state with actuators; the simulator owns time."""
        link, autopilot, timing = self.stack.simulator, self.stack.autopilot, self.stack.timing
        receive, clock_ns = simulator.receive, time.monotonic_ns
        self._follower = Follower(simulator.socket)
        divisor, tick = self.stack.rates.divisor, 0
        fresh = True  # the state that came before the start
        while True:
            if fresh:
                began_ns = clock_ns()
                commands = autopilot.tick(link.time_us)
                simulator.send(link.answer(commands, autopilot.now.status.armed))
                timing.tick(began_ns, clock_ns())
                tick += 1
                if tick % divisor == 0:
                    self._between_ticks(simulator)
            data = receive()
            fresh = self._wait_slowly(simulator) if data is None else link.receive(data)

    def _wait_slowly(self, simulator: TcpClient) -> bool:
        """Serve the ground links while the simulator takes its time; return whether a state came."""
        deadline_s = time.monotonic() + self._process.simulator_timeout_s
        while True:
            self._check_stop()
            self._serve_ground()
            data = simulator.receive()
            if data is not None:
                return self.stack.simulator.receive(data)
            self._check_simulator(deadline_s)

    def _run_real_time(self, simulator: TcpClient) -> None:
        """Tick at fixed deadlines on the newest state; the machine's clock owns time."""
        link, autopilot, timing = self.stack.simulator, self.stack.autopilot, self.stack.timing
        ask_for_punctual_sleeps()
        scheduler = DeadlineScheduler(timing)
        self._slice_ns = round(GROUND_SHARE * timing.period_ns)
        interval_us, tick, time_us = self.stack.rates.interval_us, 0, 0
        heard_s = time.monotonic()
        while True:
            time_us += interval_us * scheduler.wait()
            began_ns = time.monotonic_ns()
            data = simulator.receive_now()
            if data is not None and link.receive(data):
                heard_s = began_ns * 1e-9
            commands = autopilot.tick(time_us)
            simulator.send(link.answer(commands, autopilot.now.status.armed))
            timing.tick(began_ns, time.monotonic_ns())
            tick += 1
            if tick % self.stack.rates.divisor == 0:
                self._between_ticks(simulator)
                self._check_simulator(heard_s + self._process.simulator_timeout_s)
            elif self._sending is not None:
                self._send()

    def _between_ticks(self, simulator: TcpClient) -> None:
        """Do what is due between two ticks: ground links, timing report, reasons to stop."""
        time_us = self.stack.autopilot.now.time_us
        if time_us >= self._next_log_us:
            self._next_log_us = time_us + 1_000_000
            fields = self.stack.report.log_fields(time_us // self.stack.rates.interval_us)
            self.stack.recorder.timing(time_us, **fields)
        now_ns = time.monotonic_ns()
        if now_ns < self._next_ground_ns:
            return
        self._next_ground_ns = now_ns + GROUND_POLL_NS
        if self._follower is not None:
            self._follower.follow()
        self._serve_ground()
        self._pass_requests(simulator)
        self._check_stop()

    def _pass_requests(self, simulator: TcpClient) -> None:
        if requests := self.stack.simulator.take_requests():
            simulator.send(requests)

    # ------------------------------------------------------------------ ground links

    def _serve_ground(self) -> None:
        now_s = time.monotonic()
        if now_s >= self._next_report_s:
            self._next_report_s = now_s + REPORT_S
            self.stack.report.update(self.stack.autopilot.now.time_us, now_s)
            if self._saver is not None and (problem := self._saver.take_error()) is not None:
                self.stack.autopilot.say(3, problem[0].upper() + problem[1:])
        ground, ports = self.stack.ground, self._ports
        for channel, peer, data in ports.receive(self._is_heard):
            ground.receive(PeerAddress(channel, *peer), data, now_s)
        for channel, peer in ports.opened():
            ground.add_peer(PeerAddress(channel, *peer), permanent=True)
        for channel, peer in ports.closed():
            ground.drop_peer(PeerAddress(channel, *peer))
        if self._sending is None:
            self._sending = ground.poll(now_s)
        self._send()

    def _send(self) -> None:
        """Send what is due, as far as the time goes that a tick leaves for it."""
        assert self._sending is not None
        clock_ns, send = time.monotonic_ns, self._ports.send
        end_ns = math.inf if self._slice_ns is None else clock_ns() + self._slice_ns
        for (channel, host, port), data in self._sending:
            send(channel, (host, port), data)
            if clock_ns() >= end_ns:
                break
        else:
            self._sending = None
        self._ports.flush()

    def _is_heard(self, place: Place) -> bool:
        channel, peer = place
        return self.stack.ground.is_heard(PeerAddress(channel, *peer))

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

    def _check_simulator(self, deadline_s: float) -> None:
        if time.monotonic() > deadline_s:
            at = f"t={self.stack.autopilot.now.time_us * 1e-6:.3f} s"
            timeout_s = self._process.simulator_timeout_s
            raise Ended(EXIT_LOST, f"simulator lost at {at}: no state for {timeout_s:g} s")
