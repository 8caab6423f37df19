"""The clients of one vehicle and their links, in simulated time."""

from __future__ import annotations

from flightstack.core.port_numbers import API, GROUND
from flightstack.mavlink.dialect import mavlink as m
from flightstack.services.routing.hub import GroundHub
from flightstack.services.routing.peer import PeerAddress
from flightstack.services.telemetry.streams import Streams
from flightstack.testing.client import Client
from flightstack.testing.link import Link

_SETTLES = 10_000
"""Most rounds of messages at one instant; a mission upload takes two for each item."""

SLOW_RATES_HZ: dict[int, float] = {
    m.MAVLINK_MSG_ID_ATTITUDE: 4.0,
    m.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 4.0,
    m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 4.0,
    m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
    m.MAVLINK_MSG_ID_MISSION_CURRENT: 2.0,
    m.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    m.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    m.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
    m.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
}
"""Telemetry without ``telemetry=True``: a flight with PX4's default rates takes three times as long."""


class Network:
    """Carries datagrams between the vehicle's hub and its clients."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self.clients: dict[str, Client] = {}

    def add(self, name: str, hub: GroundHub, telemetry: bool, is_companion: bool = False) -> Client:
        """Connect a client; its link has a seed of its own. Raise ValueError for a name in use."""
        if name in self.clients:
            raise ValueError(f"a client named {name!r} is there already")
        number = len(self.clients)
        address = PeerAddress(API if is_companion else GROUND, "memory", number)
        client = Client(name, address, Link(self._seed * 1000 + number), is_companion)
        self.clients[name] = client
        self.connect(client, hub, telemetry)
        return client

    def connect(self, client: Client, hub: GroundHub, telemetry: bool) -> None:
        """Add a client to a hub, that of a vehicle after a power cycle too."""
        peer = hub.add_peer(client.address, permanent=True)
        if not telemetry:
            peer.streams = Streams(SLOW_RATES_HZ)

    def exchange(self, hub: GroundHub, now_s: float) -> bool:
        """Exchange the messages of this instant once; return True if any arrived."""
        arrived = False
        for client in self.clients.values():
            for data in client.poll(now_s):
                client.link.to_vehicle.send(data, now_s)
            for data in client.link.to_vehicle.receive(now_s):
                hub.receive(client.address, data, now_s)
                arrived = True
        by_address = {client.address: client for client in self.clients.values()}
        for address, data in hub.poll(now_s):
            if address in by_address:  # a test may add peers of its own
                by_address[address].link.from_vehicle.send(data, now_s)
        for client in self.clients.values():
            for data in client.link.from_vehicle.receive(now_s):
                client.receive(data, now_s)
                arrived = True
        return arrived

    def settle(self, hub: GroundHub, now_s: float) -> None:
        """Exchange messages until none is left at this instant."""
        for _ in range(_SETTLES):
            if not self.exchange(hub, now_s):
                return
        raise AssertionError(f"clients and vehicle exchange messages without end at t = {now_s:.3f} s")
