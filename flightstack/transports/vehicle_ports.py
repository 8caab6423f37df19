"""The vehicle's ports, numbered as PX4's and ArduPilot's: UDP for ground stations and for companions, and TCP."""

from __future__ import annotations

import math
import select
from collections import deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from flightstack.core.port_numbers import API, GROUND, TCP, vehicle_api_port, vehicle_ground_port
from flightstack.transports.tcp_server import TcpServer
from flightstack.transports.udp import Address, PortBusyError, UdpSocket

MAX_QUEUED_BYTES = 65536
"""What one peer may have waiting; the largest datagram still fits."""
MIN_COST = 12
"""What a piece counts at least, were it empty: the size of the smallest frame."""
MAX_UNKNOWN_PEERS = 64
"""How many peers that nobody has heard a valid message from may wait at once."""

Key = TypeVar("Key", bound=Hashable)


class FairQueue(Generic[Key]):
    """Data of many peers: each peer's in order, the peers in turns, one piece a turn."""

    def __init__(
        self, max_octets: int = MAX_QUEUED_BYTES, max_unknown_peers: int = MAX_UNKNOWN_PEERS
    ) -> None:
        self._max_octets = max_octets
        self._max_unknown_peers = max_unknown_peers
        self._waiting: dict[Key, deque[bytes]] = {}  # in the order of turns
        self._octets: dict[Key, int] = {}
        self.dropped = 0
        """Pieces refused because their peer, or all unknown peers together, had too much waiting."""

    def __len__(self) -> int:
        return len(self._waiting)

    def __contains__(self, key: Key) -> bool:
        return key in self._waiting

    def push(self, key: Key, data: bytes, is_known: Callable[[Key], bool]) -> bool:
        """Let ``data`` of ``key`` wait for its turn; return False when it is dropped.

        ``is_known`` tells who may always join: strangers share a limited number of places.
        """
        cost = max(len(data), MIN_COST)
        pieces = self._waiting.get(key)
        if pieces is None:
            # counting all as strangers is cheap; who is known is asked only when it matters
            if len(self._waiting) >= self._max_unknown_peers and not is_known(key):
                self.dropped += 1
                return False
            pieces = self._waiting[key] = deque()
            self._octets[key] = 0
        elif self._octets[key] + cost > self._max_octets:
            self.dropped += 1
            return False
        pieces.append(data)
        self._octets[key] += cost
        return True

    def take(self, octets: int) -> Iterator[tuple[Key, bytes]]:
        """Yield pieces, with their peers, in turns: ``octets`` of them, and what the last piece has beyond."""
        while self._waiting and octets > 0:
            key = next(iter(self._waiting))
            pieces = self._waiting.pop(key)
            data = pieces.popleft()
            cost = max(len(data), MIN_COST)
            octets -= cost
            if pieces:
                self._waiting[key] = pieces  # to the end of the line
                self._octets[key] -= cost
            else:
                del self._octets[key]
            yield key, data

    def forget(self, key: Key) -> None:
        """Drop what ``key`` has waiting."""
        self._waiting.pop(key, None)
        self._octets.pop(key, None)


LOOPBACK = "127.0.0.1"
OCTETS_A_POLL = 4096
"""Handed out in one poll, all peers together: a millisecond of work at worst, 400 kB/s in real time."""
LARGEST_DATAGRAM = 2048
"""Seven frames of the largest kind; nobody sends more at once."""

Place = tuple[str, Address]
"""A channel, and an address on it."""


@dataclass(frozen=True)
class PortsConfig:
    """Where the vehicle listens and whom it addresses unasked. Hosts are IPv4 addresses."""

    instance: int
    ground_stations: tuple[Address, ...]
    api_client: Address
    listen: str = LOOPBACK
    tcp_port: int = 0
    """0: no TCP."""


class VehiclePorts:
    """Two UDP sockets, for ground stations and for companions, and a TCP server."""

    def __init__(self, config: PortsConfig) -> None:
        """Bind all; raise PortBusyError."""
        self._poller = select.poll()
        self._sockets: dict[str, UdpSocket] = {}
        self._tcp: TcpServer | None = None
        self._queue: FairQueue[Place] = FairQueue()
        try:
            for channel, port in ((GROUND, vehicle_ground_port), (API, vehicle_api_port)):
                self._sockets[channel] = UdpSocket(config.listen, port(config.instance), LARGEST_DATAGRAM)
                self._poller.register(self._sockets[channel], select.POLLIN)
            if config.tcp_port:
                self._tcp = TcpServer(config.listen, config.tcp_port, self._poller)
        except PortBusyError:
            self.close()
            raise
        self.first_peers: list[Place] = [(GROUND, station) for station in config.ground_stations]
        self.first_peers.append((API, config.api_client))
        """Those whom the vehicle addresses unasked."""

    def receive(
        self, heard_s: Callable[[Place], float] = lambda _: -math.inf, octets: int = OCTETS_A_POLL
    ) -> Iterator[tuple[str, Address, bytes]]:
        """Yield pieces (channel, peer, data) of what is here, ``octets`` in all, peer by peer in turns.

        ``heard_s`` tells when the last valid message came from a place (−inf: none did). Places that were never
        heard share a limited number of turns, and a TCP client that is silent gives way to a new one.
        """
        filenos = [fileno for fileno, _ in self._poller.poll(0)]
        if filenos:
            self._collect(filenos, heard_s)
        for (channel, peer), data in self._queue.take(octets):
            yield channel, peer, data

    def _collect(self, filenos: list[int], heard_s: Callable[[Place], float]) -> None:
        """Move what is here into the queue: a UDP socket is shared by peers, and so by those who flood it."""

        def is_known(place: Place) -> bool:
            return heard_s(place) > -math.inf

        for channel, udp in self._sockets.items():
            if udp.fileno() in filenos:
                for data, peer in udp.receive():
                    self._queue.push((channel, peer), data, is_known)
        if self._tcp is not None:
            for peer, data in self._tcp.receive(
                filenos, lambda peer: heard_s((TCP, peer)), lambda peer: (TCP, peer) not in self._queue
            ):
                self._queue.push((TCP, peer), data, lambda _: True)

    def opened(self) -> list[Place]:
        """Return who has connected since the last call: such a peer expects to be addressed at once."""
        return [(TCP, peer) for peer in self._tcp.opened()] if self._tcp else []

    def closed(self) -> list[Place]:
        """Return whose connection has ended since the last call; ask after ``opened``."""
        closed = [(TCP, peer) for peer in self._tcp.closed()] if self._tcp else []
        for place in closed:
            self._queue.forget(place)
        return closed

    def send(self, channel: str, peer: Address, data: bytes) -> None:
        """Send a frame: one datagram over UDP; over TCP, with the next ``flush``."""
        if channel in self._sockets:
            self._sockets[channel].send(data, peer)
        elif self._tcp is not None:
            self._tcp.send(peer, data)

    def congested(self) -> list[Place]:
        """Return the peers whose connection takes less than they are sent; over UDP that is not known."""
        return [(TCP, peer) for peer in self._tcp.congested()] if self._tcp else []

    def flush(self) -> None:
        """Send what waits for TCP clients."""
        if self._tcp is not None:
            self._tcp.flush()

    def register(self, poller: select.poll) -> None:
        """Let ``poller`` wake up when something is here."""
        for socket in self._sockets.values():
            poller.register(socket, select.POLLIN)
        if self._tcp is not None:
            self._tcp.register(poller)

    def close(self) -> None:
        """Close the sockets."""
        for socket in self._sockets.values():
            socket.close()
        if self._tcp is not None:
            self._tcp.close()
