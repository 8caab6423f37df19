"""A vehicle's parameters and ground stations on lossy links in simulated time; every message is framed and parsed."""

from __future__ import annotations

from collections.abc import Callable

from flightstack.mavlink.link import Address, Link, Message
from flightstack.params.spec import ParamSpec
from flightstack.params.store import ParamStore
from flightstack.services.params.param_server import ParamServer
from flightstack.transports.memory import LOSSLESS, Conditions, LossyLink
from gcs_cli.clients.param_client import ParamClient, ParamResult

VEHICLE = Address(1, 1)
LOSSY = Conditions(loss=0.2, duplication=0.2, reordering=0.2, delay_s=0.02, jitter_s=0.03)


def spec(name: str, default: float, low: float, high: float, is_integer: bool = False) -> ParamSpec:
    return ParamSpec(name, default, low, high, "m", "Help", is_integer)


def store_of(count: int = 100) -> ParamStore:
    """``count`` parameters, every third an integer; some names have 16 letters."""
    specs = []
    for index in range(count):
        is_integer = index % 3 == 0
        name = f"P{index:03d}" + "_LONG_NAME_12"[: index % 13]
        specs.append(spec(name, index if is_integer else index / 10, -10, 1000, is_integer))
    return ParamStore(specs)


class Station:
    """A parameter client on a link of its own."""

    def __init__(
        self, name: str, conditions: Conditions = LOSSLESS, seed: int = 0, system: int = 255
    ) -> None:
        self.name = name
        self.client = ParamClient(VEHICLE, Address(system, 190))
        self.codec = Link(system, 190)
        self.vehicle_codec = Link(*VEHICLE)
        self.wire = LossyLink(conditions, seed)
        self.got: list[Message] = []

    def of_type(self, kind: str) -> list[Message]:
        return [message for message in self.got if message.get_type() == kind]


class World:
    """One vehicle and its ground stations. Time jumps to whatever happens next."""

    def __init__(self, store: ParamStore, *stations: Station) -> None:
        self.now_s = 100.0
        self.store = store
        self.said: list[str] = []
        self.server = ParamServer(VEHICLE, store, self.said.append)
        self.stations = {station.name: station for station in stations}

    def send(self, name: str, message: Message) -> None:
        """Let a station send a message of no client of ours."""
        station = self.stations[name]
        station.wire.one.send(station.codec.encode(message), self.now_s)

    def step(self) -> bool:
        """Do what is due and go to the next event; return False when nothing will ever happen."""
        for station in self.stations.values():
            for data in station.wire.two.receive(self.now_s):
                for message in station.vehicle_codec.decode(data):
                    self.server.receive(message, station.name, self.now_s)
            for data in station.wire.one.receive(self.now_s):
                for message in station.codec.decode(data):
                    station.got.append(message)
                    station.client.receive(message, self.now_s)
            for message in station.client.poll(self.now_s):
                station.wire.one.send(station.codec.encode(message), self.now_s)
        for peer, message in self.server.poll(self.now_s):
            names = list(self.stations) if peer is None else [str(peer)]
            for station in (self.stations[name] for name in names):
                station.wire.two.send(station.vehicle_codec.encode(message), self.now_s)
        deadlines = [self.server.next_deadline()]
        for station in self.stations.values():
            deadlines += [station.client.next_deadline(), station.wire.next_arrival()]
        due = [deadline for deadline in deadlines if deadline is not None]
        if due:
            self.now_s = max(self.now_s, min(due))
        return bool(due)

    def run(self, until: Callable[[], bool] | None = None, limit_s: float = 2000.0) -> None:
        """Step until ``until`` holds, else until all is quiet; fail after ``limit_s`` of simulated time."""
        end_s = self.now_s + limit_s
        while (until is None or not until()) and self.step():
            assert self.now_s < end_s, "the exchange does not end"

    def get(self, name: str, parameter: str) -> ParamResult | None:
        self.stations[name].client.start_get(parameter)
        self.run()
        return self.stations[name].client.result

    def set(self, name: str, parameter: str, value: float) -> ParamResult | None:
        self.stations[name].client.start_set(parameter, value)
        self.run()
        return self.stations[name].client.result

    def list(self, name: str) -> ParamResult | None:
        self.stations[name].client.start_list()
        self.run()
        return self.stations[name].client.result
