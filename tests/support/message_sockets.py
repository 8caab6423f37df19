"""Two sockets that keep messages apart, so that a test can write several of them ahead of compiled code."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator

from flightstack.transports.tcp import wait_in_kernel


@contextlib.contextmanager
def socket_pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    """The end of compiled code, and that of the test."""
    ours, others = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    wait_in_kernel(ours)
    others.setblocking(False)
    with ours, others:
        yield ours, others


def messages(end: socket.socket) -> list[bytes]:
    """Return the messages that wait."""
    found = []
    with contextlib.suppress(BlockingIOError):
        while True:
            found.append(end.recv(4096))
    return found


def fill(end: socket.socket) -> None:
    """Send until nothing more is accepted."""
    with contextlib.suppress(BlockingIOError):
        while True:
            end.send(bytes(100_000), socket.MSG_DONTWAIT)
