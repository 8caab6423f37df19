"""A vehicle's service and its clients on lossy links in simulated time; every message is framed and parsed."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from flightstack.mavlink.files import BytesFile
from flightstack.mavlink.link import Address, Link, Message
from flightstack.services.logs.log_store import LogInfo
from flightstack.transports.memory import LOSSLESS, Conditions, LossyLink

VEHICLE = Address(1, 1)
GCS = Address(255, 190)
LOSSY = Conditions(loss=0.3, duplication=0.1, reordering=0.1, delay_s=0.02, jitter_s=0.02)


def content(size: int, seed: int = 0) -> bytes:
    return random.Random(seed).randbytes(size)


class ClientSide(Protocol):
    def receive(self, message: Message, now_s: float) -> None: ...

    def poll(self, now_s: float) -> list[Message]: ...

    def next_deadline(self) -> float | None: ...


class MemoryLogs:
    """Logs in memory, the last one still being written."""

    def __init__(self, logs: Mapping[str, bytes]) -> None:
        self.content = dict(logs)
        self.opened: list[str] = []

    def logs(self) -> list[LogInfo]:
        return [
            LogInfo(name, len(data), 1_700_000_000 + 86_400 * n)
            for n, (name, data) in enumerate(self.content.items())
        ]

    def open(self, name: str) -> BytesFile | None:
        self.opened.append(name)
        return BytesFile(self.content[name]) if name in self.content else None

    def open_tail(self) -> None:
        return

    def erase(self) -> int:
        count = max(0, len(self.content) - 1)
        self.content = dict(list(self.content.items())[-1:])
        return count


class Station:
    """One client on a link of its own."""

    def __init__(
        self, client: ClientSide, conditions: Conditions = LOSSLESS, seed: int = 0, address: Address = GCS
    ) -> None:
        self.client = client
        self.codec = Link(*address)
        self.vehicle_codec = Link(*VEHICLE)
        self.wire = LossyLink(conditions, seed)
        self.received: list[Message] = []


class Ether:
    """One server and its stations. Time jumps to whatever happens next."""

    def __init__(self, server: Any, *stations: Station) -> None:
        self.server = server
        self.stations = stations
        self.now_s = 100.0
        self.most_per_poll = 0

    def step(self) -> None:
        """Do what is due."""
        for number, station in enumerate(self.stations):
            for data in station.wire.two.receive(self.now_s):
                for message in station.vehicle_codec.decode(data):
                    self.server.receive(message, number, self.now_s)
            for data in station.wire.one.receive(self.now_s):
                for message in station.codec.decode(data):
                    station.received.append(message)
                    station.client.receive(message, self.now_s)
            for message in station.client.poll(self.now_s):
                station.wire.one.send(station.codec.encode(message), self.now_s)
        self._send(self.server.poll(self.now_s))

    def advance(self) -> None:
        """Go to the next event."""
        deadlines = [self.server.next_deadline()]
        for station in self.stations:
            deadlines += [station.client.next_deadline(), station.wire.next_arrival()]
        due = [deadline for deadline in deadlines if deadline is not None]
        assert due, "nothing will ever happen"
        self.now_s = max(self.now_s, min(due))

    def _send(self, addressed: Iterable[tuple[Any, Message]]) -> None:
        messages = list(addressed)
        self.most_per_poll = max(self.most_per_poll, len(messages))
        for peer, message in messages:
            station = self.stations[peer]
            station.wire.two.send(station.vehicle_codec.encode(message), self.now_s)

    def run(self, until: Callable[[], bool], limit_s: float = 600.0) -> float:
        """Step until ``until`` holds; return how long that took, at most ``limit_s`` of simulated time."""
        began_s = self.now_s
        while True:
            self.step()
            if until():
                return self.now_s - began_s
            assert self.now_s - began_s < limit_s, "the transfer does not end"
            self.advance()
