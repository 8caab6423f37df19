"""Losses on a link by sequence numbers: overtaken and repeated messages, outages, and senders that begin anew."""

from __future__ import annotations

from collections.abc import Iterable

from gcs_cli.vehicle.link_counts import LinkCounter, LinkCounts


def after(sequences: Iterable[int]) -> LinkCounts:
    """Return the counts after these messages, 100 a second."""
    counter = LinkCounter(LinkCounts())
    for index, sequence in enumerate(sequences):
        counter.count(sequence % 256, 0.01 * index)
    return counter.counts


def test_messages_that_others_overtook_are_not_lost() -> None:
    assert after([0, 1, 4, 5, 2, 3, 6]).lost == 0


def test_a_real_loss_stays_lost_beside_overtaken_and_repeated_messages() -> None:
    assert after([0, 1, 4, 4, 3, 3, 5]).lost == 1
    assert after([0, 1, 3, 5, 4, 5, 4, 6]).lost == 1


def test_a_link_that_repeats_each_message_late_hides_no_loss() -> None:
    """Two routes to the same client, and every tenth message lost on both."""
    sent = [sequence for sequence in range(1000) if sequence % 10]
    twice = [each for new, old in zip(sent[1:], sent, strict=False) for each in (new, old)]
    assert after(twice).lost == 99


def test_an_outage_of_nearly_a_whole_turn_takes_no_loss_back() -> None:
    sequences = [sequence for sequence in range(100) if sequence % 10 != 5]
    assert after([*sequences, *range(340, 360)]).lost == 10


def test_a_sender_that_begins_anew_is_followed() -> None:
    link = after([*range(5, 26), *range(20)])
    assert (link.lost, link.last_sequence) == (0, 19)
    assert after([*range(26), *range(20), 22]).lost == 2
