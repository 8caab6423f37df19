"""Turns among peers."""

from __future__ import annotations

from flightstack.transports.vehicle_ports import MAX_QUEUED_BYTES, MAX_UNKNOWN_PEERS, FairQueue


def nobody(_: str) -> bool:
    return False


def test_a_peers_own_data_stays_in_order() -> None:
    queue: FairQueue[str] = FairQueue()
    for number in range(10):
        queue.push("a", bytes([number]) * 20, nobody)
    assert [data[0] for _, data in queue.take(1000)] == list(range(10))
    assert len(queue) == 0


def test_flooding_peer_delays_others_by_one_piece() -> None:
    queue: FairQueue[str] = FairQueue()
    for _ in range(1000):
        queue.push("flood", bytes(60), nobody)
    queue.push("station", b"hello", nobody)
    assert [key for key, _ in queue.take(180)] == ["flood", "station", "flood", "flood"]


def test_a_turn_ends_by_octets_and_never_without_a_piece() -> None:
    queue: FairQueue[str] = FairQueue()
    for key in "abc":
        queue.push(key, bytes(2000), nobody)
    assert [key for key, _ in queue.take(1)] == ["a"]
    assert [key for key, _ in queue.take(2001)] == ["b", "c"]
    assert list(queue.take(1000)) == []


def test_empty_pieces_do_not_come_for_free() -> None:
    queue: FairQueue[str] = FairQueue()
    for _ in range(10_000):
        queue.push("empty", b"", nobody)
    assert queue.dropped > 4000
    assert len(list(queue.take(4096))) < 400


def test_queue_is_bounded_per_peer_and_for_unknown_peers() -> None:
    queue: FairQueue[str] = FairQueue()
    for _ in range(100):
        queue.push("flood", bytes(2048), nobody)
    assert queue.dropped == 100 - MAX_QUEUED_BYTES // 2048
    for number in range(1000):
        queue.push(f"stranger {number}", b"hello", nobody)
    assert len(queue) == MAX_UNKNOWN_PEERS
    assert not queue.push("one more", b"hello", nobody)
    assert queue.push("station", b"hello", lambda key: key == "station")


def test_dropped_peer_has_no_queued_data() -> None:
    queue: FairQueue[str] = FairQueue()
    queue.push("a", b"hello", nobody)
    assert "a" in queue
    queue.drop("a")
    queue.drop("never")
    assert list(queue.take(1000)) == []
