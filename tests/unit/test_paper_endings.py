"""When a flight counts as crashed, when as out of control, and what a step of the reference is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import STATE_SIZE, FloatArray
from flightstack.core.geometry_bulk import quaternions_from_euler
from gcs_cli.experiments.paper.flights.endings import Ending, ending

HZ = 100.0
TICKS = 1000


def flight(
    position: FloatArray | None = None, euler_rad: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """States (n, 13) and a reference (n, 4) at zero."""
    state = np.zeros((TICKS, STATE_SIZE))
    state[:, 6] = 1.0
    if position is not None:
        state[:, :3] = position
    if euler_rad is not None:
        state[:, 6:10] = quaternions_from_euler(euler_rad)
    return state, np.zeros((TICKS, 4))


def column(axis: int, values: FloatArray, width: int = 3) -> FloatArray:
    full = np.zeros((TICKS, width))
    full[:, axis] = values
    return full


GROWING = np.arange(TICKS) / HZ  # one unit a second


def test_a_flight_that_follows_flies_to_its_end() -> None:
    assert ending(*flight(), False, HZ) == Ending(TICKS, "", "")


@pytest.mark.parametrize(
    ("axis", "at", "why"),
    [(0, 301, "off its place by more than 3 m"), (2, 101, "height off by more than 1 m")],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_who_drifts_away_has_lost_control(axis: int, at: int, why: str, sign: float) -> None:
    away = np.minimum(GROWING, 5.0)
    assert ending(*flight(column(axis, sign * away)), False, HZ) == Ending(at, "lost", why)


def test_a_heading_that_turns_through_has_lost_control() -> None:
    state, reference = flight(euler_rad=column(2, np.radians(60.0) * GROWING))
    assert ending(state, reference, False, HZ) == Ending(101, "lost", "heading off by more than 60°")


def test_a_step_of_the_reference_is_no_loss_for_two_seconds() -> None:
    for seconds, how in ((1.9, ""), (2.1, "lost")):
        state, reference = flight()
        reference[300 : 300 + round(HZ * seconds), 2] = 1.5  # the vehicle stays where it is
        found = ending(state, reference, False, HZ)
        assert found.how == how
        assert found.ticks == (TICKS if not how else 500)


def test_coming_back_late_is_no_loss() -> None:
    """What was asked for in the last two seconds still counts."""
    state, reference = flight(column(2, np.where(GROWING < 4.9, 1.5, 0.0)))
    reference[:300, 2] = 1.5
    assert ending(state, reference, False, HZ).how == ""
    state[:, 2] = np.where(GROWING < 5.1, 1.5, 0.0)
    assert ending(state, reference, False, HZ) == Ending(500, "lost", "height off by more than 1 m")


def test_a_crash_counts_before_the_loss_that_led_to_it() -> None:
    assert ending(*flight(column(2, 4.0 * GROWING)), False, HZ) == Ending(
        251, "crashed", "10 m away from its reference"
    )
    tilt = column(0, np.radians(np.minimum(30.0 * GROWING, 170.0)))
    assert ending(*flight(euler_rad=tilt), False, HZ) == Ending(301, "crashed", "turned over")


def test_numbers_that_run_away_are_a_crash_unless_there_was_one_before() -> None:
    assert ending(*flight(), True, HZ) == Ending(TICKS, "crashed", "the numbers of the plant ran away")
    assert ending(*flight(column(0, 4.0 * GROWING)), True, HZ).ticks == 251


def test_what_is_not_steered_cannot_be_lost() -> None:
    state, reference = flight(column(0, GROWING))
    reference[:, :3] = math.nan
    assert ending(state, reference, False, HZ).how == ""
