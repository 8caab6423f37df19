"""A running ``Server``: its URLs and faults. A file of its own, so that the vehicle ends with these tests."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from pymavlink import mavutil

from flightstack.testing.server import Server
from flightstack.testing.setup import Setup
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint

LONG_S = 60.0
"""Hang guard [s]."""


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("vehicle")
    setup = Setup(vehicle="x_quad", state="truth", params={"MIS_TAKEOFF_ALT": 4.0})
    with Server(setup, folder, speed=4.0, faults=["battery level 0.6 @0.5"]) as started:
        yield started


def test_pymavlink_reads_a_parameter_at_the_url(vehicle: Server) -> None:
    link = mavutil.mavlink_connection(vehicle.mavlink_url)
    try:
        assert link.wait_heartbeat(timeout=LONG_S) is not None
        link.mav.param_request_read_send(link.target_system, 1, b"MIS_TAKEOFF_ALT", -1)
        answer = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=LONG_S)
        assert (answer.param_id, answer.param_value) == ("MIS_TAKEOFF_ALT", 4.0)
    finally:
        link.close()


def test_fault_acts_from_its_time_since_the_start_of_the_simulator(vehicle: Server) -> None:
    with Connection(parse_endpoint(vehicle.gcs_url)) as connection:
        assert connection.wait_for(lambda: connection.session.view.battery is not None, LONG_S)
        assert connection.wait_for(lambda: connection.session.view.battery.remaining <= 0.6, LONG_S)


def test_urls_have_the_forms_of_their_libraries(vehicle: Server) -> None:
    assert re.fullmatch(r"udpin://127\.0\.0\.1:\d+", vehicle.mavsdk_url)
    assert re.fullmatch(r"udpin:127\.0\.0\.1:\d+", vehicle.mavlink_url)
