"""The TCP connection of the one client: receive by spinning briefly, then by waiting with a deadline."""

from __future__ import annotations

import contextlib
import select
import signal
import socket
import time
from types import FrameType

# A blocking round trip costs some 70 µs of waking up, a spinning one 6 µs. An answer comes within 20 to
# 50 µs, so that spinning for this long nearly always meets it, and a silent client costs no processor time.
SPIN_NS = 150_000


class StoppedError(Exception):
    """The user asked to stop."""


class PeerClosedError(Exception):
    """The client closed the connection."""


class PeerSilentError(Exception):
    """Nothing came before the deadline."""


class StopSignal:
    """Turns SIGINT and SIGTERM into a flag that also wakes up a waiting ``poll``."""

    def __init__(self) -> None:
        self.stopped = False
        self._wake, self._woken = socket.socketpair()
        self._wake.setblocking(False)
        signal.set_wakeup_fd(self._wake.fileno(), warn_on_full_buffer=False)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)

    def _stop(self, _number: int, _frame: FrameType | None) -> None:
        self.stopped = True

    def is_set(self) -> bool:
        """Whether the user asked to stop."""
        return self.stopped

    def wait_for(self, sock: socket.socket, events: int, deadline_ns: int | None) -> None:
        """Wait until ``sock`` is ready; raise StoppedError, or PeerSilentError at the deadline."""
        poll = select.poll()
        poll.register(sock, events)
        poll.register(self._woken, select.POLLIN)
        timeout_ms = None if deadline_ns is None else max(0.0, (deadline_ns - time.monotonic_ns()) * 1e-6)
        ready = poll.poll(timeout_ms)
        if self.stopped:
            raise StoppedError
        if not ready:
            raise PeerSilentError


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket; port 0 takes a free one. Raises OSError."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        # without this, a port stays busy for a minute after each run
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(1)
    except (OSError, OverflowError):
        listener.close()
        raise
    listener.setblocking(False)
    return listener


class Connection:
    """A connected client."""

    def __init__(self, sock: socket.socket, stop: StopSignal, timeout_s: float) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = sock
        self._stop = stop
        self._timeout_ns = int(timeout_s * 1e9)
        self._buffer = memoryview(bytearray(65536))
        self._last_heard_ns = time.monotonic_ns()

    def receive(self) -> memoryview:
        """Wait for bytes; raise PeerClosedError, PeerSilentError after the timeout, or StoppedError."""
        began_ns = time.monotonic_ns()
        while True:
            data = self.receive_now()
            if data is not None:
                return data
            now_ns = time.monotonic_ns()
            if self._stop.stopped:
                raise StoppedError
            if now_ns - began_ns > SPIN_NS:
                self._last_heard_ns = max(self._last_heard_ns, began_ns)
                self._stop.wait_for(self._socket, select.POLLIN, self._last_heard_ns + self._timeout_ns)

    def receive_now(self) -> memoryview | None:
        """Return the bytes that have come, None when there are none; raise PeerClosedError."""
        try:
            count = self._socket.recv_into(self._buffer)
        except BlockingIOError:
            return None
        except OSError as error:  # reset by the peer
            raise PeerClosedError from error
        if count == 0:
            raise PeerClosedError
        return self._buffer[:count]

    def check_alive(self, heard: bool) -> None:
        """Raise PeerSilentError when nothing was heard for the timeout, for a loop that never waits."""
        now_ns = time.monotonic_ns()
        if heard:
            self._last_heard_ns = now_ns
        elif now_ns - self._last_heard_ns > self._timeout_ns:
            raise PeerSilentError

    def send(self, data: bytes | bytearray | memoryview) -> None:
        """Send all of ``data``; raise PeerSilentError or StoppedError.

        A closed connection is left for ``receive`` to report, after what the client said last.
        """
        try:
            sent = self._socket.send(data)
        except BlockingIOError:
            sent = 0
        except OSError:
            return
        if sent != len(data):
            deadline_ns = time.monotonic_ns() + self._timeout_ns
            self._stop.wait_for(self._socket, select.POLLOUT, deadline_ns)
            self.send(memoryview(data)[sent:])

    def send_last(self, data: bytes) -> None:
        """Send ``data`` if that can be done at once, else not at all."""
        with contextlib.suppress(OSError):
            self._socket.send(data)
