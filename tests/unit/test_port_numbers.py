"""The ports of instances: none is shared, and the options say otherwise only when they are given."""

from __future__ import annotations

import pytest

from flightstack.core import port_numbers as ports
from flightstack.process.ports import ports_config

UDP = (
    ports.vehicle_ground_port,
    ports.vehicle_api_port,
    ports.ground_station_port,
    ports.api_client_port,
)
TCP = (ports.simulator_port, ports.tcp_port)


@pytest.mark.parametrize("numbers", [UDP, TCP], ids=["UDP", "TCP"])
def test_no_two_instances_share_a_port(numbers: tuple) -> None:
    used = [number(instance) for number in numbers for instance in range(ports.INSTANCES)]
    assert len(set(used)) == len(used)
    assert max(used) < 65536


def test_the_first_ten_instances_have_px4s_ports() -> None:
    for instance in range(10):
        numbers = [number(instance) - instance for number in (*UDP, ports.simulator_port)]
        assert numbers == [18570, 14580, 14550, 14540, 4560]


@pytest.mark.parametrize(
    ("instance", "station", "api"), [(0, 14550, 14540), (3, 14553, 14543), (23, 16553, 16543)]
)
def test_an_instance_calls_clients_of_its_own(instance: int, station: int, api: int) -> None:
    config = ports_config(instance, [], None, None, "127.0.0.1", None)
    assert config.ground_stations == (("127.0.0.1", station),)
    assert config.api_client == ("127.0.0.1", api)
    told = ports_config(instance, [], 14550, 14540, "127.0.0.1", None)
    assert (told.ground_stations[0][1], told.api_client[1]) == (14550, 14540)
