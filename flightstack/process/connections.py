"""Connections of the process: to ground stations and to the simulator."""

from __future__ import annotations

import contextlib
import math
import select
import time
from collections.abc import Callable, Iterator

from flightstack.core.enums import Severity
from flightstack.core.errors import TargetError
from flightstack.process.assembly import Stack
from flightstack.process.process_config import (
    EXIT_LOST,
    EXIT_OK,
    EXIT_TIMEOUT,
    Ended,
    ProcessConfig,
    complain,
)
from flightstack.services.routing.hub import GroundHub
from flightstack.services.routing.peer import PeerAddress
from flightstack.transports.tcp import TcpClient
from flightstack.transports.vehicle_ports import Place, PortsConfig, VehiclePorts

FALLBACK_REQUEST_S = 1.0
"""Timeout before the standard message is requested from the simulator."""
IDLE_MS = 20
"""Longest wait for data of the ground links between two states of the simulator."""
TRANSFER_MS = 1
"""The same while files are sent."""
PAUSE_NS = 500_000
"""Wait for a state above which the simulator counts as waiting; at full speed it is a twentieth of it."""
PACED_SHARE = 0.2
"""Share of its pauses in the time of a simulator that waits for a clock; at full speed long steps are a twentieth."""
FEW_NS, MOST_NS = 1_500_000, 10_000_000
"""Pauses above that share, in sum, from which the next one is expected, and the most that are counted: for 43 ms after
the last pause, which is several periods of a simulator that sends in bursts."""
SIMULATOR_WARNING_S = 10.0
"""Timeout before the user is warned; waiting continues, because the simulator may be compiling."""


class GroundConnection:
    """Connects the ports to the hub of the current stack."""

    def __init__(self, ports: PortsConfig, hub: GroundHub) -> None:
        """Bind all ports and add the configured peers; raise PortBusyError."""
        self._ports = VehiclePorts(ports)
        self._hub = hub
        self._sending: Iterator[tuple[PeerAddress, bytes]] | None = None
        self.slice_ns: int | None = None
        """Time limit of ``send``; the rest is sent in the next call. None for no limit."""
        for channel, peer in self._ports.first_peers:
            hub.add_peer(PeerAddress(channel, *peer), permanent=True)

    @property
    def is_sending(self) -> bool:
        """True if data is left for the next call."""
        return self._sending is not None

    def register(self, poller: select.poll) -> None:
        """Register the ports with ``poller``."""
        self._ports.register(poller)

    def serve(self, now_s: float) -> bool:
        """Process received data and send due messages; return True if data was received."""
        hub, ports, heard = self._hub, self._ports, False
        for channel, peer, data in ports.receive(self._heard_s):
            heard = True
            hub.receive(PeerAddress(channel, *peer), data, now_s)
        for channel, peer in ports.opened():
            hub.add_peer(PeerAddress(channel, *peer), permanent=True)
        for channel, peer in ports.closed():
            hub.drop_peer(PeerAddress(channel, *peer))
        if self._sending is None:
            congested = {PeerAddress(channel, *peer) for channel, peer in ports.congested()}
            self._sending = hub.poll(now_s, congested)
        self.send()
        return heard

    def send(self) -> None:
        """Send due messages within ``slice_ns``; call ``serve`` first."""
        assert self._sending is not None
        clock_ns, send = time.monotonic_ns, self._ports.send
        end_ns = math.inf if self.slice_ns is None else clock_ns() + self.slice_ns
        for (channel, host, port), data in self._sending:
            send(channel, (host, port), data)
            if clock_ns() >= end_ns:
                break
        else:
            self._sending = None
        self._ports.flush()

    def detach(self, now_s: float) -> None:
        """Send the last messages of a hub before it is replaced."""
        for (channel, host, port), data in self._hub.poll(now_s):
            self._ports.send(channel, (host, port), data)
        self._sending = None

    def attach(self, hub: GroundHub) -> None:
        """Replace the hub."""
        self._hub = hub

    def announce_shutdown(self) -> None:
        """Send the final messages of the process."""
        with contextlib.suppress(TargetError):  # the status of a lost target may be unknown
            for (channel, host, port), data in self._hub.farewell():
                self._ports.send(channel, (host, port), data)
        self._ports.flush()

    def close(self) -> None:
        """Close the ports."""
        self._ports.close()

    def _heard_s(self, place: Place) -> float:
        channel, peer = place
        return self._hub.heard_s(PeerAddress(channel, *peer))


