"""The origin of the filter's clock moves, so that single precision keeps milliseconds in flights of days."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.lib.recfunctions import structured_to_unstructured as numbers

from flightstack.core.contract import RecordArray
from flightstack.estimation.clock_origin import SPAN_S, ClockOrigin, move_clock_kernel
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.firmware.pil.target_filter import HostFilter
from tests.support.filter_events import IMU, LANDING, NUMBERS, TIMED, Event, InC, InPython
from tests.support.filter_flights import NEW_ORIGIN, STREAMS, later

DAY_S = 86_400.0
LATER_S = 1000.0
"""Time of the flights' start, so that the origin can move before it."""


def delayed(name: str, by_s: float) -> list[Event]:
    """Return the events of a flight that starts ``by_s`` later, without calls of functions."""
    return later([event for event in STREAMS[name]() if event.kind != NUMBERS], by_s)


def fly(filter_: HostFilter, by_s: float) -> np.ndarray:
    """Return the state after each sample of the IMU, shape (n, 13)."""
    states = []
    filter_.start(EstimatorParams())
    for kind, row in delayed("as flown", by_s):
        if kind == IMU:
            filter_.imu(row)
            states.append(filter_.memory["state"][0].copy())
        elif kind == LANDING:
            filter_.set_landed(bool(row[0]))
        elif kind in TIMED:
            filter_.push(kind, row)
    return np.array(states)


def test_single_precision_takes_each_sample_after_a_day() -> None:
    filter_ = HostFilter()
    states = fly(filter_, DAY_S)
    filter_.refresh()
    assert filter_.memory[0]["gaps"]["number"] == 0.0
    assert np.abs(states - fly(HostFilter("double"), DAY_S)).max() < 0.05


def test_memory_has_the_times_of_the_samples_whatever_the_origin() -> None:
    filter_ = HostFilter()
    fly(filter_, DAY_S)
    filter_.refresh()
    record = filter_.memory[0]
    last_s = max(row[0] for kind, row in delayed("as flown", DAY_S) if kind == IMU)
    assert record["output"][0] == pytest.approx(last_s, abs=1e-4)
    for time_s in (
        record["clock"][0],
        record["observations"]["fused_s"].max(),
        record["imu"]["time_s"].max(),
    ):
        assert last_s - 1.0 < time_s <= last_s


def unlike(one: RecordArray, other: RecordArray) -> dict[str, float]:
    """Return the fields of the memories that differ, with the largest difference."""
    found = {}
    for name in one.dtype.names or ():
        here, there = numbers(one[[name]]), numbers(other[[name]])
        if not np.allclose(here, there, rtol=1e-6, atol=1e-6, equal_nan=True):
            found[name] = float(np.nanmax(np.abs(here - there)))
    return found


@pytest.mark.parametrize("name", [name for name in STREAMS if name != NEW_ORIGIN])
def test_each_time_in_the_memory_moves_with_the_origin(name: str) -> None:
    """A time that stays would make a filter differ from one whose origin stays, or its memory."""
    stays, moves = InC(), InC()
    moved_s = 0.0
    for number, event in enumerate(delayed(name, LATER_S)):
        stays.take(event)
        if number % 2000 == 1999 and moved_s < 0.9 * LATER_S:
            moves.filter.move_clock(SPAN_S / 8.0)
            moved_s += SPAN_S / 8.0
        shown = event if event.kind not in TIMED else Event(event.kind, event.row.copy())
        if event.kind in TIMED:
            shown.row[0] -= moved_s
        moves.take(shown)
    back = moves.memory
    move_clock_kernel(back, -moved_s)
    assert moved_s > 0.0
    assert unlike(stays.memory, back) == {}


def test_never_stays_never_and_an_old_time_is_the_earliest() -> None:
    memory = InPython().memory
    memory["last_gnss_s"], memory["drag_s"], memory["last_imu_s"] = 0.0, 10.0, 600.0
    move_clock_kernel(memory, SPAN_S)
    assert (memory["last_gnss_s"][0], memory["drag_s"][0], memory["last_imu_s"][0]) == (0.0, 1e-3, 88.0)


def test_origin_follows_the_clock_by_one_to_two_spans() -> None:
    origin = ClockOrigin()
    assert origin.move(2.0 * SPAN_S - 0.002) == 0.0
    assert (origin.move(2.0 * SPAN_S), origin.at_s) == (SPAN_S, SPAN_S)
    assert origin.move(DAY_S) == DAY_S // SPAN_S * SPAN_S - 2.0 * SPAN_S
    assert SPAN_S <= DAY_S - origin.at_s < 2.0 * SPAN_S
    assert origin.move(DAY_S - 0.3) == 0.0
