"""Several transports at once, of which the one with the vehicle is kept."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pytest

from flightstack.core.port_numbers import INSTANCES, vehicle_ground_port
from flightstack.transports.udp import Address, UdpSocket
from gcs_cli.errors import CliError
from gcs_cli.link import opening
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import LOOPBACK, VehicleEndpoint, parse_endpoint
from gcs_cli.link.lines import Interest, Line
from gcs_cli.link.opening import LATER_S, SeveralLines

HERE, THERE = ("10.0.0.1", 1), ("10.0.0.2", 2)
ONE, TWO = parse_endpoint("udp:14550"), parse_endpoint("udpout:10.0.0.2:2")


class MemoryLine:
    """A transport in memory."""

    def __init__(self, peer: Address, peers: Sequence[Address] = (), problem: str = "") -> None:
        self._peer = peer
        self.peers = peers
        self.problem = problem
        self.arriving: list[bytes] = []
        self.sent: list[bytes] = []
        self.is_closed = False

    def interests(self) -> Iterable[Interest]:
        return ()

    def due_s(self) -> float | None:
        return None

    def receive(self, now_s: float) -> Iterable[tuple[bytes, Address]]:
        arriving, self.arriving = self.arriving, []
        return [(data, self._peer) for data in arriving]

    def send(self, data: bytes, peer: Address) -> None:
        self.sent.append(data)

    def closed_peers(self) -> Iterable[Address]:
        return ()

    def close(self) -> None:
        self.is_closed = True


def test_data_goes_to_the_transport_of_its_peer() -> None:
    one, two = MemoryLine(HERE), MemoryLine(THERE, [THERE])
    several = SeveralLines({ONE: one, TWO: two})
    assert several.peers == [THERE]
    several.send(b"hello", THERE)
    one.arriving.append(b"beat")
    assert list(several.receive(0.0)) == [(b"beat", HERE)]
    several.send(b"back", HERE)
    assert (one.sent, two.sent) == ([b"back"], [b"hello"])


def test_transport_with_the_vehicle_is_kept() -> None:
    one, two = MemoryLine(HERE), MemoryLine(THERE, [THERE])
    several = SeveralLines({ONE: one, TWO: two})
    two.arriving.append(b"beat")
    list(several.receive(0.0))
    assert several.keep(THERE) == TWO
    assert (one.is_closed, two.is_closed) == (True, False)


def test_problem_of_one_transport_is_none_of_all() -> None:
    one, two = MemoryLine(HERE), MemoryLine(THERE, problem="connection refused")
    assert SeveralLines({ONE: one, TWO: two}).problem == ""
    assert SeveralLines({TWO: two}).problem == "connection refused"


def test_later_transports_are_opened_once_nothing_arrives(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[VehicleEndpoint] = []
    broken = MemoryLine(HERE, problem="connection refused")
    lines: dict[VehicleEndpoint, Line] = {TWO: MemoryLine(THERE, [THERE]), ONE: broken}

    def open_line(endpoint: VehicleEndpoint) -> Line:
        opened.append(endpoint)
        return lines[endpoint]

    monkeypatch.setattr(opening, "open_line", open_line)
    monkeypatch.setattr(opening.time, "monotonic", lambda: 100.0)
    several = SeveralLines({}, later=[TWO, ONE])
    assert several.due_s() == 100.0 + LATER_S
    list(several.receive(100.0 + LATER_S - 0.01))
    assert opened == []
    list(several.receive(100.0 + LATER_S))
    assert (opened, several.peers, broken.is_closed) == ([TWO, ONE], [THERE], True)
    assert several.due_s() is None


def test_used_instances_are_those_whose_port_is_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    last = INSTANCES - 1
    with UdpSocket(LOOPBACK, vehicle_ground_port(last)):
        monkeypatch.setattr(opening, "UdpSocket", None)  # a port that is bound in order to look is in use
        assert last in opening.used_instances()
    assert last not in opening.used_instances()


def test_ports_in_use_are_those_of_the_table_of_the_system() -> None:
    table = (
        "   sl  local_address rem_address   st tx_queue\n"
        "  134: 0100007F:4786 00000000:0000 07 00000000:00000000\n"
        " 9229: 00000000:38D6 00000000:0000 07 00000000:00000000\n"
        "  broken\n"
    )
    assert opening.ports_in_use(table) == {18310, 14550}
    assert opening.ports_in_use("") == set()


@pytest.mark.parametrize(
    ("used", "advice"),
    [
        ([], "start one with `gcs sim`, or give its address with --connect"),
        ([3], "a vehicle of instance 3 seems to run on this machine: give --instance 3"),
        ([0, 7], "vehicles of instances 0, 7 seem to run on this machine: choose one with --instance N"),
        (
            list(range(1, 20)),
            "vehicles of instances 1, 2, 3, 4, 5, 6, 7, 8 … seem to run on this machine: "
            "choose one with --instance N",
        ),
    ],
    ids=["none", "one", "two", "many"],
)
def test_missing_vehicle_is_reported_with_the_instances_in_use(
    used: list[int], advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opening, "used_instances", lambda: used)
    connection = Connection(parse_endpoint("udp:127.0.0.1:1"), line=MemoryLine(HERE))
    with connection, pytest.raises(CliError) as raised:
        connection.wait_for_vehicle(0.0)
    assert str(raised.value) == f"no vehicle sent to UDP 127.0.0.1:1 within 0 s: {advice}"
