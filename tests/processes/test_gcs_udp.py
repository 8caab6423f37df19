"""UDP sockets on the loopback."""

from __future__ import annotations

import pytest

from flightstack.transports.udp import PortBusyError, UdpSocket, resolve


def test_datagrams_go_both_ways_whole() -> None:
    with UdpSocket() as here, UdpSocket() as there:
        assert list(there.receive()) == []
        assert here.send(b"one", there.address)
        assert here.send(b"x" * 60_000, there.address)
        assert there.wait(10.0)
        first, second = there.receive()
        assert first == (b"one", here.address)
        assert len(second[0]) == 60_000
        assert there.send(b"back", first[1])
        assert here.wait(10.0)
        assert next(here.receive())[0] == b"back"


def test_waiting_ends_without_a_datagram() -> None:
    with UdpSocket() as socket:
        assert not socket.wait(0.0)
        assert not socket.wait(-1.0)


def test_a_busy_port_is_named() -> None:
    with (
        UdpSocket() as taken,
        pytest.raises(PortBusyError, match=rf"UDP port {taken.address[1]} .* is in use"),
    ):
        UdpSocket("127.0.0.1", taken.address[1])


@pytest.mark.parametrize("port", [-1, 65536])
def test_no_port(port: int) -> None:
    with pytest.raises(PortBusyError, match="cannot be used"):
        UdpSocket("127.0.0.1", port)


def test_a_foreign_address_cannot_be_bound() -> None:
    with pytest.raises(PortBusyError, match=r"192\.0\.2\.1 cannot be used"):
        UdpSocket("192.0.2.1", 14550)


def test_what_cannot_be_sent_is_counted() -> None:
    with UdpSocket() as socket:
        assert not socket.send(b"x", ("127.0.0.1", 0))
        assert not socket.send(b"x" * 100_000, socket.address)
        assert not socket.send(b"x", ("127.0.0.1", 70_000))
        assert socket.unsent == 3


def test_a_peer_that_is_gone_does_no_harm() -> None:
    with UdpSocket() as gone:
        address = gone.address
    with UdpSocket() as socket:
        for _ in range(3):
            assert socket.send(b"x", address)
            assert list(socket.receive()) == []


def test_names_are_resolved() -> None:
    assert resolve("127.0.0.1") == "127.0.0.1"
    with pytest.raises(OSError, match="not a host name"):
        resolve("a" * 300)
