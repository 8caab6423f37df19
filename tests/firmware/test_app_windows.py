"""The firmware's application: windows of steps, and short steps with short reports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.firmware.app_support import (
    ABOVE,
    BAD_INPUT,
    LEVEL,
    OUT_OF_ORDER,
    OUTER_DUE,
    OVERRUN,
    REPEATED,
    RESET,
    SAFE,
    SET_TARGET,
    Target,
    kinds,
    numbers,
    random_steps,
    step,
    tick,
)

WINDOW, WANT_REFERENCE = 8, 8


@pytest.fixture
def target() -> Iterator[Target]:
    made = Target()
    yield made
    made.close()


def window(first: int, count: int = WINDOW) -> list[Any]:
    """Return steps that differ; the first one of all has RESET."""
    made = []
    for number in range(first, first + count):
        flags = RESET | OUTER_DUE if number == 0 else OUTER_DUE if number % 5 == 0 else 0
        made.append(step(number, flags, (0.01 * number, *LEVEL[1:])))
    return made


def reports(answers: list[Any]) -> list[tuple[int, int, list[float]]]:
    return [(r.step, r.status, numbers(r)) for r in answers if r.get_type() == "FS_PIL_REPORT"]


def test_a_window_of_steps_makes_the_reports_of_single_ones(target: Target) -> None:
    other = Target()
    for first in range(0, 10 * WINDOW, WINDOW):
        steps = window(first)
        together = reports(target.ask(*steps))
        assert together == [report for each in steps for report in reports(other.ask(each))]
        assert len(together) == WINDOW
    other.close()


def test_identity_tells_protocol_and_window(target: Target) -> None:
    identity = target.request("FS_PIL_IDENTITY")
    assert (identity.protocol, identity.window) == (4, WINDOW)


def test_the_largest_window_has_room_behind_news_and_answers(target: Target) -> None:
    target.step(0, RESET)
    for _ in range(40):
        target.poll(1_000)
        target.give(target.pack(step(0, RESET)))  # repeated; some find no room
    target.heard()
    for _ in range(40):
        target.poll(1_000)
    for each in window(1):
        target.give(target.pack(each))
    assert kinds(target.heard()).count("FS_PIL_REPORT") == WINDOW


@pytest.mark.parametrize("lost", range(WINDOW))
def test_reports_lost_in_a_window_are_sent_again(target: Target, lost: int) -> None:
    target.ask(*window(0))
    steps = window(WINDOW)
    first = reports(target.ask(*steps))
    again = reports(target.ask(*steps[lost:]))
    assert again == [(number, status | REPEATED, values) for number, status, values in first[lost:]]
    assert target.status().steps == 2 * WINDOW


def test_steps_behind_a_lost_one_are_refused_until_it_comes(target: Target) -> None:
    target.ask(*window(0))
    steps = window(WINDOW)
    answers = reports(target.ask(*steps[:2], *steps[3:]))
    assert [(number, status) for number, status, _ in answers[2:]] == [(WINDOW + 2, OUT_OF_ORDER)] * 5
    assert [status & OUT_OF_ORDER for _, status, _ in reports(target.ask(*steps[2:]))] == [0] * 6
    assert target.status().steps == 2 * WINDOW


def test_a_step_older_than_the_window_is_out_of_order(target: Target) -> None:
    target.ask(*window(0), *window(WINDOW, 2))
    (answer,) = reports(target.ask(window(1)[0]))
    assert answer[:2] == (WINDOW + 2, OUT_OF_ORDER)
    (answer,) = reports(target.ask(window(2)[0]))
    assert answer[1] & REPEATED


def test_the_first_step_of_a_flight_is_computed_again_later_in_it(target: Target) -> None:
    """A host that begins anew exactly as before gets the same flight, and not the answer of the one before."""
    first = reports(target.ask(*window(0, 4)))
    assert reports(target.ask(*window(0, 4))) == first
    assert target.status().steps == 8


def values_of(flags: int, state: list[float], setpoint: list[float]) -> list[float]:
    """Return what a short step sends."""
    if flags & SET_TARGET:
        return [*state[6:], *setpoint[:5]]
    return [*state[6:], *state[:6], *setpoint] if flags & OUTER_DUE else state[6:]


def test_short_steps_fly_the_bits_of_full_ones(target: Target) -> None:
    other = Target()
    for number, (flags, state, setpoint) in enumerate(random_steps(400)):
        full = other.step(number, flags, state, setpoint)
        wanted = WANT_REFERENCE if number % 5 == 4 else 0
        (short,) = target.ask(tick(number, flags | wanted, values_of(flags, state, setpoint)))
        extra = [*full.attitude_target] if flags & OUTER_DUE else []
        extra += full.reference[:4] if wanted else []
        values = [*full.rotor_command[:4], *extra, *[0.0] * 17][:17]
        assert np.float32(short.values).tobytes() == np.float32(values).tobytes()
        assert (short.step, short.status) == (number, full.status)
    other.close()


def test_a_short_report_has_the_cost_of_the_whole_step() -> None:
    target = Target(ticks=[0, 0, 0, 0, 400_001])
    (short,) = target.ask(tick(0, RESET))
    assert (short.cycles, short.status >> 16 << 16) == (400_001, OVERRUN)
    target.close()


def test_short_steps_are_repeated_and_refused_in_short(target: Target) -> None:
    (first,) = target.ask(tick(0, RESET | OUTER_DUE, values_of(OUTER_DUE, [*LEVEL], [*ABOVE])))
    (again,) = target.ask(tick(0, RESET | OUTER_DUE, values_of(OUTER_DUE, [*LEVEL], [*ABOVE])))
    assert (again.status, again.values) == (REPEATED, first.values)
    (refusal,) = target.ask(tick(5))
    assert (refusal.get_type(), refusal.step, refusal.status) == ("FS_PIL_OUTPUT", 1, OUT_OF_ORDER)
    answers = target.ask(tick(1, 16))
    assert kinds(answers) == ["FS_PIL_OUTPUT", "STATUSTEXT", "HEARTBEAT"]
    assert answers[0].status & BAD_INPUT
    assert set(answers[0].values) == {0.0}
    assert target.state == SAFE


def test_the_same_step_in_the_other_form_is_another_step(target: Target) -> None:
    level = [*LEVEL]
    target.ask(step(3, RESET, level, [0.0] * 11))
    (short,) = target.ask(tick(3, RESET))
    assert short.status & REPEATED == 0
