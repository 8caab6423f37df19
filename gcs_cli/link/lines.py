"""Transports of a connection: UDP, TCP client and server."""

from __future__ import annotations

import errno
import math
import os
import select
import socket
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

from flightstack.transports.tcp_server import TcpServer
from flightstack.transports.udp import Address, UdpSocket

RETRY_S = 0.25
"""Time between two attempts to connect or to reopen a device."""
_BUFFER = 65536
_MOST_UNSENT = 65536
"""Bytes that are queued for a stream; further frames are dropped, as telemetry links do."""

Interest = tuple[int, int]
"""A file descriptor and the events of ``select.poll`` to wait for."""


class Line(Protocol):
    """A transport without blocking calls. Peers are addresses: a host and port, or a device and its baud rate."""

    @property
    def peers(self) -> Sequence[Address]:
        """Addresses to send to before a vehicle is heard."""

    @property
    def problem(self) -> str:
        """Reason that no data can be exchanged now; empty if there is none."""

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""

    def due_s(self) -> float | None:
        """Return the time at which to call ``receive`` even if no descriptor is ready; None: never."""

    def receive(self, now_s: float) -> Iterable[tuple[bytes, Address]]:
        """Return the data that has arrived, each piece with its peer."""

    def send(self, data: bytes, peer: Address) -> None:
        """Send one frame; drop it if it cannot be sent."""

    def closed_peers(self) -> Iterable[Address]:
        """Return the peers whose connections were closed since the last call."""

    def close(self) -> None:
        """Close the transport; a second call does nothing."""


class UdpLine:
    """A UDP socket. ``remote``: the address of the vehicle, which we send to first."""

    def __init__(self, udp: UdpSocket, remote: Address | None = None) -> None:
        self._socket = udp
        self.peers: Sequence[Address] = () if remote is None else (remote,)
        self.problem = ""

    @property
    def local_port(self) -> int:
        """The local port."""
        return self._socket.address[1]

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""
        return [(self._socket.fileno(), select.POLLIN)]

    def due_s(self) -> float | None:
        """Return None: only the socket has data."""
        return None

    def receive(self, now_s: float) -> Iterable[tuple[bytes, Address]]:
        """Yield the datagrams that have arrived."""
        return self._socket.receive()

    def send(self, data: bytes, peer: Address) -> None:
        """Send a datagram."""
        self._socket.send(data, peer)

    def closed_peers(self) -> Iterable[Address]:
        """Return nothing: UDP has no connections."""
        return ()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class StreamLine:
    """A client of a stream socket that connects, and connects again after the connection is lost.

    A connection that was ``connected`` elsewhere has no ``address``, and is not opened again.
    """

    def __init__(
        self, family: int, address: object, peer: Address, connected: socket.socket | None = None
    ) -> None:
        self._family = family
        self._address = address
        self._peer = peer
        self.peers: Sequence[Address] = (peer,)
        self.problem = ""
        self._socket = connected
        self._is_connected = connected is not None
        self._retry_s = math.inf if address is None else 0.0
        self._unsent = bytearray()
        if connected is None:
            self._connect(time.monotonic())

    @property
    def is_connected(self) -> bool:
        """True while the connection stands."""
        return self._is_connected

    def _connect(self, now_s: float) -> None:
        self._retry_s = now_s + RETRY_S
        self._socket = socket.socket(self._family, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        if self._family == socket.AF_INET:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        code = self._socket.connect_ex(self._address)  # type: ignore[arg-type]
        if code == 0:
            self._is_connected = True
        elif code != errno.EINPROGRESS:
            self._lose(code)

    def _lose(self, code: int) -> None:
        self.problem = os.strerror(code).lower() if code else "the connection was closed"
        if self._socket is not None:
            self._socket.close()
        self._socket, self._is_connected = None, False
        self._unsent.clear()

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""
        if self._socket is None:
            return []
        waits_to_write = not self._is_connected or self._unsent
        events = (select.POLLIN if self._is_connected else 0) | (select.POLLOUT if waits_to_write else 0)
        return [(self._socket.fileno(), events)]

    def due_s(self) -> float | None:
        """Return the time of the next attempt to connect."""
        return self._retry_s if self._socket is None else None

    def receive(self, now_s: float) -> Iterable[tuple[bytes, Address]]:
        """Yield the bytes that have arrived; connect if it is time to."""
        if self._socket is None and now_s >= self._retry_s:
            self._connect(now_s)
        if self._socket is not None and not self._is_connected:
            self._finish_connecting(self._socket)
        self._flush()
        while self._socket is not None and self._is_connected:
            try:
                data = self._socket.recv(_BUFFER)
            except BlockingIOError:
                return
            except OSError as error:
                self._lose(error.errno or 0)
                return
            if not data:
                self._lose(0)
                return
            self.problem = ""
            yield data, self._peer

    def _finish_connecting(self, connecting: socket.socket) -> None:
        poll = select.poll()
        poll.register(connecting, select.POLLOUT)
        if not poll.poll(0):
            return
        code = connecting.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            self._lose(code)
        else:
            self._is_connected = True

    def send(self, data: bytes, peer: Address) -> None:
        """Queue and send a frame; drop it while there is no connection, or if too much is queued."""
        if peer == self._peer and self._is_connected and len(self._unsent) + len(data) <= _MOST_UNSENT:
            self._unsent += data
            self._flush()

    def _flush(self) -> None:
        if self._socket is None or not self._is_connected or not self._unsent:
            return
        try:
            del self._unsent[: self._socket.send(self._unsent)]
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(error.errno or 0)

    def closed_peers(self) -> Iterable[Address]:
        """Return nothing: the same vehicle is expected after a reconnection."""
        return ()

    def close(self) -> None:
        """Send the queued frames as far as the system takes them, and close the socket."""
        self._flush()
        if self._socket is not None:
            self._socket.close()
        self._socket, self._is_connected = None, False


class _Descriptors:
    """Collects the descriptors that ``TcpServer`` registers."""

    def __init__(self) -> None:
        self.known: set[int] = set()

    def register(self, descriptor: int | socket.socket, _events: int = 0) -> None:
        self.known.add(descriptor if isinstance(descriptor, int) else descriptor.fileno())

    def unregister(self, descriptor: int) -> None:
        self.known.discard(descriptor)


class TcpInLine:
    """A TCP server that vehicles connect to."""

    def __init__(self, host: str, port: int) -> None:
        self._descriptors = _Descriptors()
        self._server = TcpServer(host, port, self._descriptors)  # type: ignore[arg-type]
        self.peers: Sequence[Address] = ()
        self.problem = ""

    @property
    def local_port(self) -> int:
        """The local port."""
        return self._server.address[1]

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""
        self._server.flush()
        return [(descriptor, select.POLLIN) for descriptor in self._descriptors.known]

    def due_s(self) -> float | None:
        """Return None: only the sockets have data."""
        return None

    def receive(self, now_s: float) -> Iterator[tuple[bytes, Address]]:
        """Yield the bytes that have arrived; accept connections."""
        found = True
        while found:
            found = False
            for address, data in self._server.receive(list(self._descriptors.known)):
                found = True
                yield data, address

    def send(self, data: bytes, peer: Address) -> None:
        """Queue and send a frame."""
        self._server.send(peer, data)
        self._server.flush()

    def closed_peers(self) -> Iterable[Address]:
        """Return the vehicles that have disconnected."""
        self._server.opened()
        return self._server.closed()

    def close(self) -> None:
        """Close all connections and the port."""
        self._server.close()
