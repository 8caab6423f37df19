"""The TCP client of the lockstep link, and how its two ends come together on one processor."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator

import pytest

from flightstack.transports.cpu_affinity import AffinityFollower, AffinityLeader, allowed_cpus
from flightstack.transports.tcp import LinkClosedError, TcpClient

PROCESSORS = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
needs_two = pytest.mark.skipif(len(PROCESSORS) < 2, reason="this machine offers one processor only")


@pytest.fixture
def link() -> Iterator[tuple[TcpClient, socket.socket]]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        client = TcpClient.connect(*server.getsockname()[:2], 5.0, lambda: None)
        peer = server.accept()[0]
        with peer:
            yield client, peer
        client.close()


@pytest.fixture
def free_to_move() -> Iterator[None]:
    yield
    os.sched_setaffinity(0, PROCESSORS)


def test_data_is_received_both_ways(link: tuple[TcpClient, socket.socket]) -> None:
    client, peer = link
    peer.sendall(b"state")
    data = client.receive()
    assert data is not None
    assert bytes(data) == b"state"
    client.send(b"actuators")
    assert peer.recv(100) == b"actuators"


def test_a_silent_peer_is_none_and_not_an_error(link: tuple[TcpClient, socket.socket]) -> None:
    client, _ = link
    assert client.receive_now() is None
    assert client.receive() is None


def test_a_peer_that_has_gone_is_named(link: tuple[TcpClient, socket.socket]) -> None:
    client, peer = link
    peer.sendall(b"last words")
    peer.close()
    data = client.receive()
    assert data is not None
    assert bytes(data) == b"last words"
    with pytest.raises(LinkClosedError):
        client.receive()
    with pytest.raises(LinkClosedError):
        client.receive_now()


def test_a_simulator_that_does_not_come_ends_the_wait() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()[:2]
    times = iter([0.0, 0.0, 0.5, 0.5, 1.0])
    tries: list[int] = []
    with pytest.raises(TimeoutError):
        TcpClient.connect(*address, 1.0, lambda: tries.append(1), now_s=lambda: next(times))
    assert len(tries) == 1


@needs_two
def test_the_roamer_is_free_and_settled_in_turns(free_to_move: None) -> None:
    leader = AffinityLeader()
    free_for = leader.update()
    assert os.sched_getaffinity(0) == PROCESSORS
    settled_for = leader.update()
    assert len(os.sched_getaffinity(0)) == 1
    assert settled_for > 100 * free_for
    leader.update()
    assert os.sched_getaffinity(0) == PROCESSORS
    leader.update()
    leader.release()
    assert os.sched_getaffinity(0) == PROCESSORS


@needs_two
def test_the_follower_goes_where_the_peer_sends_from(
    free_to_move: None, link: tuple[TcpClient, socket.socket]
) -> None:
    client, peer = link
    follower = AffinityFollower(client.socket)
    for processor in sorted(PROCESSORS)[:2]:
        os.sched_setaffinity(0, {processor})
        peer.sendall(b"x")
        assert client.receive() is not None
        os.sched_setaffinity(0, PROCESSORS)
        follower.update()
        assert os.sched_getaffinity(0) == {processor}


@needs_two
def test_a_later_follower_and_a_later_leader_move_too(
    free_to_move: None, link: tuple[TcpClient, socket.socket]
) -> None:
    """A vehicle on sensors has one follower until it is ready, and another in flight; a simulator a leader a client."""
    client, peer = link
    for processor in sorted(PROCESSORS)[:2]:
        follower = AffinityFollower(client.socket)
        os.sched_setaffinity(0, {processor})
        peer.sendall(b"x")
        assert client.receive() is not None
        os.sched_setaffinity(0, {min(PROCESSORS)})  # as the follower before it left it
        follower.update()
        assert os.sched_getaffinity(0) == {processor}
    AffinityLeader().update()
    assert os.sched_getaffinity(0) == PROCESSORS


@pytest.fixture
def no_processors() -> Iterator[None]:
    allowed_cpus.cache_clear()
    yield
    allowed_cpus.cache_clear()


def test_a_system_without_such_calls_is_left_alone(
    no_processors: None, monkeypatch: pytest.MonkeyPatch, link: tuple[TcpClient, socket.socket]
) -> None:
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.delattr(os, "sched_setaffinity", raising=False)
    leader = AffinityLeader()
    assert leader.update() < leader.update()
    leader.release()
    AffinityFollower(link[0].socket).update()
