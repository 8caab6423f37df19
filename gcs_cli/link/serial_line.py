"""A serial port as the transport of a connection; a module of its own, because pyserial takes long to import."""

from __future__ import annotations

import contextlib
import select
from collections.abc import Iterable, Iterator, Sequence

from flightstack.transports.byte_link import LineError
from flightstack.transports.serial_port import SerialPort
from flightstack.transports.udp import Address
from gcs_cli.link.lines import RETRY_S, Interest


class SerialLine:
    """A serial port, opened again when the device returns."""

    def __init__(self, device: str, baud: int) -> None:
        """Open the device; raise LineError."""
        self._peer = (device, baud)
        self._port: SerialPort | None = SerialPort(device, baud)
        self.peers: Sequence[Address] = (self._peer,)
        self.problem = ""
        self._retry_s = 0.0

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""
        return [] if self._port is None else [(self._port.fileno(), select.POLLIN)]

    def due_s(self) -> float | None:
        """Return the time of the next attempt to open the device."""
        return self._retry_s if self._port is None else None

    def receive(self, now_s: float) -> Iterator[tuple[bytes, Address]]:
        """Yield the bytes that have arrived; open the device if it is time to."""
        if self._port is None and now_s >= self._retry_s:
            self._retry_s = now_s + RETRY_S
            with contextlib.suppress(LineError):
                self._port = SerialPort(*self._peer)
                self.problem = ""
        while self._port is not None:
            try:
                data = self._port.read(0.0)
            except LineError as error:
                self._lose(error)
                return
            if not data:
                return
            yield data, self._peer

    def send(self, data: bytes, peer: Address) -> None:
        """Send a frame."""
        if self._port is not None:
            try:
                self._port.write(data)
            except LineError as error:
                self._lose(error)

    def _lose(self, error: LineError) -> None:
        self.problem = str(error)
        self.close()

    def closed_peers(self) -> Iterable[Address]:
        """Return nothing: the same vehicle is expected when the device returns."""
        return ()

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            self._port.close()
        self._port = None
