"""Non-blocking TCP server for several MAVLink clients.

Up to ``MAX_UNSENT`` bytes are queued per client; beyond, complete frames are dropped. A client that reads nothing for
``STALLED_S`` is disconnected. If ``MAX_CLIENTS`` are connected, a new client replaces one that sent no valid MAVLink
for ``SILENT_AFTER_S``. The kernel buffer is small because old telemetry is useless.
"""

from __future__ import annotations

import contextlib
import errno
import math
import select
import socket
import struct
import time
from collections.abc import Callable, Iterator

from flightstack.mavlink.link import SILENT_AFTER_S
from flightstack.transports.udp import Address, PortBusyError

MAX_CLIENTS = 64
MAX_UNSENT = 65536
STALLED_S = 10.0
CONGESTED = 16384
"""Queued bytes above which a client gets no deferrable data, such as file contents."""
_KERNEL_BUFFER = 65536
_PIECE = 1024
_BACKLOG = 16
_ACCEPTED_AT_ONCE = 16
_CLOSE_AT_ONCE = struct.pack("@ii", 1, 0)  # SO_LINGER: drop unsent data and reset the connection


class _Client:
    """One connection with its unsent bytes."""

    def __init__(self, connection: socket.socket, now_s: float) -> None:
        connection.setblocking(False)
        for level, option, value in (
            (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),
            (socket.SOL_SOCKET, socket.SO_SNDBUF, _KERNEL_BUFFER),
            (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
        ):
            with contextlib.suppress(OSError):  # it may be closed already
                connection.setsockopt(level, option, value)
        self.socket = connection
        self.unsent = bytearray()
        self.moved_s = now_s
        """Time at which the kernel last accepted data or nothing was queued."""


class TcpServer:
    """Listens on one port and serves up to ``MAX_CLIENTS`` connections."""

    def __init__(
        self, host: str, port: int, poller: select.poll, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        """Listen; raise PortBusyError. All descriptors to read from are registered with ``poller``."""
        self._listener = _listening((host, port))
        self._now_s = now_s
        self._pollers = [poller]
        self._clients: dict[Address, _Client] = {}
        self._by_fileno: dict[int, Address] = {}
        self._opened: list[Address] = []
        self._closed: list[Address] = []
        self.dropped = 0
        """Frames dropped because a client's queue was full."""
        poller.register(self._listener, select.POLLIN)

    @property
    def address(self) -> Address:
        """The local address with the actual port."""
        host, port = self._listener.getsockname()[:2]
        return str(host), int(port)

    def addresses(self) -> list[Address]:
        """Return the addresses of the connected clients."""
        return list(self._clients)

    def unsent(self, address: Address) -> int:
        """Return the number of bytes queued for a client, at most MAX_UNSENT."""
        return len(self._clients[address].unsent)

    def __len__(self) -> int:
        return len(self._clients)

    def register(self, poller: select.poll) -> None:
        """Register all descriptors with another poller too."""
        self._pollers.append(poller)
        for fileno in (self._listener.fileno(), *self._by_fileno):
            poller.register(fileno, select.POLLIN)

    def opened(self) -> list[Address]:
        """Return clients connected since the last call; some may be closed again."""
        opened, self._opened = self._opened, []
        return opened

    def closed(self) -> list[Address]:
        """Return clients disconnected since the last call."""
        closed, self._closed = self._closed, []
        return closed

    # ------------------------------------------------------------------ receiving

    def receive(
        self,
        filenos: list[int],
        heard_s: Callable[[Address], float] = lambda _: -math.inf,
        wants: Callable[[Address], bool] = lambda _: True,
    ) -> Iterator[tuple[Address, bytes]]:
        """Accept clients, and yield a piece of data of each in ``filenos`` for which ``wants`` returns True.

        ``heard_s`` returns the time of a client's last valid message, −inf without one. Unread data stays in the kernel
        and blocks its sender.
        """
        for fileno in filenos:
            address = self._by_fileno.get(fileno)
            if address is not None and wants(address):
                data = self._read(address)
                if data:
                    yield address, data
        if self._listener.fileno() in filenos:
            self._accept(heard_s)

    def _read(self, address: Address) -> bytes | None:
        client = self._clients[address]
        try:
            data = client.socket.recv(_PIECE)
        except BlockingIOError:
            return None
        except OSError:  # reset, timed out
            data = b""
        if not data:
            self._drop(address)
            return None
        return data

    def _accept(self, heard_s: Callable[[Address], float]) -> None:
        for _ in range(_ACCEPTED_AT_ONCE):
            try:
                connection, peer = self._listener.accept()
            except OSError:  # no connection, connection reset, or no descriptor left
                return
            if len(self._clients) >= MAX_CLIENTS and not self._make_room(heard_s):
                connection.close()
                continue
            address = (str(peer[0]), int(peer[1]))
            self._clients[address] = _Client(connection, self._now_s())
            self._by_fileno[connection.fileno()] = address
            for poller in self._pollers:
                poller.register(connection, select.POLLIN)
            self._opened.append(address)

    def _make_room(self, heard_s: Callable[[Address], float]) -> bool:
        """Close the client that is silent for longest; return False if none is silent."""
        longest_silent = min(self._clients, key=heard_s)
        if self._now_s() - heard_s(longest_silent) <= SILENT_AFTER_S:
            return False
        self._drop(longest_silent)
        return True

    # ------------------------------------------------------------------ sending

    def send(self, peer: Address, frame: bytes) -> bool:
        """Queue a complete frame for ``peer``, sent by ``flush``; return False if it is dropped."""
        client = self._clients.get(peer)
        if client is None:
            return False
        if len(client.unsent) + len(frame) > MAX_UNSENT:
            self.dropped += 1
            return False
        client.unsent += frame
        return True

    def congested(self) -> list[Address]:
        """Return the clients with congested queues."""
        return [address for address, client in self._clients.items() if len(client.unsent) > CONGESTED]

    def flush(self) -> None:
        """Send as much as the clients accept, and close stalled ones."""
        now_s = self._now_s()
        for address, client in list(self._clients.items()):
            if not client.unsent:
                client.moved_s = now_s
                continue
            try:
                sent = client.socket.send(client.unsent)
            except BlockingIOError:
                if now_s - client.moved_s > STALLED_S:
                    self._drop(address)
            except OSError:
                self._drop(address)
            else:
                client.moved_s = now_s
                del client.unsent[:sent]

    # ------------------------------------------------------------------ ends

    def _drop(self, address: Address) -> None:
        client = self._clients.pop(address)
        fileno = client.socket.fileno()
        del self._by_fileno[fileno]
        for poller in self._pollers:
            with contextlib.suppress(KeyError):
                poller.unregister(fileno)
        if client.unsent:
            with contextlib.suppress(OSError):
                client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _CLOSE_AT_ONCE)
        client.socket.close()
        self._closed.append(address)

    def close(self) -> None:
        """Flush, and close all connections and the port."""
        self.flush()
        for address in list(self._clients):
            self._drop(address)
        self._listener.close()


def _listening(address: Address) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        made.setblocking(False)
        made.setsockopt(
            socket.SOL_SOCKET, socket.SO_REUSEADDR, 1
        )  # connections of an earlier process may linger
        made.bind(address)
        made.listen(_BACKLOG)
    except (OSError, OverflowError) as error:
        made.close()
        busy = getattr(error, "errno", None) == errno.EADDRINUSE
        reason = "is in use" if busy else f"cannot be used: {getattr(error, 'strerror', None) or error}"
        raise PortBusyError("TCP", address, reason) from None
    return made
