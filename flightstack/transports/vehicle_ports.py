"""Ports of the vehicle: UDP for ground stations and companion computers, and TCP; fair reception among peers."""

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
"""Queue limit per peer; holds the largest datagram."""
MIN_COST = 12
"""Minimum cost of a piece of data: the size of the smallest frame."""
MAX_UNKNOWN_PEERS = 64
"""Maximum number of queued peers if they include peers without a valid message."""

Key = TypeVar("Key", bound=Hashable)


class FairQueue(Generic[Key]):
    """Round-robin queue of received data: one piece per peer and turn, so that a flood hardly delays other peers."""

    def __init__(self, max_bytes: int = MAX_QUEUED_BYTES, max_unknown_peers: int = MAX_UNKNOWN_PEERS) -> None:
        self._max_bytes = max_bytes
        self._max_unknown_peers = max_unknown_peers
        self._waiting: dict[Key, deque[bytes]] = {}  # in the order of turns
        self._sizes: dict[Key, int] = {}
        self.dropped = 0
        """Pieces dropped because the queue of the peer, or the number of unknown peers, was at its limit."""

    def __len__(self) -> int:
        return len(self._waiting)

    def __contains__(self, key: Key) -> bool:
        return key in self._waiting

    def push(self, key: Key, data: bytes, is_known: Callable[[Key], bool]) -> bool:
        """Queue ``data`` of ``key``; return False if it is dropped.

        Peers for which ``is_known`` returns True are always queued; others share ``max_unknown_peers`` places.
        """
        cost = max(len(data), MIN_COST)
        pieces = self._waiting.get(key)
        if pieces is None:
            # is_known is costly: it is called only when the places are taken
            if len(self._waiting) >= self._max_unknown_peers and not is_known(key):
                self.dropped += 1
                return False
            pieces = self._waiting[key] = deque()
            self._sizes[key] = 0
        elif self._sizes[key] + cost > self._max_bytes:
            self.dropped += 1
            return False
        pieces.append(data)
        self._sizes[key] += cost
        return True

    def take(self, budget: int) -> Iterator[tuple[Key, bytes]]:
        """Yield (peer, piece) in turns until ``budget`` bytes are exceeded."""
        while self._waiting and budget > 0:
            key = next(iter(self._waiting))
            pieces = self._waiting.pop(key)
            data = pieces.popleft()
            cost = max(len(data), MIN_COST)
            budget -= cost
            if pieces:
                self._waiting[key] = pieces  # to the end of the queue
                self._sizes[key] -= cost
            else:
                del self._sizes[key]
            yield key, data

    def drop(self, key: Key) -> None:
        """Drop the queued data of ``key``."""
        self._waiting.pop(key, None)
        self._sizes.pop(key, None)


LOOPBACK = "127.0.0.1"
BYTES_PER_POLL = 4096
"""Limit per poll for all peers together: at most a millisecond of work, 400 kB/s in real time."""
LARGEST_DATAGRAM = 2048
"""Seven frames of maximum size."""

Place = tuple[str, Address]
"""A channel, and an address on it."""


@dataclass(frozen=True)
class PortsConfig:
    """Listening ports, and the peers that the vehicle sends to first. Hosts are IPv4 addresses."""

    instance: int
    ground_stations: tuple[Address, ...]
    api_client: Address
    listen: str = LOOPBACK
    tcp_port: int = 0
    """0 for no TCP."""


class VehiclePorts:
    """UDP sockets for ground stations and for companion computers, and a TCP server."""

    def __init__(self, config: PortsConfig) -> None:
        """Bind all ports; raise PortBusyError."""
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
        """Peers that the vehicle sends to first."""

    def receive(
        self, heard_s: Callable[[Place], float] = lambda _: -math.inf, budget: int = BYTES_PER_POLL
    ) -> Iterator[tuple[str, Address, bytes]]:
        """Yield received pieces (channel, peer, data) in turns of the peers, up to ``budget`` bytes.

        ``heard_s`` returns the time of the last valid message from a place, −inf without one. Places without valid
        messages share a limited number of turns, and a silent TCP client can be replaced by a new one.
        """
        filenos = [fileno for fileno, _ in self._poller.poll(0)]
        if filenos:
            self._collect(filenos, heard_s)
        for (channel, peer), data in self._queue.take(budget):
            yield channel, peer, data

    def _collect(self, filenos: list[int], heard_s: Callable[[Place], float]) -> None:
        """Move received data into the queue, because a flooding peer shares the UDP socket with others."""

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
        """Return TCP clients connected since the last call; they expect data at once."""
        return [(TCP, peer) for peer in self._tcp.opened()] if self._tcp else []

    def closed(self) -> list[Place]:
        """Return TCP clients disconnected since the last call; call after ``opened``."""
        closed = [(TCP, peer) for peer in self._tcp.closed()] if self._tcp else []
        for place in closed:
            self._queue.drop(place)
        return closed

    def send(self, channel: str, peer: Address, data: bytes) -> None:
        """Send a frame as a UDP datagram, or over TCP with the next ``flush``."""
        if channel in self._sockets:
            self._sockets[channel].send(data, peer)
        elif self._tcp is not None:
            self._tcp.send(peer, data)

    def congested(self) -> list[Place]:
        """Return the TCP clients with congested queues."""
        return [(TCP, peer) for peer in self._tcp.congested()] if self._tcp else []

    def flush(self) -> None:
        """Send queued data to TCP clients."""
        if self._tcp is not None:
            self._tcp.flush()

    def register(self, poller: select.poll) -> None:
        """Register all descriptors with ``poller``."""
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
