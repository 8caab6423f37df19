"""The TCP server on real sockets: nothing waits, nothing grows, no frame is cut."""

from __future__ import annotations

import math
import select
import socket
import struct
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import FrameReader
from flightstack.mavlink.link import SILENT_AFTER_S, Link
from flightstack.transports.tcp_server import MAX_CLIENTS, MAX_UNSENT, STALLED_S, TcpServer
from flightstack.transports.udp import Address, PortBusyError

WAIT_MS = 10_000
FRAME = Link(1, 1).encode(mavlink.MAVLink_statustext_message(6, b"x" * 50, 0, 0))


class Server:
    """A server on any free port, with a clock that the test moves."""

    def __init__(self) -> None:
        self.poller = select.poll()
        self.now_s = 0.0
        self.tcp = TcpServer("127.0.0.1", 0, self.poller, lambda: self.now_s)
        self.clients: list[socket.socket] = []
        self.heard_s: dict[Address, float] = {}

    def connect(self) -> socket.socket:
        client = socket.create_connection(self.tcp.address, timeout=10.0)
        self.clients.append(client)
        return client

    def step(self, wait_ms: int = 0) -> list[tuple[Address, bytes]]:
        return list(self.tcp.receive([fileno for fileno, _ in self.poller.poll(wait_ms)], self.heard))

    def heard(self, address: Address) -> float:
        return self.heard_s.get(address, -math.inf)

    def until(self, done: Callable[[], bool]) -> list[tuple[Address, bytes]]:
        """Step whenever a socket is ready, until ``done``; a socket that never becomes ready fails the test."""
        received = []
        while not done():
            ready = self.poller.poll(WAIT_MS)
            assert ready, "nothing arrived"
            received += self.tcp.receive([fileno for fileno, _ in ready], self.heard)
        return received

    def joined(self) -> tuple[socket.socket, Address]:
        """Connect a client, and return it with its address."""
        count = len(self.tcp)
        client = self.connect()
        self.until(lambda: len(self.tcp) > count)
        return client, client.getsockname()


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    yield made
    made.tcp.close()
    for client in made.clients:
        client.close()


def test_clients_are_distinguished_and_answered(server: Server) -> None:
    (one, first), (two, second) = server.joined(), server.joined()
    assert server.tcp.opened() == [first, second]
    one.sendall(b"of one")
    two.sendall(b"of two")
    got: dict[Address, bytes] = {}
    while len(got) < 2:
        got.update(server.step(WAIT_MS))
    assert got == {first: b"of one", second: b"of two"}
    server.tcp.send(second, b"to two")
    server.tcp.send(first, b"to one")
    server.tcp.flush()
    assert (one.recv(99), two.recv(99)) == (b"to one", b"to two")


def test_a_client_that_never_reads_neither_blocks_nor_fills_memory_nor_gets_half_a_frame(
    server: Server,
) -> None:
    client, address = server.joined()
    count = 0
    while server.tcp.dropped < 1000:  # fills the kernel's buffers and ours
        server.tcp.send(address, FRAME)
        server.tcp.flush()
        count += 1
        assert server.tcp.unsent(address) <= MAX_UNSENT
    kept = count - server.tcp.dropped
    client.settimeout(10.0)
    reader, frames = FrameReader(), 0
    while frames < kept:  # it wakes up: everything that was kept comes, whole
        frames += len(reader.feed(client.recv(65536)))
        server.tcp.flush()
    assert frames == kept
    assert reader.faults == 0
    assert not reader.has_partial


def test_a_client_that_takes_nothing_for_long_is_closed(server: Server) -> None:
    _, lazy = server.joined()
    reading, busy = server.joined()
    while not server.tcp.dropped:
        server.tcp.send(lazy, FRAME)
        server.tcp.flush()
    server.tcp.send(busy, FRAME)
    moved_s, unsent = server.now_s, server.tcp.unsent(lazy)
    while not (closed := server.tcp.closed()):
        if server.tcp.unsent(lazy) < unsent:  # the kernel may move some of it to the client's side later
            moved_s, unsent = server.now_s, server.tcp.unsent(lazy)
        assert server.now_s - moved_s <= STALLED_S
        server.now_s += STALLED_S / 4
        server.tcp.flush()
    assert closed == [lazy]
    assert server.now_s - moved_s > STALLED_S
    assert not server.tcp.send(lazy, FRAME)
    assert reading.recv(999) == FRAME


def test_a_client_that_reads_too_slowly_is_congested_until_it_catches_up(server: Server) -> None:
    client, address = server.joined()
    client.settimeout(10.0)
    while not server.tcp.congested():
        server.tcp.send(address, FRAME)
        server.tcp.flush()
    assert server.tcp.congested() == [address]
    assert server.tcp.dropped == 0
    while server.tcp.congested():
        client.recv(65536)
        server.tcp.flush()