class SimulatorPace:
    """Recognises the pauses of a simulator that waits after each state or after a burst of states."""

    def __init__(self) -> None:
        self._began_ns = self._waits_ns = self._noted_ns = 0
        self._paused_ns = 0  # sum of the pauses above their share at ``_noted_ns``

    def note_tick(self, began_ns: int) -> None:
        """Note the time of the machine's clock at which a tick begins, after a wait."""
        self._began_ns = began_ns
        if self._waits_ns:
            self.note_wait(began_ns, began_ns - self._waits_ns)
            self._waits_ns = 0

    def note_wait(self, ended_ns: int, waited_ns: int) -> None:
        """Note the end of a wait for a state, or of several, whose pauses took ``waited_ns`` in sum."""
        if waited_ns > PAUSE_NS:
            self._paused_ns = min(MOST_NS, self._left_ns(ended_ns) + waited_ns)
            self._noted_ns = ended_ns

    def begin_wait(self, now_ns: int) -> None:
        """Note that a wait for a state begins: what was done since the last one was not the simulator's."""
        self._waits_ns = now_ns

    def _left_ns(self, now_ns: int) -> int:
        return max(0, self._paused_ns - round((now_ns - self._noted_ns) * PACED_SHARE))

    def may_pause(self) -> bool:
        """Return True if the next pause is expected."""
        return self._left_ns(self._began_ns) > FEW_NS

    def pauses(self, simulator: TcpClient) -> bool:
        """Return True if the simulator sends nothing until ``PAUSE_NS`` after the start of this tick.

        Waits for that only if a pause may come: within a burst the next state comes first. A tick that took longer
        itself, for example on a serial target, has no wait.
        """
        if not self.may_pause():
            return False
        left_ns = max(0, self._began_ns + PAUSE_NS - time.monotonic_ns())
        # unlike poll, in microseconds; the descriptor is one of the first, below the limit of select
        return not select.select([simulator.fileno()], [], [], left_ns * 1e-9)[0]


def connect_simulator(process: ProcessConfig, between_tries: Callable[[], None]) -> TcpClient:
    """Connect to the simulator, calling ``between_tries`` while waiting; raise Ended after the timeout."""
    p = process
    try:
        return TcpClient.connect(p.simulator_host, p.simulator_port, p.simulator_timeout_s, between_tries)
    except (TimeoutError, OSError):
        raise Ended(
            EXIT_TIMEOUT,
            f"no simulator at {p.simulator_host}:{p.simulator_port} within {p.simulator_timeout_s:g} s: "
            "start sim-bridge, or give its port with --sim-port",
        ) from None


def wait_for_state(
    simulator: TcpClient, stack: Stack, process: ProcessConfig, while_waiting: Callable[[], None]
) -> None:
    """Wait for the first state, calling ``while_waiting`` repeatedly; raise Ended after the timeout."""
    link, interval_us = stack.simulator, stack.rates.interval_us
    began_s = time.monotonic()
    is_fallback_requested = has_warned = False
    while True:
        while_waiting()
        data = simulator.receive()
        if data is not None and link.receive(data):
            break
        silent = time.monotonic() - began_s > FALLBACK_REQUEST_S
        if not is_fallback_requested and (silent or link.request_refused):
            is_fallback_requested = True
            simulator.send(link.fallback_request(interval_us))
        if not has_warned and time.monotonic() - began_s > SIMULATOR_WARNING_S:
            has_warned = True
            _warn_of_silence(stack, process)
        check_deadline(began_s + process.simulator_timeout_s, stack, process)
    stack.now.has_state = stack.estimation is None


def serve_while_idle(
    simulator: TcpClient, poller: select.poll, stack: Stack, process: ProcessConfig, serve: Callable[[], None]
) -> None:
    """Call ``serve`` as ground data arrives, and while files are sent, until the simulator sends.

    ``poller`` has the simulator and the ground links. Raise Ended after the timeout of the simulator.
    """
    number = simulator.fileno()
    deadline_s = time.monotonic() + process.simulator_timeout_s
    while True:
        sends_files = stack.ground.sends_files
        ready = poller.poll(TRANSFER_MS if sends_files else IDLE_MS)
        if any(descriptor == number for descriptor, _ in ready) or not (ready or sends_files):
            return
        serve()
        check_deadline(deadline_s, stack, process)


def _warn_of_silence(stack: Stack, process: ProcessConfig) -> None:
    where = f"{process.simulator_host}:{process.simulator_port}"
    sentence = f"the simulator at {where} is connected but sends no state"
    stack.journal.say(Severity.WARNING, f"Waiting: {sentence}")
    complain(
        f"warning: {sentence} for {SIMULATOR_WARNING_S:g} s; it may be compiling; waiting up to "
        f"{process.simulator_timeout_s:g} s"
    )


def simulator_end(stack: Stack) -> Ended:
    """Return the end of the process after the simulator has closed the connection.

    A flight that its shutdown cut off has failed.
    """
    at = f"at t={stack.now.time_us * 1e-6:.3f} s"
    if not stack.simulator.peer_is_shutting_down:
        return Ended(EXIT_LOST, f"simulator lost {at}: it closed the connection")
    if stack.now.status.armed:
        return Ended(EXIT_LOST, f"the simulator was shut down {at} while the vehicle was armed")
    return Ended(EXIT_OK, f"the simulator was shut down {at}")


def check_deadline(deadline_s: float, stack: Stack, process: ProcessConfig) -> None:
    """Raise Ended if the simulator was silent until ``deadline_s`` of the machine's clock."""
    if time.monotonic() > deadline_s:
        at = f"t={stack.now.time_us * 1e-6:.3f} s"
        timeout_s = process.simulator_timeout_s
        raise Ended(EXIT_LOST, f"simulator lost at {at}: no state for {timeout_s:g} s")
