"""A vehicle and its clients live as long as tests of a file want the same speed: to find each other takes seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.interop.client import Client
from tests.interop.stack import RealVehicle


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of a file at one speed side by side, the slowest first: each change costs vehicle and clients."""
    files = {path: number for number, path in enumerate(dict.fromkeys(item.path for item in items))}
    items.sort(key=lambda item: (files[item.path], speed_of(item)))


def speed_of(item: pytest.Item) -> float:
    """Return the speed of the client of a test, 0 if it has none."""
    callspec = getattr(item, "callspec", None)
    client = callspec.params.get("client") if callspec else None
    return float(client[0]) if client and item.path.parent == Path(__file__).parent else 0.0


class Fleet:
    """One vehicle at a time, and one client of it for each link; a failed test costs its vehicle.

    At ten times real time a vehicle that waits takes half of a processor, so that none is kept for later.
    """

    def __init__(self, start: Callable[[float], RealVehicle]) -> None:
        self._start = start
        self._vehicle: RealVehicle | None = None
        self._clients: dict[str, Client] = {}

    def vehicle(self, speed: float) -> RealVehicle:
        if self._vehicle is None or self._vehicle.speed != speed:
            self.stop()
            self._vehicle = self._start(speed)
        return self._vehicle

    def client(self, speed: float, link: str) -> Client:
        vehicle = self.vehicle(speed)
        if link not in self._clients:
            self._clients[link] = Client(vehicle, link)
        return self._clients[link]

    def discard(self) -> None:
        """End a vehicle that a failed test left in an unknown state."""
        vehicle, clients = self._forget()
        for client in clients:
            client.kill()
        if vehicle is not None:
            vehicle.kill()

    def stop(self) -> None:
        """End all in order."""
        vehicle, clients = self._forget()
        for client in clients:
            client.stop()
        if vehicle is not None:
            vehicle.stop()

    def _forget(self) -> tuple[RealVehicle | None, list[Client]]:
        vehicle, clients = self._vehicle, list(self._clients.values())
        self._vehicle, self._clients = None, {}
        return vehicle, clients


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    fleet = Fleet(lambda speed: RealVehicle(tmp_path_factory.mktemp(f"vehicle-{speed:g}x-"), speed))
    yield fleet
    fleet.stop()


@pytest.fixture
def client(request: pytest.FixtureRequest, fleet: Fleet) -> Iterator[Client]:
    """A client of MAVSDK at the speed and on the link of the test."""
    speed, link = request.param
    failed = request.session.testsfailed
    yield fleet.client(speed, link)
    if request.session.testsfailed > failed:
        fleet.discard()


@pytest.fixture(scope="module")
def station_vehicle(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[RealVehicle]:
    """A vehicle at ``SPEED`` of the file, else ten times real time; ground stations bind its UDP ports themselves."""
    speed = getattr(request.module, "SPEED", 10.0)
    vehicle = RealVehicle(tmp_path_factory.mktemp("station-vehicle"), speed)
    yield vehicle
    vehicle.stop()
