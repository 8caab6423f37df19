"""What ``python -m tools.long_flight`` calls growth, and rows of the log that are not one period apart."""

from __future__ import annotations

import argparse

import pytest

from flightstack.params.config import TRUTH
from tools.long_flight import (
    HOUR_S,
    LIMITS,
    CountedFile,
    EvenLog,
    Kept,
    Sample,
    growth,
    hours,
    intervals,
    problems,
)

PERIODS_US = (2000, 10_000)


def sample(hours: float, *kept: float, late_us: int = 0, uneven: int = 0, error_m: float = 0.05) -> Sample:
    return Sample(hours * HOUR_S, 0.0, Kept(*kept), 0.0, late_us, uneven, error_m)


FIRST = sample(0.0, 100.0, 1000.0, 5000.0, 0.5)


def test_growth_is_that_of_an_hour() -> None:
    assert growth(FIRST, sample(4.0, 102.0, 1004.0, 5400.0, 0.5)) == Kept(0.5, 1.0, 100.0, 0.0)


def test_flight_within_the_limits_has_no_problem() -> None:
    assert (
        problems(FIRST, sample(2.0, *(a + 2.0 * b for a, b in zip(FIRST.kept, LIMITS, strict=True))), TRUTH)
        == []
    )


@pytest.mark.parametrize(
    ("last", "problem"),
    [
        (sample(2.0, 110.0, 1000.0, 5000.0, 0.5), "memory_mb grows by 5 an hour"),
        (sample(2.0, 100.0, 1000.0, 5000.0, 0.6), "buffers_mb grows by 0.05 an hour"),
        (sample(2.0, *FIRST.kept, late_us=-2), "steps are not exact: -2 µs late"),
        (sample(2.0, *FIRST.kept, uneven=3), "steps are not exact: 0 µs late, 3 rows"),
        (sample(2.0, *FIRST.kept, error_m=float("nan")), "the vehicle is nan m from the place"),
    ],
)
def test_problem_is_named(last: Sample, problem: str) -> None:
    (found,) = problems(FIRST, last, TRUTH)
    assert found.startswith(problem)


def test_growth_of_a_short_flight_is_not_extrapolated() -> None:
    assert growth(FIRST, sample(0.1, 100.5, 1004.0, 5000.0, 0.5)) == Kept(0.5, 4.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("flown_h", "expected"), [(24.0, (3600.0, 24)), (1.0, (1200.0, 3)), (3.5, (3150.0, 4)), (0.05, (60.0, 3))]
)
def test_samples_come_each_hour_and_at_least_three_times(flown_h: float, expected: tuple[float, int]) -> None:
    assert intervals(flown_h) == pytest.approx(expected)


@pytest.mark.parametrize("text", ["0", "-1", "0.01", "nan", "inf", "day", "1001"])
def test_hours_out_of_range_are_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=r"is not a number from 0\.05 to 1000"):
        hours(text)


def even_log() -> EvenLog:
    return EvenLog(CountedFile(), 4, PERIODS_US)


def write(log: EvenLog, *times_us: int) -> None:
    for time_us in times_us:
        log.inner.append(time_us)
    log.flush()


def test_rows_of_one_period_are_even_over_several_blocks() -> None:
    log = even_log()
    write(log, 2000, 4000, 6000)
    write(log, 8000)
    assert log.uneven == 0


def test_row_that_is_missing_twice_or_late_is_uneven() -> None:
    log = even_log()
    write(log, 2000, 6000)
    write(log, 6000)
    write(log, 8001)
    assert log.uneven == 3
