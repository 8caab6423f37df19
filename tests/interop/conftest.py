"""Vehicles and clients live as long as the tests of this package: to start and to find each other takes seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.interop.client import Client
from tests.interop.stack import RealVehicle


class Fleet:
    """One vehicle for each speed, one client for each vehicle and link; a failed test costs its vehicle."""

    def __init__(self, start: Callable[[float], RealVehicle]) -> None:
        self._start = start
        self._vehicles: dict[float, RealVehicle] = {}
        self._clients: dict[tuple[float, str], Client] = {}

    def vehicle(self, speed: float) -> RealVehicle:
        if speed not in self._vehicles:
            self._vehicles[speed] = self._start(speed)
        return self._vehicles[speed]

    def client(self, speed: float, link: str) -> Client:
        vehicle = self.vehicle(speed)
        if (speed, link) not in self._clients:
            self._clients[speed, link] = Client(vehicle, link)
        return self._clients[speed, link]

    def discard(self, speed: float) -> None:
        """Forget a vehicle that a failed test left in nobody knows what state."""
        for key in [key for key in self._clients if key[0] == speed]:
            self._clients.pop(key).kill()
        if (vehicle := self._vehicles.pop(speed, None)) is not None:
            vehicle.kill()

    def stop(self) -> None:
        """End all in order."""
        for client in self._clients.values():
            client.stop()
        for vehicle in self._vehicles.values():
            vehicle.stop()


@pytest.fixture(scope="package")
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
        fleet.discard(speed)


@pytest.fixture(scope="package")
def station_vehicle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealVehicle]:
    """A vehicle at ten times real time for ground stations that bind its UDP ports themselves."""
    vehicle = RealVehicle(tmp_path_factory.mktemp("station-vehicle"), 10.0)
    yield vehicle
    vehicle.stop()
