"""The vehicle's UDP ports, numbered as PX4's: one channel for ground stations, one for companions (API)."""

from __future__ import annotations

import select
from collections.abc import Iterator

from flightstack.transport.udp import Address, PortBusyError, UdpSocket

GROUND, API = "ground", "api"
GROUND_LOCAL_PORT, API_LOCAL_PORT = 18570, 14580
LOOPBACK = "127.0.0.1"


class VehiclePorts:
    """Two sockets on the loopback interface, bound to 18570 and 14580, each plus the instance."""

    def __init__(self, instance: int, ground_port: int, api_port: int) -> None:
        """Bind both; raise PortBusyError. ``first_peers`` are those whom the vehicle addresses unasked."""
        self._sockets = {GROUND: UdpSocket(LOOPBACK, GROUND_LOCAL_PORT + instance)}
        try:
            self._sockets[API] = UdpSocket(LOOPBACK, API_LOCAL_PORT + instance)
        except PortBusyError:
            self.close()
            raise
        self.first_peers: dict[str, Address] = {GROUND: (LOOPBACK, ground_port), API: (LOOPBACK, api_port)}

    def receive(self) -> Iterator[tuple[str, Address, bytes]]:
        """Yield (channel, peer, datagram) of what is here."""
        for channel, socket in self._sockets.items():
            for data, peer in socket.receive():
                yield channel, peer, data

    def send(self, channel: str, peer: Address, data: bytes) -> None:
        """Send a datagram."""
        self._sockets[channel].send(data, peer)

    def register(self, poller: select.poll) -> None:
        """Let ``poller`` wake up when a datagram is here."""
        for socket in self._sockets.values():
            poller.register(socket, select.POLLIN)

    def close(self) -> None:
        """Close the sockets."""
        for socket in self._sockets.values():
            socket.close()
