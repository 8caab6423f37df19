"""A flight's log comes back over the link as it was written, while the vehicle flies on."""

from __future__ import annotations

import io
import random

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.files import FileTree
from flightstack.mavlink.link import Address, Link
from flightstack.services.files.ftp_server import FtpServer
from flightstack.services.logs.log_server import LogServer
from flightstack.services.logs.log_store import FlatLogs
from flightstack.services.routing.peer import PeerAddress
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.clients.log_client import LogClient, LogDone
from tests.protocol.file_harness import GCS, LOSSY, VEHICLE, Ether, MemoryLogs, Station
from tests.support.world import World


@pytest.fixture(scope="module")
def flight_log() -> bytes:
    world = World()
    assert world.takeoff(3.0) == 0
    world.arm()
    world.run(3.0)
    assert world.disarm(force=True) == 0
    assert len(world.log) > 100_000
    return world.log


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
    other, link = PeerAddress(GROUND, "second", 1), Link(250, 190)
    client = FtpClient(Address(world.config.system_id, 1), Address(250, 190))
    client.start_download("@PARAM/param.pck")
    chance = random.Random(1)
    for _ in range(2000):
        world.held_s += 0.01
        now_s = world.link_now_s()
        for message in client.poll(now_s):
            if chance.random() > 0.3:
                world.stack.ground.receive(other, link.encode(message), now_s)
        for address, data in list(world.stack.ground.poll(now_s)):
            if address == other and chance.random() > 0.3:
                for message in link.decode(data):
                    client.receive(message, now_s)
        if client.result is not None:
            break
    assert isinstance(client.result, FtpDone), client.result
    assert client.result.content[:2] == b"\x1b\x67"
