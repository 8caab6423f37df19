"""Selection of one of several estimators by their sensors and test ratios."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.estimation.imu_track import ImuTrack
from flightstack.estimation.selector import (
    BETWEEN_S,
    FORCE_M_S2,
    RATE_RAD_S,
    SPEED_M_S,
    TURN_RAD,
    LaneFacts,
    LaneRecord,
    Selection,
    combined_ratio,
    select,
)

DT_S = 0.05
STILL, WEIGHT = Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, -9.8)
GOOD = LaneFacts(True, 0.2, STILL, WEIGHT)
DEAD = GOOD._replace(is_usable=False)
TURNED = GOOD._replace(rates_rad_s=Vector3(0.0, 0.0, 3.0 * RATE_RAD_S))
PUSHED = GOOD._replace(force_m_s2=Vector3(2.0 * FORCE_M_S2, 0.0, -9.8))
WORSE = GOOD._replace(ratio=0.5)

Change = tuple[float, int, str] | None


def start(count: int = 2, selected: int = 0) -> Selection:
    return Selection((LaneRecord(),) * count, selected)


def first_change(
    facts: tuple[LaneFacts, ...] | Callable[[float], tuple[LaneFacts, ...]],
    selection: Selection | None = None,
    limit_s: float = 30.0,
) -> Change:
    """Return time, lane and reason of the first change, or None."""
    for tick in range(1, round(limit_s / DT_S) + 1):
        now = facts if isinstance(facts, tuple) else facts(tick * DT_S)
        selection = select(selection or start(len(now)), now, tick * DT_S, DT_S)
        if selection.changes:
            assert selection.changed_s == tick * DT_S
            return tick * DT_S, selection.selected, selection.reason
    return None


def test_equal_lanes_stay_as_they_are() -> None:
    assert first_change((GOOD, GOOD)) is None


@pytest.mark.parametrize("here", [0, 1])
def test_lane_without_its_sensor_is_left_at_once(here: int) -> None:
    facts = (DEAD, GOOD) if here == 0 else (GOOD, DEAD)
    assert first_change(facts, start(selected=here)) == (DT_S, 1 - here, "is missing or stuck")


def test_lane_without_another_one_stays() -> None:
    assert first_change((DEAD, DEAD)) is None
    assert first_change((GOOD, DEAD)) is None
    assert first_change((WORSE, DEAD._replace(ratio=0.0))) is None


def test_best_of_the_other_lanes_is_selected() -> None:
    assert first_change((DEAD, WORSE, GOOD)) == (DT_S, 2, "is missing or stuck")
    assert first_change((DEAD, DEAD, WORSE)) == (DT_S, 2, "is missing or stuck")


def test_lane_that_is_better_for_a_while_is_selected_after_10_s() -> None:
    found = first_change((WORSE, GOOD))
    assert found is not None
    time_s, lane, reason = found
    assert (lane, reason) == (1, "has larger test ratios")
    assert time_s == pytest.approx(BETWEEN_S, abs=DT_S)


def test_lane_that_is_little_better_is_not_selected() -> None:
    assert first_change((GOOD._replace(ratio=0.39), GOOD), limit_s=100.0) is None


@pytest.mark.parametrize("fault", [TURNED, PUSHED])
def test_of_two_that_disagree_the_one_of_smaller_ratios_is_selected(fault: LaneFacts) -> None:
    assert first_change((fault, GOOD)) is None  # none is known to be the faulty one
    found = first_change((fault._replace(ratio=0.25), GOOD))
    assert found is not None
    time_s, lane, reason = found
    assert (lane, reason) == (1, "disagrees with inertial sensor 2")
    limit_s = {TURNED: TURN_RAD / (2.0 * RATE_RAD_S), PUSHED: SPEED_M_S / FORCE_M_S2}[fault]
    assert limit_s < time_s < limit_s + 0.5 / 0.05 * DT_S + 3.0 * DT_S
    assert first_change((GOOD, fault._replace(ratio=0.25))) is None


@pytest.mark.parametrize("fault", [TURNED, PUSHED])
def test_of_three_the_one_that_disagrees_is_left(fault: LaneFacts) -> None:
    found = first_change((fault, GOOD, GOOD._replace(ratio=0.21)))
    assert found is not None
    assert found[1:] == (1, "disagrees with the others")
    assert first_change((GOOD, fault, GOOD)) is None


@pytest.mark.parametrize(("tilt_deg", "is_better"), [(0.3, True), (0.5, False), (5.0, False)])
def test_lane_with_small_ratios_for_a_wide_gate_is_not_better(tilt_deg: float, is_better: bool) -> None:
    here = TURNED._replace(ratio=0.45, tilt_rad=math.radians(0.2))
    assert (first_change((here, GOOD._replace(tilt_rad=math.radians(tilt_deg)))) is not None) is is_better


@pytest.mark.parametrize(
    ("wrong_s", "is_better"), [((0.0, 0.0), True), ((0.0, 8.0), False), ((7.0, 8.0), True)]
)
def test_lane_that_found_its_sensor_wrong_is_not_better(
    wrong_s: tuple[float, float], is_better: bool
) -> None:
    here, there = TURNED._replace(ratio=0.3, wrong_s=wrong_s[0]), GOOD._replace(wrong_s=wrong_s[1])
    assert (first_change((here, there)) is not None) is is_better


def test_sensors_that_agree_again_are_trusted_after_a_time() -> None:
    selection = start()
    for tick in range(100):
        selection = select(selection, (TURNED, GOOD), tick * DT_S, DT_S)
    assert selection.disagree
    ticks = 0
    while selection.disagree:
        ticks += 1
        selection = select(selection, (GOOD, GOOD), (100 + ticks) * DT_S, DT_S)
    assert ticks * DT_S == pytest.approx(3.0 * TURN_RAD / RATE_RAD_S, abs=2.0 * DT_S)


def test_short_difference_is_no_disagreement() -> None:
    assert first_change(lambda t: (TURNED._replace(ratio=0.3) if t < 0.12 else GOOD, GOOD)) is None


def test_combined_ratio_is_that_of_px4_with_the_heading() -> None:
    assert combined_ratio(0.4, 0.2, 0.1, 0.0) == pytest.approx(0.3)
    assert combined_ratio(0.4, 0.2, 0.5, 0.0) == 0.5
    assert combined_ratio(0.4, 0.2, 0.5, 0.6) == 0.6


def test_means_of_a_track_are_those_of_its_newest_samples() -> None:
    track, rng = ImuTrack(), np.random.default_rng(3)
    assert track.mean_since(-1.0) is None
    values = rng.normal(size=(250, 6))
    for i, row in enumerate(values, 1):
        track.take(i * 0.002, 0.002, tuple(row[:3]), tuple(row[3:]))
        if i in (5, 100, 250):
            mean = track.mean_since((i - 5) * 0.002 + 1e-9)
            assert mean is not None
            assert [*mean[0], *mean[1]] == pytest.approx(values[i - 5 : i].mean(axis=0), abs=1e-12)
    mean = track.mean_since(0.0)
    assert mean is not None  # the track is as long as 100 samples
    assert [*mean[0], *mean[1]] == pytest.approx(values[150:].mean(axis=0), abs=1e-12)
    assert track.mean_since(0.5) is None
    assert math.isfinite(mean[0].x)
