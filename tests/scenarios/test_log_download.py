"""A flight's log comes back over the link as it was written, while the vehicle flies on."""

from __future__ import annotations

import io

import numpy as np
import pytest
from pyulog import ULog

from flightstack.mavlink.files import FileTree
from flightstack.services.files.ftp_server import FtpServer
from flightstack.services.logs.log_server import LogServer
from flightstack.services.logs.log_store import FlatLogs
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.clients.log_client import LogClient, LogDone
from tests.protocol.file_harness import GCS, LOSSY, VEHICLE, Ether, MemoryLogs, Station
from tests.support.truth import World


@pytest.fixture(scope="module")
def flight_log() -> bytes:
    world = World()
    world.takeoff(3.0)
    world.arm()
    world.run_for(3.0)
    world.disarm(force=True)
    content = world.flight().log.content
    assert len(content) > 100_000
    return content


def test_battery_is_logged_twice_a_second(flight_log: bytes) -> None:
    battery = ULog(io.BytesIO(flight_log)).get_dataset("battery_status").data
    assert set(np.diff(battery["timestamp"])) == {500_000}
    assert len(battery["timestamp"]) >= 6  # 3 s
    assert np.all(
        (battery["voltage_v"] > 10.0) & (battery["current_a"] > 0.0) & (battery["remaining"] <= 1.0)
    )


def test_over_mavlink_ftp_and_a_link_that_loses_a_third(flight_log: bytes) -> None:
    client = FtpClient(VEHICLE, GCS)
    client.start_download("@MAV_LOG/flight.ulg")
    server = FtpServer(VEHICLE, FileTree({}, {"@MAV_LOG": FlatLogs(MemoryLogs({"flight.ulg": flight_log}))}))
    Ether(server, Station(client, LOSSY, 1)).run(lambda: client.result is not None)
    assert client.result == FtpDone(flight_log)


def test_over_the_log_protocol_and_a_link_that_loses_a_third(flight_log: bytes) -> None:
    client = LogClient(VEHICLE)
    server = LogServer(
        VEHICLE, MemoryLogs({"flight.ulg": flight_log}), lambda: True, lambda level, text: None
    )
    ether = Ether(server, Station(client, LOSSY, 1))
    client.start_list()
    ether.run(lambda: client.result is not None)
    assert isinstance(client.result, LogDone)
    (entry,) = client.result.entries
    client.start_download(entry)
    ether.run(lambda: client.result is not None)
    assert client.result == LogDone(content=flight_log)


def test_the_vehicle_shows_its_parameters_as_a_file_to_a_second_ground_station() -> None:
    world = World()
    second = world.add_client("second")
    second.link.loss(0.3)
    world.run_until(lambda _: second.session.view.identity, 10.0)
    client = FtpClient(VEHICLE, second.session.own)
    client.start_download("@PARAM/param.pck")
    second.session.use(client)
    world.run_until(lambda _: client.result, 20.0)
    assert isinstance(client.result, FtpDone), client.result
    assert client.result.content[:2] == b"\x1b\x67"
