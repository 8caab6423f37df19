"""The TCP connection to the client: each wait has a deadline and ends at a stop signal."""

from __future__ import annotations

import contextlib
import select
import signal
import socket
import sys
import time
from types import FrameType

from flightstack.transports.tcp import RECEIVE_TIMEOUT_S, wait_in_kernel


class StoppedError(Exception):
    """The user requested the end."""


class PeerClosedError(Exception):
    """The client closed the connection."""


class PeerSilentError(Exception):
    """Nothing was received before the deadline."""


class StopSignal:
    """Turns SIGINT and SIGTERM into a flag that interrupts a ``poll``."""

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
        """Return True after SIGINT or SIGTERM."""
        return self.stopped

    def waiter(self, sock: socket.socket, events: int) -> Waiter:
        """Return a waiter for ``sock`` and this signal."""
        poll = select.poll()
        poll.register(sock, events)
        poll.register(self._woken, select.POLLIN)
        return Waiter(self, poll)


class Waiter:
    """Waits until a socket is ready or the process is stopped."""

    def __init__(self, stop: StopSignal, poll: select.poll) -> None:
        self._stop = stop
        self._poll = poll.poll

    def wait(self, timeout_s: float | None) -> None:
        """Wait until the socket is ready; raise StoppedError, or PeerSilentError at the timeout."""
        ready = self._poll(None if timeout_s is None else timeout_s * 1e3)
        if self._stop.stopped:
            raise StoppedError
        if not ready:
            raise PeerSilentError


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket; port 0 picks a free one. Raises OSError."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        # otherwise the port stays busy for a minute after each run
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(1)
    except (OSError, OverflowError):
        listener.close()
        raise
    listener.setblocking(False)
    return listener


def hold(listener: socket.socket) -> contextlib.AbstractContextManager[object]:
    """Hold the port of a listener until the returned context ends; raise OSError if another process holds it.

    A simulator closes its listener when its client has connected, and a second one could listen on the port. The
    name is one of Linux's, without a file; elsewhere nothing is held.
    """
    if sys.platform != "linux":
        return contextlib.nullcontext()
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(f"\0sim-bridge {listener.getsockname()[1]}")
    except OSError:
        held.close()
        listener.close()
        raise
    return held


class Connection:
    """A connected client."""

    def __init__(self, sock: socket.socket, stop: StopSignal, timeout_s: float) -> None:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        wait_in_kernel(sock)
        self.socket = sock
        """The connected socket."""
        self._receive_into = sock.recv_into
        self._send = sock.send
        self._stop = stop
        self._timeout_s = timeout_s
        self._buffer = memoryview(bytearray(65536))
        self._last_received_ns = time.monotonic_ns()

    def receive(self) -> memoryview:
        """Wait for bytes; raise PeerClosedError, PeerSilentError at the timeout, or StoppedError."""
        waited_s = 0.0
        while (data := self.receive_now(0)) is None:
            waited_s += RECEIVE_TIMEOUT_S
            if self._stop.stopped:
                raise StoppedError
            if waited_s >= self._timeout_s:
                raise PeerSilentError
        return data

    def receive_within(self, timeout_s: float) -> memoryview | None:
        """Wait for bytes; return None at the timeout; raise PeerClosedError, StoppedError, or PeerSilentError."""
        try:
            self._stop.waiter(self.socket, select.POLLIN).wait(timeout_s)
        except PeerSilentError:
            self.check_alive(False)
            return None
        self.check_alive(True)
        return self.receive_now()

    def receive_now(self, flags: int = socket.MSG_DONTWAIT) -> memoryview | None:
        """Return the received bytes, or None; raise PeerClosedError."""
        try:
            count = self._receive_into(self._buffer, 0, flags)
        except BlockingIOError:
            return None
        except OSError as error:  # reset by the peer
            raise PeerClosedError from error
        if count == 0:
            raise PeerClosedError
        return self._buffer[:count]

    def check_alive(self, received: bool) -> None:
        """Raise PeerSilentError if nothing was received within the timeout, for a loop that never waits."""
        now_ns = time.monotonic_ns()
        if received:
            self._last_received_ns = now_ns
        elif now_ns - self._last_received_ns > self._timeout_s * 1e9:
            raise PeerSilentError

    def send(self, data: bytes | bytearray | memoryview) -> None:
        """Send all of ``data``; raise PeerSilentError or StoppedError.

        ``receive`` reports a closed connection, after the last bytes of the client.
        """
        try:
            sent = self._send(data, socket.MSG_DONTWAIT)
        except BlockingIOError:
            sent = 0
        except OSError:
            return
        if sent != len(data):
            self._stop.waiter(self.socket, select.POLLOUT).wait(self._timeout_s)
            self.send(memoryview(data)[sent:])

    def send_last(self, data: bytes) -> None:
        """Send ``data`` if possible without waiting, else drop it."""
        with contextlib.suppress(OSError):
            self.socket.send(data, socket.MSG_DONTWAIT)
