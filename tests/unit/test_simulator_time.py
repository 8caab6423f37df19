"""Time of the simulator at the stack's link: age, jumps, steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.hot_frames import ActuatorsFrame
from flightstack.simulator_link.state_steps import is_gap
from tests.support.link_to_simulator import STATE, booted, link, plant_state, receive


def test_a_state_that_stays_away_grows_old() -> None:
    stack = link()
    receive(stack, plant_state(0))
    assert stack.freshness(0) == (0, 0)
    assert stack.freshness(10_000) == (10_000, 10_000)
    receive(stack, plant_state(12_000, [2.0, *STATE[1:]]))
    assert stack.freshness(20_000) == (0, 0)
    assert stack.freshness(30_000).age_us == 10_000


def test_a_state_that_comes_but_never_changes_is_frozen() -> None:
    stack = link()
    for time_us in range(0, 60_000, 10_000):
        receive(stack, plant_state(time_us))
        fresh = stack.freshness(time_us)
    assert fresh == (0, 50_000)
    receive(stack, plant_state(60_000, [math.nextafter(STATE[0], 2.0), *STATE[1:]]))
    assert stack.freshness(60_000) == (0, 0)
    for time_us in (70_000, 80_000, 90_000):
        receive(stack, plant_state(time_us, [math.nan] * 13))
        fresh = stack.freshness(time_us)
    assert fresh == (0, 20_000)


@pytest.mark.parametrize("odd", [0, 100_000, 10_000_000_000, 2**64 - 1])
def test_the_clock_neither_goes_back_nor_jumps(odd: int) -> None:
    """The step to an odd time is not followed; those after it are, and answers carry the state's own time."""
    stack, answer = link(), ActuatorsFrame()
    receive(stack, plant_state(1_000_000))
    receive(stack, plant_state(1_002_000))
    receive(stack, plant_state(odd, [5.0, *STATE[1:]]))
    assert (stack.time_us, stack.time_jumps, stack.state[0]) == (2_000, 1, 5.0)
    assert answer.open(stack.answer(np.zeros(8), True))
    assert answer.time_us == odd
    receive(stack, plant_state((odd + 4000) % 2**64))
    expected = 2_000 if odd == 2**64 - 1 else 6_000
    assert stack.time_us == expected
    receive(stack, plant_state((odd + 6000) % 2**64))
    assert stack.time_us == expected + 2000


@pytest.mark.parametrize("first_us", [0, 5_000_000_000, 1_790_000_000_000_000, 2**64 - 5000])
def test_the_clock_counts_from_the_first_state(first_us: int) -> None:
    stack = link()
    for after_us in (0, 2000, 4000):
        receive(stack, plant_state(first_us + after_us))
        assert (stack.time_us, stack.time_jumps) == (after_us, 0)


def test_invalid_first_time_costs_one_step() -> None:
    stack = link()
    receive(stack, plant_state(2**64 - 1))
    receive(stack, plant_state(2000))
    receive(stack, plant_state(4000))
    assert (stack.time_us, stack.time_jumps) == (2000, 1)


def test_a_state_that_comes_again_is_no_new_one() -> None:
    stack = booted()
    receive(stack, plant_state(10_000))
    assert stack.freshness(10_000) == (0, 0)
    assert receive(stack, plant_state(10_000, [9.0, *STATE[1:]]))  # it wants an answer
    assert (stack.time_us, stack.time_jumps) == (10_000, 0)
    assert stack.freshness(20_000).age_us == 10_000


def texts(stack: SimulatorEndpoint) -> list[str]:
    return [notice.text for notice in stack.steps.take_notices()]


@pytest.mark.parametrize("step_us", [500, 4000, 4167, 10_000])
def test_changed_step_is_reported_once(step_us: int) -> None:
    stack = booted()
    for number in range(1, 100):
        receive(stack, plant_state(number * step_us))
    assert texts(stack) == [
        f"Simulator sends a state every {step_us / 1000:.4g} ms; the loops run every 2 ms on the newest one"
    ]
    assert not stack.step_refusal


def test_jittering_steps_are_not_reported() -> None:
    stack = booted()
    for number in range(1, 200):
        receive(stack, plant_state(number * 2000 + (number % 3 - 1) * 20))
    assert texts(stack) == []


def test_a_step_too_long_to_fly_is_refused_until_it_ends() -> None:
    stack, time_us = booted(), 0
    for _ in range(10):
        time_us += 16_000
        receive(stack, plant_state(time_us))
    assert stack.step_refusal == (
        "the simulator sends a state every 16 ms, the loops need one every 10 ms, or --inner-hz 62.5"
    )
    assert texts(stack) == [f"Not to be flown: {stack.step_refusal}"]
    for _ in range(20):
        time_us += 2_000
        receive(stack, plant_state(time_us))
    assert not stack.step_refusal


@pytest.mark.parametrize("hiccup_us", [30_000, 45_000])
def test_single_long_steps_are_no_rate(hiccup_us: int) -> None:
    """One hiccup in each of 30 seconds: reported as jumps, every 10 s at most; the vehicle may arm."""
    stack, time_us = booted(), 0
    for number in range(30 * 500):
        time_us += hiccup_us if number % 500 == 499 else 2_000
        receive(stack, plant_state(time_us))
        assert not stack.step_refusal
    assert texts(stack) == [f"Simulator time jumped ahead by {hiccup_us * 1e-6:.4g} s"] * 3


def test_a_gap_is_longer_than_50_ms_for_steps_and_ticks() -> None:
    assert [is_gap(step_us) for step_us in (49_999, 50_000, 50_001)] == [False, False, True]


def test_time_jumps_are_reported_at_intervals() -> None:
    stack = booted()
    for time_us in (2000, 12_002_000, 2000, 4000):
        receive(stack, plant_state(time_us))
    assert texts(stack) == ["Simulator time jumped ahead by 12 s"]
    for number in range(6000):
        receive(stack, plant_state(6000 + 2000 * number))
    receive(stack, plant_state(2000))
    assert texts(stack) == ["Simulator time went back by 12 s"]


def test_simulator_speed_difference_is_reported_once() -> None:
    stack = booted()
    for second in range(30):
        stack.steps.compare(1_000_000 * second, 1_000_000 * second)
    assert texts(stack) == []
    for second in range(30):
        stack.steps.compare(29_000_000 + 500_000 * second, 1_000_000 * (29 + second))
    assert texts(stack) == ["Simulator runs at 0.50 times real time"]
