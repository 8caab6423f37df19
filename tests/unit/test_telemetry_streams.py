"""Rates of telemetry over both clocks, and intervals that a client sets."""

from __future__ import annotations

import math

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.services.telemetry.streams import API_RATES_HZ, GROUND_RATES_HZ, Streams

ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE


def count(streams: Streams, seconds: float, vehicle_rate: float, step_s: float = 0.0005) -> dict[int, int]:
    """Poll at the link's steps while vehicle time runs ``vehicle_rate`` times as fast; count messages."""
    counts: dict[int, int] = {}
    for tick in range(round(seconds / step_s)):
        now_s = tick * step_s
        for message_id in streams.due(round(now_s * vehicle_rate * 1e6) * 1e-6, 100.0 + now_s):
            counts[message_id] = counts.get(message_id, 0) + 1
    return counts


@pytest.mark.parametrize("rates", [GROUND_RATES_HZ, API_RATES_HZ], ids=["ground", "api"])
def test_rates_are_kept_when_both_clocks_are_one(rates: dict[int, float]) -> None:
    counts = count(Streams(rates), 10.0, 1.0)
    for message_id, rate in rates.items():
        assert counts[message_id] == pytest.approx(rate * 10.0, abs=1), message_id


def test_at_fast_vehicle_time_the_links_clock_limits() -> None:
    counts = count(Streams(GROUND_RATES_HZ), 4.0, 50.0)
    for message_id, rate in GROUND_RATES_HZ.items():
        assert counts[message_id] == pytest.approx(rate * 4.0, abs=2), message_id


def test_at_slow_vehicle_time_the_vehicles_clock_limits() -> None:
    counts = count(Streams(GROUND_RATES_HZ), 10.0, 0.2)
    for message_id, rate in GROUND_RATES_HZ.items():
        assert counts[message_id] == pytest.approx(rate * 2.0, abs=1), message_id


def test_while_vehicle_time_stands_each_is_sent_once() -> None:
    assert count(Streams(GROUND_RATES_HZ), 10.0, 0.0) == dict.fromkeys(GROUND_RATES_HZ, 1)


@pytest.mark.parametrize("late_s", [0.02, 0.04, 0.45])
def test_a_vehicle_that_catches_up_sends_what_was_due_in_each_tick(late_s: float) -> None:
    """A loaded machine wakes it every ``late_s`` only; it then runs the ticks since at once."""
    streams, tick_s = Streams({ATTITUDE: 100.0}), 0.01
    times_us = [
        tick * 10_000
        for tick in range(1000)
        if streams.due(tick * 10_000 * 1e-6, 100.0 + math.ceil(tick * tick_s / late_s) * late_s)
    ]
    assert len(times_us) == pytest.approx(1000, abs=1)


def test_after_a_gap_nothing_is_made_up_for() -> None:
    streams = Streams({ATTITUDE: 10.0})
    count(streams, 1.0, 1.0)
    late = [streams.due(at * 1e-6, at * 1e-6 + 100.0) for at in (60_000_000, 60_010_000, 60_110_000)]
    assert [len(sent) for sent in late] == [1, 0, 1]


def test_intervals_can_be_set_stopped_and_reset() -> None:
    streams = Streams(GROUND_RATES_HZ)
    quaternion = mavlink.MAVLINK_MSG_ID_ODOMETRY  # one that this link does not send by itself
    assert [streams.interval_us(number) for number in (ATTITUDE, quaternion, 9999)] == [20_000, -1, 0]
    assert streams.set_interval(ATTITUDE, 100_000)
    assert streams.set_interval(quaternion, 50_000)
    assert streams.set_interval(mavlink.MAVLINK_MSG_ID_VFR_HUD, -1)
    counts = count(streams, 10.0, 1.0)
    assert counts[ATTITUDE] == pytest.approx(100, abs=1)
    assert counts[quaternion] == pytest.approx(200, abs=1)
    assert mavlink.MAVLINK_MSG_ID_VFR_HUD not in counts
    assert streams.set_interval(ATTITUDE, 0)
    assert streams.set_interval(quaternion, 0)  # its default is not to be sent
    assert (streams.interval_us(ATTITUDE), streams.interval_us(quaternion)) == (20_000, -1)


@pytest.mark.parametrize("interval", [math.nan, math.inf, -2.0, 2.0**31, 1e30])
def test_intervals_that_cannot_be(interval: float) -> None:
    streams = Streams(GROUND_RATES_HZ)
    assert not streams.set_interval(ATTITUDE, interval)
    assert not streams.set_interval(9999, 1e5)
    assert streams.interval_us(ATTITUDE) == 20_000


def test_a_change_of_one_interval_leaves_the_others_due_as_before() -> None:
    """Messages that are due together are looked at as one, until one of them is changed."""
    changed = mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET
    one, other = Streams(GROUND_RATES_HZ), Streams(GROUND_RATES_HZ)
    alone = {number: Streams({number: rate_hz}) for number, rate_hz in GROUND_RATES_HZ.items()}
    for tick in range(2000):
        now_s = tick * 0.004
        if tick == 701:
            assert one.set_interval(changed, 30_000)
            assert alone[changed].set_interval(changed, 30_000)
        if tick == 1301:
            assert one.set_interval(changed, 0)
            assert alone[changed].set_interval(changed, 0)
        sent = one.due(now_s, now_s)
        assert sent == [number for number, stream in alone.items() if stream.due(now_s, now_s)]
        expected = [number for number in other.due(now_s, now_s) if number != changed]
        assert [number for number in sent if number != changed] == expected
