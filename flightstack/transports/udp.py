"""Non-blocking UDP sockets for ground station and vehicle."""

from __future__ import annotations

import contextlib
import errno
import select
import socket
from collections.abc import Iterator
from typing import TypeAlias

Address: TypeAlias = tuple[str, int]

_LARGEST_DATAGRAM = 65536
_RECEIVE_BUFFER = 1 << 20  # for bursts of telemetry at many times real time
_DATAGRAMS_A_CALL = 1000


class PortBusyError(Exception):
    """A port cannot be used; the text is one sentence that names it."""

    def __init__(self, kind: str, address: Address, reason: str, is_in_use: bool = True) -> None:
        super().__init__(f"{kind} port {address[1]} on {address[0]} {reason}")
        self.address = address
        self.is_in_use = is_in_use
        """True if another program uses the port."""


def _bound(address: Address) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.setblocking(False)
        with contextlib.suppress(OSError):
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        made.bind(address)
    except (OSError, OverflowError) as error:
        made.close()
        busy = getattr(error, "errno", None) == errno.EADDRINUSE
        reason = "is in use" if busy else f"cannot be used: {getattr(error, 'strerror', None) or error}"
        raise PortBusyError("UDP", address, reason, busy) from None
    return made


def resolve(host: str) -> str:
    """Return the IPv4 address of a host name; raise OSError."""
    try:
        return socket.gethostbyname(host)
    except UnicodeError:  # not encodable as a host name
        raise OSError(f"not a host name: {host}") from None


class UdpSocket:
    """Datagrams to and from any peer. Unsent ones are counted and raise no error."""

    def __init__(self, host: str = "127.0.0.1", port: int = 0, largest: int = _LARGEST_DATAGRAM) -> None:
        """Bind to ``host``:``port`` (0: any free one); raise PortBusyError. Longer datagrams are truncated."""
        self._largest = largest
        self._socket = _bound((host, port))
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        self.unsent = 0

    @property
    def address(self) -> Address:
        """The local address with the actual port."""
        host, port = self._socket.getsockname()[:2]
        return str(host), int(port)

    def fileno(self) -> int:
        """Return the file descriptor, for ``select``."""
        return self._socket.fileno()

    def receive(self) -> Iterator[tuple[bytes, Address]]:
        """Yield available datagrams, up to a bound per call."""
        for _ in range(_DATAGRAMS_A_CALL):
            try:
                data, peer = self._socket.recvfrom(self._largest)
            except BlockingIOError:
                return
            except OSError:  # an ICMP error for an earlier datagram
                continue
            yield data, peer[:2]

    def send(self, data: bytes, peer: Address) -> bool:
        """Send one datagram; return False if the system refuses it."""
        try:
            self._socket.sendto(data, peer)
        except (OSError, OverflowError):
            self.unsent += 1
            return False
        return True

    def wait(self, timeout_s: float) -> bool:
        """Wait up to ``timeout_s`` for a datagram; return False after a timeout."""
        return bool(self._poll.poll(max(0.0, timeout_s) * 1e3))

    def close(self) -> None:
        """Close the socket; a second call does nothing."""
        self._socket.close()

    def __enter__(self) -> UdpSocket:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
