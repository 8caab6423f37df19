"""A TCP client that waits within ``recv``: one system call per reception."""

from __future__ import annotations

import select
import socket
import struct
import time
from collections.abc import Callable

BUFFER_SIZE = 65536
RECEIVE_TIMEOUT_S = 0.02
"""Timeout of ``receive``."""


def wait_in_kernel(connection: socket.socket) -> None:
    """Make ``recv`` block for ``RECEIVE_TIMEOUT_S`` and then raise BlockingIOError.

    Python's own timeouts call ``poll`` before each ``recv``.
    """
    connection.setblocking(True)
    timeout = struct.pack("@ll", 0, round(RECEIVE_TIMEOUT_S * 1e6))
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, timeout)


class LinkClosedError(Exception):
    """The peer closed the connection."""


class TcpClient:
    """One connection; ``receive`` returns a view of the received bytes, valid until the next call."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        wait_in_kernel(connection)
        self.socket = connection
        self._receive_into = connection.recv_into
        self._send = connection.send
        self._buffer = bytearray(BUFFER_SIZE)
        self._view = memoryview(self._buffer)

    @classmethod
    def connect(
        cls,
        host: str,
        port: int,
        timeout_s: float,
        between_tries: Callable[[], None],
        now_s: Callable[[], float] = time.monotonic,
    ) -> TcpClient:
        """Connect, retrying while the port is closed; raise TimeoutError after ``timeout_s``."""
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
        """Return the file descriptor, for ``poll``."""
        return self.socket.fileno()

    def receive_now(self) -> memoryview | None:
        """Return available bytes without waiting, or None; raise LinkClosedError."""
        return self.receive(socket.MSG_DONTWAIT)

    def receive(self, flags: int = 0) -> memoryview | None:
        """Return bytes received within ``RECEIVE_TIMEOUT_S``, or None; raise LinkClosedError."""
        try:
            count = self._receive_into(self._buffer, 0, flags)
        except BlockingIOError:
            return None
        except OSError as error:
            raise LinkClosedError from error
        if count == 0:
            raise LinkClosedError
        return self._view[:count]

    def send(self, data: bytes | memoryview) -> None:
        """Send all of ``data``; raise LinkClosedError. Frames usually fit into the socket buffer."""
        try:
            sent = self._send(data, socket.MSG_DONTWAIT)
            while sent < len(data):  # the peer has stopped reading
                select.select([], [self.socket], [], 5.0)
                sent += self._send(data[sent:], socket.MSG_DONTWAIT)
        except OSError as error:
            raise LinkClosedError from error

    def close(self) -> None:
        """Close the connection."""
        self.socket.close()
