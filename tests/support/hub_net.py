"""A ground hub without a process, and the stations connected to it."""

from __future__ import annotations

import math

from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.params.config import TRUTH, StackConfig
from flightstack.process.assembly import build
from flightstack.services.logs.log_store import NO_LOGS, LogStore
from flightstack.services.routing.peer import PeerAddress

ALICE, BOB = PeerAddress(GROUND, "alice", 1), PeerAddress("api", "bob", 2)
ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
NAN = math.nan


class Station:
    """A ground station and its end of the link."""

    def __init__(self, net: Net, address: PeerAddress, system: int = 255, component: int = 190) -> None:
        self.net, self.address = net, address
        self.codec = Link(system, component)
        self.frames: list[bytes] = []
        self.inbox: list = []

    def send(self, message) -> None:
        self.net.hub.receive(self.address, self.codec.encode(message), self.net.now_s)

    def heartbeat(self) -> None:
        self.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def command(self, number: int, *params: float, system: int = 7, component: int = 1) -> None:
        values = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(system, component, number, 0, *values))

    def take(self, kind: str) -> list:
        """Return the messages of a type received since the last call."""
        found = [message for message in self.inbox if message.get_type() == kind]
        self.inbox = [message for message in self.inbox if message.get_type() != kind]
        return found

    def ask(self, number: int, *params: float, **where: int) -> int:
        """Send a command and return the result of its acknowledgement."""
        self.command(number, *params, **where)
        self.net.poll()
        (ack,) = self.take("COMMAND_ACK")
        assert ack.command == number
        return ack.result


class Net:
    """A hub without a process, with its own clock; by default vehicle time advances with it."""

    def __init__(self, logs: LogStore = NO_LOGS) -> None:
        stack = build(StackConfig(system_id=7, state=TRUTH), lambda: None, logs)
        self.stack, self.hub = stack, stack.ground
        stack.now.has_state = True
        self.now_s = 50.0
        self.stations: dict[PeerAddress, Station] = {}
        self.strangers: list[PeerAddress] = []

    def join(self, address: PeerAddress, heard: bool = True, **ids: int) -> Station:
        station = self.stations[address] = Station(self, address, **ids)
        if heard:
            station.heartbeat()
        return station

    def poll(self) -> None:
        for address, data in self.hub.poll(self.now_s):
            if address in self.stations:
                self.stations[address].frames.append(data)
                self.stations[address].inbox += self.stations[address].codec.decode(data)
            else:
                self.strangers.append(address)

    def run(self, seconds: float, vehicle_rate: float = 1.0, step_s: float = 0.01) -> None:
        for _ in range(round(seconds / step_s)):
            self.now_s += step_s
            self.stack.now.time_us += round(step_s * vehicle_rate * 1e6)
            self.poll()