def test_an_idle_client_is_not_taken_for_a_stalled_one(server: Server) -> None:
    client, address = server.joined()
    server.tcp.flush()
    server.now_s = 1000.0
    server.tcp.flush()
    server.tcp.send(address, FRAME)
    server.tcp.flush()
    assert server.tcp.closed() == []
    assert client.recv(999) == FRAME


@pytest.mark.parametrize("abruptly", [False, True])
def test_an_end_is_reported_once_also_with_a_reset(server: Server, abruptly: bool) -> None:
    client, address = server.joined()
    if abruptly:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()
    server.until(lambda: len(server.tcp) == 0)
    assert server.tcp.closed() == [address]
    assert server.tcp.closed() == []
    assert not server.tcp.send(address, FRAME)


def test_half_closed_client_is_disconnected(server: Server) -> None:
    client, address = server.joined()
    client.sendall(b"last words")
    client.shutdown(socket.SHUT_WR)
    received = server.until(lambda: len(server.tcp) == 0)
    assert received == [(address, b"last words")]
    assert server.tcp.closed() == [address]


def test_a_thousand_connections_leave_nothing_behind(server: Server) -> None:
    for number in range(1000):
        client = server.connect()
        if number % 3 == 0:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        elif number % 3 == 1:
            client.sendall(FRAME)
        client.close()
        server.clients.clear()
        server.step()
    count = [0, 0]

    def all_ended() -> bool:
        count[0] += len(server.tcp.opened())
        count[1] += len(server.tcp.closed())
        return count[0] == count[1] == 1000

    # a connection that was reset before it was accepted may never have been there
    while not all_ended() and server.poller.poll(1000):
        server.step()
    assert count[0] == count[1] >= 660
    assert len(server.tcp) == 0
    watched: list[int] = []
    server.tcp.register(SimpleNamespace(register=lambda fileno, _: watched.append(fileno)))  # type: ignore[arg-type]
    assert len(watched) == 1  # the port itself


def test_a_client_that_never_spoke_mavlink_gives_way_to_a_new_one(server: Server) -> None:
    """Its octets do not count: the hub judges what is valid."""
    speaker, first = server.joined()
    server.heard_s[first] = server.now_s
    others = []
    for _ in range(MAX_CLIENTS - 1):
        client, address = server.joined()
        client.sendall(b"x")
        others.append(address)
    latest = server.connect()
    server.until(lambda: latest.getsockname() in server.tcp.addresses())
    assert server.tcp.closed() == [others[0]]
    assert len(server.tcp) == MAX_CLIENTS
    speaker.sendall(FRAME)
    assert (first, FRAME) in server.step(WAIT_MS)


def test_the_client_silent_for_longest_gives_way_to_a_new_one(server: Server) -> None:
    addresses = [server.joined()[1] for _ in range(MAX_CLIENTS)]
    server.now_s = 2.0 * SILENT_AFTER_S
    server.heard_s = dict.fromkeys(addresses, server.now_s)
    server.heard_s[addresses[7]] = 0.1
    server.heard_s[addresses[9]] = 0.2
    latest = server.connect()
    server.until(lambda: latest.getsockname() in server.tcp.addresses())
    assert server.tcp.closed() == [addresses[7]]


def test_a_live_client_never_gives_way_to_a_new_one(server: Server) -> None:
    addresses = [server.joined()[1] for _ in range(MAX_CLIENTS)]
    server.now_s = SILENT_AFTER_S
    server.heard_s = dict.fromkeys(addresses, 0.0)
    late = server.connect()
    server.step(WAIT_MS)
    assert late.recv(10) == b""
    assert len(server.tcp) == MAX_CLIENTS
    assert server.tcp.closed() == []


def test_a_hundred_idle_connections_do_not_lock_out_a_client(server: Server) -> None:
    for _ in range(100):
        server.connect().sendall(b"\xfd")
        server.step(WAIT_MS)
    client = server.connect()
    server.until(lambda: client.getsockname() in server.tcp.addresses())
    assert len(server.tcp) == MAX_CLIENTS


def test_unwanted_data_stays_in_the_kernel(server: Server) -> None:
    client, address = server.joined()
    client.sendall(FRAME)
    ready = [fileno for fileno, _ in server.poller.poll(WAIT_MS)]
    assert list(server.tcp.receive(ready, wants=lambda _: False)) == []
    assert list(server.tcp.receive(ready)) == [(address, FRAME)]


def test_a_second_poller_sees_the_same_and_a_busy_port_is_named(server: Server) -> None:
    client, _ = server.joined()
    second = select.poll()
    server.tcp.register(second)
    client.sendall(FRAME)
    assert second.poll(WAIT_MS)
    with pytest.raises(PortBusyError, match=f"TCP port {server.tcp.address[1]} on 127.0.0.1 is in use"):
        TcpServer("127.0.0.1", server.tcp.address[1], select.poll())
