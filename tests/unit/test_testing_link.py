"""Links in simulated time: the statistics of each fault, order, and repeatability. The seeds are fixed."""

from __future__ import annotations

import math
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.testing.link import Channel, Link

COUNT = 20_000
DATAGRAMS = [number.to_bytes(4, "big") for number in range(COUNT)]


def sent(seed: int = 3, **conditions: float) -> Channel:
    """Return a channel with these conditions, through which all datagrams were sent, one each ms."""
    channel = Channel(seed)
    channel.set(**conditions)
    for number, data in enumerate(DATAGRAMS):
        channel.send(data, number * 1e-3)
    return channel


def is_share(found: int, share: float) -> bool:
    """Return True within four standard deviations; the seeds in use are within two."""
    return abs(found - COUNT * share) <= 4.0 * math.sqrt(COUNT * share * (1.0 - share))


@pytest.mark.parametrize("is_cut", [False, True])
def test_instant_channel_passes_what_it_would_deliver_at_once(is_cut: bool) -> None:
    queued, passing = Channel(3), Channel(3)
    for channel in (queued, passing):
        channel.set(is_cut=is_cut)
    for data in DATAGRAMS[:5]:
        queued.send(data, 1.0)
    assert passing.is_instant
    assert passing.passed(DATAGRAMS[:5]) == queued.receive(1.0)
    assert (passing.sent, passing.lost) == (queued.sent, queued.lost) == (5, 5 * is_cut)
    assert passing.next_arrival_s == queued.next_arrival_s == math.inf


@pytest.mark.parametrize("share", [0.01, 0.3, 0.9])
def test_loss_drops_its_share_and_keeps_the_order(share: float) -> None:
    channel = sent(loss=share)
    arrived = channel.receive(math.inf)
    assert arrived == sorted(arrived)
    assert is_share(channel.lost, share)
    assert channel.sent == channel.lost + len(arrived) == COUNT


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_duplication_delivers_its_share_twice(share: float) -> None:
    times = Counter(Counter(sent(duplication=share).receive(math.inf)).values())
    assert set(times) == {1, 2}
    assert is_share(times[2], share)


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_garbage_changes_its_share(share: float) -> None:
    arrived = sent(garbage=share).receive(math.inf)
    changed = [data for number, data in enumerate(arrived) if data != DATAGRAMS[number]]
    assert is_share(len(changed), share)
    assert all(5 <= len(data) <= 43 for data in changed)  # 1 to 39 random bytes before it


def test_reordering_holds_its_share_back_by_up_to_100_ms() -> None:
    channel, late = sent(reordering=0.25), 0
    seen: list[bytes] = []
    for ms in range(COUNT + 101):
        for data in channel.receive(ms * 1e-3 + 1e-9):
            delay_ms = ms - int.from_bytes(data, "big")
            assert 0 <= delay_ms <= 101
            late += delay_ms > 0
            seen.append(data)
    assert sorted(seen) == DATAGRAMS
    assert seen != DATAGRAMS
    assert is_share(late, 0.25)


def test_delay_moves_every_arrival_by_the_same_time() -> None:
    channel = Channel(1)
    channel.set(delay_s=0.5)
    channel.send(b"a", 1.0)
    channel.send(b"b", 1.2)
    assert channel.receive(1.499) == []
    assert channel.receive(1.5) == [b"a"]
    assert channel.receive(1.7) == [b"b"]


def test_datagrams_of_one_instant_arrive_in_order() -> None:
    channel = Channel(1)
    for data in (b"c", b"a", b"b"):
        channel.send(data, 1.0)
    assert channel.receive(1.0) == [b"c", b"a", b"b"]


def test_cut_drops_what_is_under_way_and_restore_ends_all_faults() -> None:
    channel = Channel(1)
    channel.set(delay_s=1.0, loss=0.5)
    channel.conditions = channel.conditions._replace(loss=0.0)
    channel.send(b"under way", 0.0)
    channel.cut()
    channel.send(b"cut", 0.1)
    assert (channel.receive(5.0), channel.sent, channel.lost) == ([], 2, 2)
    channel.restore()
    channel.send(b"restored", 6.0)
    assert channel.receive(6.0) == [b"restored"]


@given(
    loss=st.floats(0, 1), duplication=st.floats(0, 1), reordering=st.floats(0, 1), garbage=st.floats(0, 1),
    delay_s=st.floats(0, 5), seed=st.integers(0, 1000),
)  # fmt: skip
def test_equal_seeds_give_equal_faults(seed: int, **conditions: float) -> None:
    channels = Channel(seed), Channel(seed)
    for channel in channels:
        channel.set(**conditions)
        for number, data in enumerate(DATAGRAMS[:50]):
            channel.send(data, number * 1e-3)
    assert channels[0].receive(math.inf) == channels[1].receive(math.inf)


def test_both_directions_have_faults_of_their_own() -> None:
    link = Link(seed=1)
    link.loss(0.5)
    for data in DATAGRAMS[:100]:
        link.to_vehicle.send(data, 0.0)
        link.from_vehicle.send(data, 0.0)
    assert link.to_vehicle.receive(0.0) != link.from_vehicle.receive(0.0)


@pytest.mark.parametrize("value", [-0.1, 1.1, math.nan, math.inf])
@pytest.mark.parametrize("name", ["loss", "duplication", "reordering", "garbage"])
def test_share_outside_0_to_1_is_an_error(name: str, value: float) -> None:
    link = Link(1)
    with pytest.raises(ValueError, match=f"{name} must be 0 to 1"):
        getattr(link, name)(value)
    assert link.to_vehicle.conditions == link.from_vehicle.conditions == Channel(1).conditions


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_delay_must_be_finite_and_not_negative(value: float) -> None:
    with pytest.raises(ValueError, match="delay_s must be 0 or more"):
        Link(1).delay_s(value)
