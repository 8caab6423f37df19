"""Rates, the deadline scheduler on an injected clock, and the figures of a loop's timing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.errors import ConfigError
from flightstack.process.clock import (
    NO_DURATIONS,
    WATCHED_NS,
    WINDOW,
    DeadlineScheduler,
    Durations,
    LoopTiming,
    Rates,
    nearest_outer_hz,
    rates,
)

PERIOD = 2_000_000


@pytest.mark.parametrize(
    ("inner", "outer", "expected"),
    [
        (500.0, 100.0, (5, 2000)),
        (1000.0, 250.0, (4, 1000)),
        (400.0, 400.0, (1, 2500)),
        (10.0, 0.5, (20, 100_000)),
        (20_000.0, 100.0, (200, 50)),
        (62.5, 12.5, (5, 16_000)),
    ],
)
def test_rates_that_divide(inner: float, outer: float, expected: tuple[int, int]) -> None:
    assert rates(inner, outer) == Rates(inner, outer, *expected)


@pytest.mark.parametrize(
    ("inner", "outer", "sentence"),
    [
        (9.0, 9.0, "--inner-hz: 9 is outside 10 to 20000"),
        (20_001.0, 100.0, "--inner-hz: 20001 is outside 10 to 20000"),
        (math.nan, 100.0, "--inner-hz: nan is outside 10 to 20000"),
        (math.inf, 100.0, "--inner-hz: inf is outside 10 to 20000"),
        (-500.0, 100.0, "--inner-hz: -500 is outside 10 to 20000"),
        (300.0, 100.0, "--inner-hz: 300 does not make a whole number of microseconds per tick"),
        (500.0, 0.0, "--outer-hz: 0 is outside 0 to the inner rate 500"),
        (500.0, -1.0, "--outer-hz: -1 is outside 0 to the inner rate 500"),
        (500.0, math.nan, "--outer-hz: nan is outside 0 to the inner rate 500"),
        (500.0, 501.0, "--outer-hz: 501 is outside 0 to the inner rate 500"),
        (500.0, 300.0, "--outer-hz: 300 does not divide the inner rate 500"),
        (500.0, 99.9, "--outer-hz: 99.9 does not divide the inner rate 500"),
    ],
)
def test_rates_that_cannot_be(inner: float, outer: float, sentence: str) -> None:
    with pytest.raises(ConfigError) as error:
        rates(inner, outer)
    assert str(error.value) == sentence


@settings(max_examples=60)
@given(st.integers(50, 100_000))
def test_the_default_outer_rate_divides_any_inner_rate(interval_us: int) -> None:
    inner = 1e6 / interval_us
    found = rates(inner, nearest_outer_hz(inner))
    assert found.divisor == max(1, round(inner / 100.0))


READ_NS = 40
"""What it takes to read the clock."""


class Clock:
    """A clock that stands still but for sleeping, for being read and for the work that a test adds."""

    def __init__(self, oversleep_ns: int = 0, early_ns: int = 0) -> None:
        self.now = 1_000_000_000
        self.oversleep_ns = oversleep_ns
        self.early_ns = early_ns
        self.sleeps = 0

    def now_ns(self) -> int:
        self.now += READ_NS
        return self.now

    def sleep_s(self, seconds: float) -> None:
        self.sleeps += 1
        wanted = round(seconds * 1e9)
        self.now += max(1, wanted - self.early_ns) + self.oversleep_ns


def scheduler(clock: Clock) -> tuple[DeadlineScheduler, LoopTiming]:
    timing = LoopTiming(PERIOD)
    return DeadlineScheduler(timing, clock.now_ns, clock.sleep_s), timing


@pytest.mark.parametrize("oversleep_ns", [0, 60_000, 160_000])
def test_late_wake_ups_do_not_drift(oversleep_ns: int) -> None:
    """What the machine wakes late counts only beyond the time for which the scheduler watches the clock."""
    clock = Clock(oversleep_ns)
    run, timing = scheduler(clock)
    late_ns = max(0, oversleep_ns - WATCHED_NS)
    for tick in range(1, 1001):
        assert run.wait() == 1
        assert 0 <= clock.now - (1_000_000_000 + tick * PERIOD + late_ns) <= 3 * READ_NS
        clock.now += 300_000  # the tick's own work
    assert timing.lateness.figures() == pytest.approx((late_ns * 1e-3,) * 3, abs=3e-3 * READ_NS)
    assert timing.missed == 0
    assert clock.sleeps == 1000


def test_a_sleep_that_ends_early_is_continued() -> None:
    clock = Clock(early_ns=500_000)
    run, _ = scheduler(clock)
    run.wait()
    assert clock.now >= 1_000_000_000 + PERIOD
    assert clock.sleeps > 1


def test_missed_deadlines_are_skipped_counted_and_not_hurried_after() -> None:
    clock = Clock()
    run, timing = scheduler(clock)
    assert run.wait() == 1
    clock.now += 3 * PERIOD + PERIOD // 2  # a tick of 3.5 periods
    assert run.wait() == 3
    assert timing.missed == 2
    # then on time again, in the old phase
    assert run.wait() == 1
    assert (clock.now - 1_000_000_000) % PERIOD <= 3 * READ_NS
    assert (clock.now - 1_000_000_000) // PERIOD == 5
    assert timing.missed == 2


@settings(max_examples=60)
@given(st.lists(st.integers(0, 5 * PERIOD), min_size=1, max_size=40))
def test_periods_add_up_to_the_time_that_has_passed(work: list[int]) -> None:
    """The loops' time never runs ahead of the clock and never falls back by a period."""
    clock = Clock()
    run, timing = scheduler(clock)
    periods = 0
    for took in work:
        clock.now += took
        periods += run.wait()
        passed = clock.now - 1_000_000_000
        assert 0 <= passed - periods * PERIOD < PERIOD
    assert timing.missed == periods - len(work)


def test_overruns_are_ticks_longer_than_a_period() -> None:
    timing = LoopTiming(PERIOD)
    for took in (100_000, PERIOD, PERIOD + 1, 5_000_000):
        timing.tick(7, 7 + took)
    assert (timing.ticks, timing.overruns) == (4, 2)
    assert timing.execution.figures().max_us == 5000.0


def test_durations_are_figures_of_the_newest() -> None:
    durations = Durations()
    assert durations.figures() == NO_DURATIONS
    values = np.random.default_rng(1).integers(0, 10**6, WINDOW + 700)
    for value in values:
        durations.add(int(value))
    newest = values[-WINDOW:] * 1e-3
    found = durations.figures()
    assert found.mean_us == pytest.approx(newest.mean())
    assert found.p99_us == pytest.approx(np.percentile(newest, 99))
    assert found.max_us == newest.max()
