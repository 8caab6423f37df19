"""Ground stations and a vehicle on lossy links in simulated time; every message is framed and parsed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from flightstack.mavlink.link import Address, Link
from flightstack.plan import Command, Frame, MissionItem, MissionType, check_mission
from flightstack.plan.fence import check_fence
from flightstack.plan.rally import check_rally
from flightstack.services.mission.mission_server import MissionServer
from flightstack.services.mission.mission_store import MissionEvent
from flightstack.transports.memory import LOSSLESS, Conditions, LossyLink
from gcs_cli.clients.mission_client import Done, MissionClient
from tests.support.plan_items import HOME

VEHICLE = Address(1, 1)
LOSSY = Conditions(loss=0.2, duplication=0.2, reordering=0.2, delay_s=0.02, jitter_s=0.03)
NAN = float("nan")


def waypoint(north_e7: int = 0, altitude_m: float = 5.0, hold_s: float = 0.0) -> MissionItem:
    return MissionItem(
        Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT_INT, hold_s, 0.5, 0.0, NAN,
        473977420 + north_e7, 85455940, altitude_m,
    )  # fmt: skip


def mission(count: int, mark: int = 0) -> tuple[MissionItem, ...]:
    """A mission of ``count`` waypoints, told from others by ``mark``."""
    return tuple(waypoint(10 * seq, hold_s=float(mark)) for seq in range(count))


CHECKS = {
    MissionType.MISSION: lambda items: check_mission(items, HOME),
    MissionType.FENCE: lambda items: check_fence(items, HOME),
    MissionType.RALLY: lambda items: check_rally(items, HOME),
}


class GroundStation:
    """Mission clients, one for each type of plan, on a link of their own."""

    def __init__(
        self,
        name: str,
        conditions: Conditions = LOSSLESS,
        seed: int = 0,
        system: int = 255,
        *,
        mission_types: Sequence[MissionType] = (MissionType.MISSION,),
    ) -> None:
        self.name = name
        self.clients = {kind: MissionClient(VEHICLE, Address(system, 190), kind) for kind in mission_types}
        self.client = self.clients[mission_types[0]]
        self.codec = Link(system, 190)
        self.vehicle_codec = Link(*VEHICLE)
        self.wire = LossyLink(conditions, seed)


class World:
    """One vehicle and its ground stations. Time jumps to whatever happens next."""

    def __init__(
        self, *stations: GroundStation, stored: Sequence[MissionType] = (MissionType.MISSION,)
    ) -> None:
        self.now_s = 100.0
        self.stations = {station.name: station for station in stations}
        self.server = MissionServer(VEHICLE, {kind: CHECKS[kind] for kind in stored})
        self.events: list[MissionEvent] = []

    def step(self) -> bool:
        """Do what is due and go to the next event; return False when nothing will ever happen."""
        for station in self.stations.values():
            for data in station.wire.two.receive(self.now_s):
                for message in station.vehicle_codec.decode(data):
                    self.server.receive(message, station.name, self.now_s)
            for data in station.wire.one.receive(self.now_s):
                for message in station.codec.decode(data):
                    for client in station.clients.values():
                        client.receive(message, self.now_s)
            for client in station.clients.values():
                for message in client.poll(self.now_s):
                    station.wire.one.send(station.codec.encode(message), self.now_s)
        for peer, message in self.server.poll(self.now_s):
            station = self.stations[str(peer)]
            station.wire.two.send(station.vehicle_codec.encode(message), self.now_s)
        self.events += self.server.events()
        deadlines = [self.server.next_deadline()]
        for station in self.stations.values():
            deadlines += [client.next_deadline() for client in station.clients.values()]
            deadlines.append(station.wire.next_arrival())
        due = [deadline for deadline in deadlines if deadline is not None]
        if due:
            self.now_s = max(self.now_s, min(due))
        return bool(due)

    def run(self, until: Callable[[], bool] | None = None, limit_s: float = 2000.0) -> None:
        """Step until ``until`` holds, else until all is quiet; fail after ``limit_s`` of simulated time."""
        end_s = self.now_s + limit_s
        while (until is None or not until()) and self.step():
            assert self.now_s < end_s, "the transfer does not end"

    def upload(self, name: str, items: Sequence[MissionItem]) -> object:
        """Upload, let all settle, and return the result."""
        client = self.stations[name].client
        client.start_upload(items)
        self.run()
        return client.result

    def download(self, name: str) -> tuple[MissionItem, ...]:
        """Download, let all settle, and return the items."""
        client = self.stations[name].client
        client.start_download()
        self.run()
        assert isinstance(client.result, Done), client.result
        return client.result.items
