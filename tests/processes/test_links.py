"""The links of a running flight stack: TCP, other addresses, several stations, and clients that misbehave."""

from __future__ import annotations

import random
import socket
from collections.abc import Callable, Iterator

import pytest

from flightstack.core.port_numbers import tcp_port
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.testing.instances import free_instance
from tests.support.process import BOUND_S, Process

Start = Callable[..., Process]
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


class Client:
    """A ground station on a plain socket."""

    def __init__(self, connected: socket.socket, system: int) -> None:
        connected.settimeout(BOUND_S)
        self.socket = connected
        self.link = Link(system, 190)

    def send(self, message) -> None:
        self.socket.sendall(self.link.encode(message))

    def until(self, wanted: Callable[[object], bool]):
        """Read until a message is as wanted; the socket's timeout ends a broken run."""
        while True:
            data = self.socket.recv(4096)
            assert data, "the connection was closed"
            for message in self.link.decode(data):
                if wanted(message):
                    return message

    def until_type(self, kind: str):
        return self.until(lambda message: message.get_type() == kind)


@pytest.fixture
def instance() -> int:
    return free_instance()


@pytest.fixture
def start(instance: int) -> Iterator[Start]:
    """Start a flight stack that waits for a simulator and serves its links meanwhile."""
    processes: list[Process] = []

    def begin(*options: str) -> Process:
        nowhere = ("--gcs-port", "9", "--api-port", "9") if "--gcs" not in options else ()
        quiet = ("--log", "none", "--params", "none", "--sim-timeout", str(10 * BOUND_S))
        processes.append(Process("flightstack", "--instance", str(instance), *quiet, *nowhere, *options))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()


def ready(stack: Process) -> str:
    stack.wait_for("flightstack: paper_quad")
    return stack.output


@pytest.fixture
def connect(instance: int) -> Iterator[Callable[..., Client]]:
    sockets: list[socket.socket] = []

    def make(system: int, tcp: bool = False) -> Client:
        if tcp:
            made = socket.create_connection(("127.0.0.1", tcp_port(instance)), timeout=BOUND_S)
        else:
            made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            made.connect(("127.0.0.1", 18570 + instance))
        sockets.append(made)
        return Client(made, system)

    yield make
    for made in sockets:
        made.close()


def test_a_tcp_client_that_says_nothing_hears_the_vehicle_and_is_answered(start, connect) -> None:
    ready(start())
    client = connect(255, tcp=True)
    beat = client.until_type("HEARTBEAT")
    client.send(mavlink.MAVLink_command_long_message(beat.get_srcSystem(), 1, 512, 0, 148.0, *[0.0] * 6))
    assert client.until_type("COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    client.send(mavlink.MAVLink_ping_message(7, 3, 0, 0))
    assert client.until_type("PING").target_system == 255


def test_messages_pass_from_udp_to_tcp_and_back(start, connect) -> None:
    ready(start())
    over_udp, over_tcp = connect(250), connect(251, tcp=True)
    over_tcp.send(HEARTBEAT)
    over_tcp.until_type("ATTITUDE")  # so it was heard
    over_udp.send(HEARTBEAT)
    over_tcp.until(lambda m: m.get_type() == "HEARTBEAT" and m.get_srcSystem() == 250)
    over_tcp.send(mavlink.MAVLink_ping_message(1, 2, 250, 190))
    assert over_udp.until(lambda m: m.get_type() == "PING").get_srcSystem() == 251


def test_a_client_that_never_reads_and_noise_keep_no_answer_from_others(
    start, connect, instance: int
) -> None:
    ready(start())
    lazy, station = connect(250, tcp=True), connect(255)
    lazy.send(HEARTBEAT)
    vehicle = instance + 1
    for message_id in (30, 31, 32, 33):  # as much as it goes
        lazy.send(mavlink.MAVLink_command_long_message(vehicle, 1, 511, 0, message_id, 1000.0, *[0.0] * 5))
    noise, chance = connect(9), random.Random(4)
    station.send(HEARTBEAT)
    for number in range(20):
        for _ in range(500):
            noise.socket.send(chance.randbytes(280))
        station.send(mavlink.MAVLink_ping_message(0, number, 0, 0))
        station.until(lambda m, number=number: m.get_type() == "PING" and m.seq == number)


def test_stations_named_with_gcs_are_all_addressed_unasked(start) -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as two,
    ):
        options = []
        for station in (one, two):
            station.bind(("127.0.0.1", 0))
            options += ["--gcs", f"localhost:{station.getsockname()[1]}"]
        start(*options, "--api-port", "9")
        for station in (one, two):
            Client(station, 255).until_type("HEARTBEAT")


def test_without_tcp_nobody_listens_there(start, instance: int) -> None:
    assert "no TCP" in ready(start("--tcp-port", "0"))
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", tcp_port(instance))) != 0


def test_listening_to_more_than_this_machine_is_said(start) -> None:
    stack = start("--listen", "0.0.0.0")
    stack.wait_for("warning: listening on 0.0.0.0 without signing")


def test_a_busy_tcp_port_is_named(start, instance: int) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        stack = start("--tcp-port", str(port))
        assert stack.end() == 2
        assert f"TCP port {port} on 127.0.0.1 is in use" in stack.output


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--gcs", "14550"], "must be HOST:PORT"),
        (["--gcs", "127.0.0.1:http"], "must be HOST:PORT"),
        (["--gcs", "127.0.0.1:70000"], "is outside 1 to 65535"),
        (["--gcs", "192.0.2.1:14550"], "add --listen 0.0.0.0"),
        (["--listen", "no.such.host.invalid"], "is not a host"),
        (["--tcp-port", "70000"], "is outside 1 to 65535"),
    ],
)
def test_bad_ports_are_one_sentence_and_exit_2(start, options: list[str], sentence: str) -> None:
    stack = start(*options)
    assert stack.end() == 2
    assert sentence in stack.output
    assert len(stack.lines) == 1
