"""Two vehicles on one machine: each command reaches its own, and neither vehicle calls the clients of the other."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from flightstack.core.port_numbers import ground_station_port, system_id, vehicle_ground_port
from flightstack.transports.udp import UdpSocket
from tests.support.commands import gcs
from tests.support.vehicle_processes import VehicleProcesses, vehicle


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[VehicleProcesses, VehicleProcesses]]:
    folder = tmp_path_factory.mktemp("two")
    with vehicle(folder, with_simulator=False) as one, vehicle(folder, with_simulator=False) as other:
        assert one.instance != other.instance
        yield one, other


@pytest.mark.parametrize("place", ["before", "after"])
def test_instance_finds_its_vehicle(two: tuple[VehicleProcesses, VehicleProcesses], place: str) -> None:
    for one in two:
        option = ["--instance", one.instance]
        words = [*option, "status", "--json"] if place == "before" else ["status", "--json", *option]
        result = gcs(*words)
        assert result.returncode == 0, result.stderr
        assert json.loads(result.stdout)["system"] == system_id(one.instance)


def test_another_vehicle_is_never_taken_for_the_instance(
    two: tuple[VehicleProcesses, VehicleProcesses],
) -> None:
    one, other = two
    result = gcs("--instance", one.instance, "--connect", other.link, "--timeout", "2", "status")
    assert (result.stdout, result.returncode) == ("", 3)
    assert f"no vehicle with system id {one.instance + 1} answered" in result.stderr
    assert f"only system {other.instance + 1}" in result.stderr


def test_a_vehicle_calls_the_ground_station_of_its_instance(
    two: tuple[VehicleProcesses, VehicleProcesses],
) -> None:
    """Each sends heartbeats once a second; two from each are enough to see where they go."""
    for one in two:
        with UdpSocket("127.0.0.1", ground_station_port(one.instance)) as station:
            senders = set()
            for _ in range(2):
                assert station.wait(10.0)
                senders |= {peer for _, peer in station.receive()}
        assert senders == {("127.0.0.1", vehicle_ground_port(one.instance))}
