"""The other end of a round trip: answers each frame with one of the actuators' size."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable

from flightstack.transports.tcp import wait_in_kernel


def receiver(connection: socket.socket, spin: bool) -> Callable[[], int]:
    """Return a function that waits for bytes and returns how many came."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    wait_in_kernel(connection)
    into, buffer = connection.recv_into, bytearray(65536)
    flags = socket.MSG_DONTWAIT if spin else 0

    def receive() -> int:
        while True:
            try:
                return into(buffer, 0, flags)
            except BlockingIOError:
                pass

    return receive


def echo(port: int, spin: bool, answer: bytes) -> None:
    """Answer until the other end closes."""
    with socket.create_connection(("127.0.0.1", port)) as connection:
        receive, send = receiver(connection, spin), connection.send
        while receive():
            send(answer)


if __name__ == "__main__":
    echo(int(sys.argv[1]), sys.argv[2] == "spin", bytes(int(sys.argv[3])))
