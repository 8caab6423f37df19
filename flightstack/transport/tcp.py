"""A TCP client with little latency: it spins for a moment before it lets the kernel put it to sleep.

Waking up from a blocking ``recv`` costs tens of microseconds here, a spinning one a few. In lockstep the answer
comes within that time, and every step waits for it.
"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable

BUFFER_SIZE = 65536
SPIN_NS = 100_000


class LinkClosedError(Exception):
    """The peer closed the connection."""


class TcpClient:
    """One connection; ``receive`` returns a view of what has come, valid until the next call."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setblocking(False)
        self._socket = connection
        self._buffer = bytearray(BUFFER_SIZE)
        self._view = memoryview(self._buffer)
        self._poll = select.poll()
        self._poll.register(connection, select.POLLIN)

    @classmethod
    def connect(
        cls,
        host: str,
        port: int,
        timeout_s: float,
        between_tries: Callable[[], None],
        now_s: Callable[[], float] = time.monotonic,
    ) -> TcpClient:
        """Connect, trying again while nobody listens; raise TimeoutError after ``timeout_s``."""
        deadline = now_s() + timeout_s
        while True:
            try:
                return cls(socket.create_connection((host, port), timeout=max(0.05, deadline - now_s())))
            except (ConnectionRefusedError, TimeoutError):
                if now_s() >= deadline:
                    raise TimeoutError from None
                between_tries()
                time.sleep(0.02)

    def fileno(self) -> int:
        """Descriptor, for ``poll``."""
        return self._socket.fileno()

    def receive_now(self) -> memoryview | None:
        """Return what is here, or None; raise LinkClosedError."""
        try:
            count = self._socket.recv_into(self._buffer)
        except BlockingIOError:
            return None
        except OSError as error:
            raise LinkClosedError from error
        if count == 0:
            raise LinkClosedError
        return self._view[:count]

    def receive(self, timeout_s: float) -> memoryview | None:
        """Return what comes within ``timeout_s``, or None; raise LinkClosedError."""
        receive_into, buffer = self._socket.recv_into, self._buffer
        spin_until = time.monotonic_ns() + SPIN_NS
        while True:
            try:
                count = receive_into(buffer)
                break
            except BlockingIOError:
                if time.monotonic_ns() < spin_until:
                    continue
            except OSError as error:
                raise LinkClosedError from error
            if not self._poll.poll(max(0.0, timeout_s) * 1e3):
                return None
            spin_until = 0
        if count == 0:
            raise LinkClosedError
        return self._view[:count]

    def send(self, data: bytes | memoryview) -> None:
        """Send all of ``data``; raise LinkClosedError. Frames are small: they fit the socket's buffer."""
        try:
            sent = self._socket.send(data)
            while sent < len(data):  # a peer that stopped reading
                select.select([], [self._socket], [], 5.0)
                sent += self._socket.send(data[sent:])
        except OSError as error:
            raise LinkClosedError from error

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
