"""The links in memory: the plain one, and the bad one that a seed repeats."""

from __future__ import annotations

import itertools

from flightstack.transports.memory import Conditions, LossyLink, memory_link


def datagrams(count: int) -> list[bytes]:
    return [index.to_bytes(2, "big") for index in range(count)]


def test_a_plain_link_carries_all_in_order_both_ways() -> None:
    one, two = memory_link()
    for data in datagrams(5):
        one.send(data)
        two.send(data[::-1])
    assert two.receive() == datagrams(5)
    assert one.receive() == [data[::-1] for data in datagrams(5)]
    assert one.receive() == two.receive() == []


def test_a_lossless_link_is_a_plain_one() -> None:
    link = LossyLink()
    for data in datagrams(5):
        link.one.send(data, 1.0)
    assert link.next_arrival() == 1.0
    assert link.one.receive(1.0) == []
    assert link.two.receive(0.9) == []
    assert link.two.receive(1.0) == datagrams(5)
    assert link.next_arrival() is None


def run(seed: int) -> list[bytes]:
    link = LossyLink(Conditions(0.2, 0.1, 0.1, 0.05, 0.0, 1.0), seed)
    for index, data in enumerate(datagrams(1000)):
        link.one.send(data, 0.01 * index)
    return link.two.receive(1e9)


def test_lossy_link_meets_conditions_and_repeats_by_seed() -> None:
    arrived = run(7)
    assert run(7) == arrived
    assert run(8) != arrived
    # of 1000: measured 807 carried, 70 doubled, 73 overtaken (deviations 13, 9 and 9); seed 8: 785, 73, 75
    assert 750 < len(set(arrived)) < 850
    assert 40 < len(arrived) - len(set(arrived)) < 110
    overtaken = sum(late < early for early, late in itertools.pairwise(arrived))
    assert 40 < overtaken < 110


def test_delay_is_kept() -> None:
    link = LossyLink(Conditions(delay_s=0.5))
    link.two.send(b"x", 2.0)
    assert link.one.receive(2.49) == []
    assert link.one.receive(2.5) == [b"x"]
