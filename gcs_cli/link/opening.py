"""Open the transport of an endpoint, or several at once to find the vehicle on one of them."""

from __future__ import annotations

import contextlib
import re
import socket
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from flightstack.core.port_numbers import INSTANCES, vehicle_ground_port
from flightstack.transports.byte_link import LineError
from flightstack.transports.udp import Address, PortBusyError, UdpSocket, resolve
from gcs_cli.errors import USAGE, CliError, PortInUseError
from gcs_cli.link.endpoint import (
    SERIAL,
    TCP,
    TCP_IN,
    UDP_IN,
    UDP_OUT,
    VEHICLE_CONNECTION,
    VehicleEndpoint,
)
from gcs_cli.link.lines import Interest, Line, StreamLine, TcpInLine, UdpLine

LATER_S = 1.2
"""Time in which a vehicle that sends heartbeats is heard."""
_MOST_PEERS = 256
_MOST_NAMED = 8
_UDP_TABLE = Path("/proc/net/udp")


def open_line(endpoint: VehicleEndpoint) -> Line:
    """Open the transport of ``endpoint``; raise CliError (usage), PortInUseError if a port is in use."""
    try:
        if endpoint.kind == UDP_IN:
            return UdpLine(UdpSocket(endpoint.host, endpoint.port))
        if endpoint.kind == TCP_IN:
            return TcpInLine(endpoint.host, endpoint.port)
        if endpoint.kind == SERIAL:
            from gcs_cli.link.serial_line import SerialLine

            return SerialLine(endpoint.host, endpoint.port)
        peer = (_resolved(endpoint.host), endpoint.port)
        if endpoint.kind == UDP_OUT:
            # bound to the loopback interface, the socket cannot be reached from the network
            return UdpLine(UdpSocket("127.0.0.1" if peer[0].startswith("127.") else "0.0.0.0"), peer)
        if endpoint.kind == TCP:
            return StreamLine(socket.AF_INET, peer, peer)
    except PortBusyError as error:
        sentence = f"{error}: end the other ground station, or use --connect {VEHICLE_CONNECTION}"
        if error.is_in_use:
            raise PortInUseError(endpoint, sentence) from None
        raise CliError(sentence, USAGE) from None
    except LineError as error:
        raise CliError(str(error), USAGE) from None
    raise ValueError(f"no transport for {endpoint}")


def opened_lines(endpoints: Iterable[VehicleEndpoint]) -> dict[VehicleEndpoint, Line]:
    """Open those transports that another program does not use, and that do not fail at once."""
    lines: dict[VehicleEndpoint, Line] = {}
    for endpoint in endpoints:
        with contextlib.suppress(PortInUseError):
            line = open_line(endpoint)
            list(line.receive(0.0))
            if line.problem:
                line.close()
            else:
                lines[endpoint] = line
    return lines


def used_instances() -> list[int]:
    """Return the instances whose port for ground stations is in use on this machine; none if it has no such table."""
    try:
        used = ports_in_use(_UDP_TABLE.read_text(encoding="ascii"))
    except OSError:
        return []
    return [instance for instance in range(INSTANCES) if vehicle_ground_port(instance) in used]


def ports_in_use(table: str) -> set[int]:
    """Return the local ports of Linux's table of UDP sockets, whose second column is ADDRESS:PORT in hexadecimal."""
    return {int(port, 16) for port in re.findall(r"^ *\d+: [0-9A-F]{8}:([0-9A-F]{4}) ", table, re.MULTILINE)}


def instances_text() -> str:
    """Return the advice to use a vehicle on this machine that may run as another instance; empty without one."""
    found = used_instances()
    if not found:
        return ""
    numbers = ", ".join(map(str, found[:_MOST_NAMED])) + (" …" if len(found) > _MOST_NAMED else "")
    if len(found) == 1:
        return f"a vehicle of instance {numbers} seems to run on this machine: give --instance {numbers}"
    return f"vehicles of instances {numbers} seem to run on this machine: choose one with --instance N"


def _resolved(host: str) -> str:
    try:
        return resolve(host)
    except OSError:
        raise CliError(f"--connect: no host named {host}", USAGE) from None


class SeveralLines:
    """Several transports, to find the vehicle on one of them. ``keep`` closes the others.

    ``later`` are opened once nothing has arrived for ``LATER_S``; those that fail at once are closed.
    """

    def __init__(self, lines: Mapping[VehicleEndpoint, Line], later: Iterable[VehicleEndpoint] = ()) -> None:
        self._lines = dict(lines)
        self._later = list(later)
        self._later_s = time.monotonic() + LATER_S
        self._by_peer: dict[Address, Line] = {}

    @property
    def peers(self) -> Sequence[Address]:
        """Addresses to send to before a vehicle is heard."""
        return [peer for line in self._lines.values() for peer in line.peers]

    @property
    def problem(self) -> str:
        """The first reason that no data can be exchanged, if it concerns all lines."""
        problems = [line.problem for line in self._lines.values()]
        return problems[0] if problems and all(problems) else ""

    def keep(self, peer: Address) -> VehicleEndpoint | None:
        """Close all transports but that of ``peer``, and return its endpoint; None if it is not known."""
        kept = self._by_peer.get(peer)
        self._later = []
        for endpoint, line in list(self._lines.items()):
            if kept is not None and line is not kept:
                line.close()
                del self._lines[endpoint]
        return next((endpoint for endpoint, line in self._lines.items() if line is kept), None)

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""
        return [interest for line in self._lines.values() for interest in line.interests()]

    def due_s(self) -> float | None:
        """Return the earliest time of all."""
        due_s = [due_s for line in self._lines.values() if (due_s := line.due_s()) is not None]
        return min([*due_s, *([self._later_s] if self._later else [])], default=None)

    def receive(self, now_s: float) -> Iterator[tuple[bytes, Address]]:
        """Yield the data that has arrived on any of them."""
        if self._later and now_s >= self._later_s:
            self._lines |= opened_lines(self._later)
            self._later = []
        for line in self._lines.values():
            for data, peer in line.receive(now_s):
                if len(self._by_peer) > _MOST_PEERS:
                    self._by_peer.clear()
                self._by_peer[peer] = line
                yield data, peer

    def send(self, data: bytes, peer: Address) -> None:
        """Send a frame on the transport of ``peer``."""
        line = self._by_peer.get(peer)
        for each in [line] if line is not None else self._lines.values():
            if line is not None or peer in each.peers:
                each.send(data, peer)

    def closed_peers(self) -> Iterable[Address]:
        """Return the peers whose connections were closed."""
        return [peer for line in self._lines.values() for peer in line.closed_peers()]

    def close(self) -> None:
        """Close all."""
        for line in self._lines.values():
            line.close()
