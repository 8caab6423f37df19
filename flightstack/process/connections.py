"""The process's end of the ground links: the ports, joined to the hub of the present stack."""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable, Iterator

from flightstack.core.enums import Severity
from flightstack.process.assembly import Stack
from flightstack.process.process_config import EXIT_LOST, EXIT_TIMEOUT, Ended, ProcessConfig, complain
from flightstack.services.routing.hub import GroundHub
from flightstack.services.routing.peer import PeerAddress
from flightstack.transports.tcp import TcpClient
from flightstack.transports.vehicle_ports import Place, PortsConfig, VehiclePorts


class GroundConnection:
    """Carries bytes between ports and hub, on the machine's clock."""

    def __init__(self, ports: PortsConfig, hub: GroundHub) -> None:
        """Bind all ports, and address those who are to hear unasked; raise PortBusyError."""
        self._ports = VehiclePorts(ports)
        self._hub = hub
        self._sending: Iterator[tuple[PeerAddress, bytes]] | None = None
        self.slice_ns: int | None = None
        """Sending takes so long at most, and what is left waits for the next call; None: as long as it takes."""
        for channel, peer in self._ports.first_peers:
            hub.add_peer(PeerAddress(channel, *peer), permanent=True)

    @property
    def is_sending(self) -> bool:
        """Whether something was left for the next call."""
        return self._sending is not None

    def register(self, poller: select.poll) -> None:
        """Let ``poller`` wake when something arrives."""
        self._ports.register(poller)

    def serve(self, now_s: float) -> bool:
        """Take what has arrived, and send what is due; return whether anything has arrived."""
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
        """Send what is due, as far as the slice of time goes; ``serve`` was called before."""
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

    def leave(self, now_s: float) -> None:
        """Send the last answers of a hub that another one will follow."""
        for (channel, host, port), data in self._hub.poll(now_s):
            self._ports.send(channel, (host, port), data)
        self._sending = None

    def join(self, hub: GroundHub) -> None:
        """Serve another hub from now on."""
        self._hub = hub

    def farewell(self) -> None:
        """Send the last words of an orderly end."""
        for (channel, host, port), data in self._hub.farewell():
            self._ports.send(channel, (host, port), data)
        self._ports.flush()

    def close(self) -> None:
        """Close the ports."""
        self._ports.close()

    def _heard_s(self, place: Place) -> float:
        channel, peer = place
        return self._hub.heard_s(PeerAddress(channel, *peer))


SECOND_HELLO_S = 1.0
"""Silence after which a simulator is asked for the standard message."""
SIMULATOR_NOTICE_S = 10.0
"""Silence of a connected simulator after which the user is told; it is waited for longer: it may be compiling."""


def connect(process: ProcessConfig, between_tries: Callable[[], None]) -> TcpClient:
    """Connect to the simulator, and call ``between_tries`` meanwhile; raise Ended if there is none in time."""
    p = process
    try:
        return TcpClient.connect(p.simulator_host, p.simulator_port, p.simulator_timeout_s, between_tries)
    except (TimeoutError, OSError):
        raise Ended(
            EXIT_TIMEOUT,
            f"no simulator at {p.simulator_host}:{p.simulator_port} within {p.simulator_timeout_s:g} s: "
            "start sim-bridge, or name its port with --sim-port",
        ) from None


def wait_for_state(
    simulator: TcpClient, stack: Stack, process: ProcessConfig, meanwhile: Callable[[], None]
) -> None:
    """Wait for the first state, and call ``meanwhile`` between looks; raise Ended when it takes too long."""
    link, interval_us = stack.simulator, stack.rates.interval_us
    began_s = time.monotonic()
    asked_again = told = False
    while True:
        meanwhile()
        data = simulator.receive()
        if data is not None and link.receive(data):
            break
        silent = time.monotonic() - began_s > SECOND_HELLO_S
        if not asked_again and (silent or link.request_refused):
            asked_again = True
            simulator.send(link.fallback_request(interval_us))
        if not told and time.monotonic() - began_s > SIMULATOR_NOTICE_S:
            told = True
            _tell_silent(stack, process)
        check_deadline(began_s + process.simulator_timeout_s, stack, process)
    stack.now.has_state = True


def _tell_silent(stack: Stack, process: ProcessConfig) -> None:
    where = f"{process.simulator_host}:{process.simulator_port}"
    sentence = f"the simulator at {where} is connected but sends no state"
    stack.journal.say(Severity.WARNING, f"Waiting: {sentence}")
    complain(
        f"warning: {sentence} for {SIMULATOR_NOTICE_S:g} s; it hangs, or compiles; waiting up to "
        f"{process.simulator_timeout_s:g} s"
    )


def check_deadline(deadline_s: float, stack: Stack, process: ProcessConfig) -> None:
    """Raise Ended when the simulator has been silent past ``deadline_s`` of the machine's clock."""
    if time.monotonic() > deadline_s:
        at = f"t={stack.now.time_us * 1e-6:.3f} s"
        timeout_s = process.simulator_timeout_s
        raise Ended(EXIT_LOST, f"simulator lost at {at}: no state for {timeout_s:g} s")
