"""The firmware's application: events of the estimator, answered once and again, and refused."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest

from flightstack.estimation.clock_origin import SPAN_S
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.memory import EstimatorMemory
from flightstack.estimation.rings import BARO_RING, GNSS_RING, MAG_RING
from flightstack.firmware.c_filter import CFilter, c_layout
from flightstack.firmware.pil.sensing import CLEAR, EARTH, IMU, LANDED, ORIGIN, PARAMS, READ, START
from flightstack.firmware.pil.target_filter import HostFilter
from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import BAD_INPUT, OUT_OF_ORDER, REPEATED, Target
from tests.support.filter_events import EARTH as EARTH_EVENT
from tests.support.filter_events import FIELD as FIELD_EVENT
from tests.support.filter_events import LANDING
from tests.support.filter_flights import flown

LATER_S = 600.0
"""Time of the flight's start, so that the origin can move before it."""
SAMPLE = (0.002, 0.002, 0.01, -0.02, 0.03, 0.1, 0.2, -9.8)


@pytest.fixture
def target() -> Iterator[Target]:
    made = Target(has_estimator=True)
    yield made
    made.close()


def sense(target: Target, number: int, kind: int, values: Sequence[float] = ()) -> Any:
    """Send an event and return the answer."""
    padded = [*map(float, values), *[0.0] * (10 - len(values))]
    return target.ask(mavlink.MAVLink_fs_pil_sense_message(number, kind, padded))[-1]


def begin(target: Target) -> int:
    """Clear and start the estimator; return the number of the next event."""
    sense(target, 7, CLEAR)
    sense(target, 8, START)
    return 9


def test_flight_through_the_application_has_the_bits_of_the_filter(target: Target) -> None:
    here = HostFilter()
    here.start(EstimatorParams())
    number, moved = begin(target), 0
    earth = np.zeros(4)
    for kind, row in flown()[:1500]:
        if kind in (IMU, GNSS_RING, MAG_RING, BARO_RING):
            answer = sense(target, number, kind, row)
            _ = here.imu(row) if kind == IMU else here.push(kind, row)
        elif kind == LANDING:
            answer = sense(target, number, LANDED, row)
            here.set_landed(bool(row[0]))
        elif kind in (EARTH_EVENT, FIELD_EVENT):
            earth = row if kind == EARTH_EVENT else earth
            answer = sense(target, number, EARTH, (*earth, kind == FIELD_EVENT))
            here.set_earth(earth, kind == FIELD_EVENT)
        else:
            continue
        assert (answer.event, answer.status) == (number, 0)
        number += 1
        flags = here.memory["flags"].view(np.int64).tolist()
        if kind == IMU:
            assert answer.state == here.memory["state"][0].tolist()
            assert answer.resets == here.memory["resets"].view(np.float64).tolist()
            moved += bool(here.memory["flags"]["aligned"][0])
        if kind in (IMU, FIELD_EVENT):
            assert answer.flags == sum(int(bit != 0) << at for at, bit in enumerate(flags))
    assert moved > 500


def test_origin_of_the_clock_moves_as_in_the_filter(target: Target) -> None:
    here, number, moved_s = CFilter(real="float"), begin(target), 0.0
    for kind, values in flown()[:1500]:
        if kind not in (IMU, GNSS_RING, MAG_RING, BARO_RING):
            continue
        row = values.copy()
        if number == 800:
            moved_s = SPAN_S
            assert sense(target, number, ORIGIN, (moved_s,)).status == 0
            here.move_clock(moved_s)
            number += 1
        row[0] += LATER_S - moved_s
        answer = sense(target, number, kind, row)
        _ = here.imu(row) if kind == IMU else here.push(kind, row)
        assert answer.status == 0
        if kind == IMU:
            assert answer.state == here.memory[0]["state"].tolist()
        number += 1
    assert number > 1000
    assert here.memory[0]["gaps"]["number"] == 0.0


@pytest.mark.parametrize("by_s", [math.nan, -1.0, math.inf, 1e12])
def test_origin_of_the_clock_moves_by_a_finite_time_only(by_s: float, target: Target) -> None:
    number = begin(target)
    assert sense(target, number, ORIGIN, (by_s,)).status == BAD_INPUT
    assert sense(target, number + 1, ORIGIN, (SPAN_S,)).status == 0


def test_repeated_event_is_answered_again_and_not_computed_again(target: Target) -> None:
    number = begin(target)
    first = sense(target, number, IMU, SAMPLE)
    again = sense(target, number, IMU, SAMPLE)
    assert (first.status, again.status) == (0, REPEATED)
    assert again.state == first.state
    assert sense(target, number + 1, IMU, (0.004, *SAMPLE[1:])).status == 0


@pytest.mark.parametrize("ahead", [-2, 1, 1000])
def test_event_out_of_order_is_refused_with_the_expected_number(target: Target, ahead: int) -> None:
    number = begin(target)
    answer = sense(target, number + ahead, IMU, SAMPLE)
    assert (answer.status, answer.event) == (OUT_OF_ORDER, number)


def test_event_with_the_number_of_another_kind_is_refused(target: Target) -> None:
    number = begin(target)
    assert sense(target, number, IMU, SAMPLE).status == 0
    answer = sense(target, number, LANDED, (1.0,))
    assert (answer.status, answer.event) == (OUT_OF_ORDER, number + 1)


def test_event_before_a_start_is_refused(target: Target) -> None:
    answer = sense(target, 5, IMU, SAMPLE)
    assert (answer.status, answer.event) == (OUT_OF_ORDER, 0)


@pytest.mark.parametrize(
    ("kind", "values"),
    [(9, ()), (PARAMS, (-1, 1)), (PARAMS, (60, 8)), (PARAMS, (55, 8)), (PARAMS, (0, 9)), (PARAMS, (0, -1))],
)
def test_event_that_is_not_valid_is_refused_and_counted(
    target: Target, kind: int, values: Sequence[float]
) -> None:
    number = begin(target)
    assert sense(target, number, kind, values).status == BAD_INPUT
    assert sense(target, number, kind, values).status == BAD_INPUT | REPEATED
    assert sense(target, number + 1, IMU, SAMPLE).status == 0


def test_memory_is_read_as_words(target: Target) -> None:
    begin(target)
    layout = c_layout(EstimatorMemory, "f4")
    count = layout.itemsize // 4
    words = np.zeros(count + 60, np.uint32)
    for first in range(0, count, 60):
        answer = sense(target, first, READ, (first,))
        assert (answer.event, answer.first) == (first, first)
        words[first : first + 60] = answer.words
    assert not words[count:].any()
    params = words[:count].view(layout)["params"][0]
    assert params.tolist() == np.float32(EstimatorParams()).tolist()
    assert sense(target, 0, READ, (-1.0,)).first == 0
    assert sense(target, 0, READ, (1e9,)).first == 0


def test_target_without_an_estimator_refuses() -> None:
    target = Target()
    assert sense(target, 0, CLEAR).status == BAD_INPUT
    target.close()


def test_cost_of_an_event_is_told() -> None:
    target = Target(has_estimator=True, ticks=[100, 400, 1000, 1005], overhead=10)
    assert sense(target, 0, CLEAR).cycles == 290
    assert sense(target, 1, START).cycles == 0
    target.close()
    silent = Target(has_estimator=True, ticks=None)
    assert sense(silent, 0, CLEAR).cycles == 0
    silent.close()
