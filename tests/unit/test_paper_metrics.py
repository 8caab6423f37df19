"""Figures of responses against closed forms of second-order systems, and what is and is not a move."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import FloatArray, LoopStatus
from gcs_cli.experiments.paper.flights.metrics import axis_metrics, effort, measure, moves, path_metrics
from gcs_cli.experiments.paper.flights.types import Case, Recording

STEP_S, BEGIN_S = 1e-3, 0.5
TIME_S = np.arange(0.0, 12.0, STEP_S)


def second_order(wn: float, zeta: float, size: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Reference and response of wn²/(s² + 2 ζ wn s + wn²) to a step."""
    t = np.maximum(TIME_S - BEGIN_S, 0.0)
    wd = wn * math.sqrt(1.0 - zeta**2)
    decay = np.exp(-zeta * wn * t)
    response = 1.0 - decay * (np.cos(wd * t) + zeta * wn / wd * np.sin(wd * t))
    return np.where(TIME_S >= BEGIN_S, size, 0.0), size * response


@pytest.mark.parametrize("zeta", [0.2, 0.45, 0.7, 0.9])
@pytest.mark.parametrize("wn", [3.2, 20.0])
@pytest.mark.parametrize("size", [1.0, -0.05])
def test_second_order_step(wn: float, zeta: float, size: float) -> None:
    reference, actual = second_order(wn, zeta, size)
    found = axis_metrics(TIME_S, actual, reference)
    overshoot = 100.0 * math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
    assert found.overshoot_percent == pytest.approx(overshoot, abs=0.1)
    assert found.rise_time_s == pytest.approx(
        first_time(wn, zeta, 0.9) - first_time(wn, zeta, 0.1), abs=0.002
    )
    assert found.settling_time_s == pytest.approx(settled_after(wn, zeta), abs=0.002)
    assert found.steady_state_error == pytest.approx(0.0, abs=0.003 * abs(size))
    assert found.max_error == pytest.approx(abs(size), rel=1e-9)


def value(wn: float, zeta: float, t: float) -> float:
    wd = wn * math.sqrt(1.0 - zeta**2)
    return 1.0 - math.exp(-zeta * wn * t) * (math.cos(wd * t) + zeta * wn / wd * math.sin(wd * t))


def bisect(wn: float, zeta: float, low: float, high: float, level: float) -> float:
    for _ in range(60):
        middle = 0.5 * (low + high)
        if (value(wn, zeta, low) - level) * (value(wn, zeta, middle) - level) <= 0.0:
            high = middle
        else:
            low = middle
    return low


def first_time(wn: float, zeta: float, level: float) -> float:
    """First passage of ``level``: the response rises from 0 to its first peak."""
    return bisect(wn, zeta, 0.0, math.pi / (wn * math.sqrt(1.0 - zeta**2)), level)


def settled_after(wn: float, zeta: float) -> float:
    """Last passage of the band of 2 %: between the last extreme outside it and the one after that."""
    wd = wn * math.sqrt(1.0 - zeta**2)
    extreme = 0
    while math.exp(-math.pi * zeta * (extreme + 1) / math.sqrt(1.0 - zeta**2)) > 0.02:
        extreme += 1
    edge = 1.0 + (0.02 if extreme % 2 else -0.02)
    return bisect(wn, zeta, extreme * math.pi / wd, (extreme + 1) * math.pi / wd, edge)


def test_first_order_step_has_no_overshoot() -> None:
    reference = np.where(TIME_S >= BEGIN_S, 2.0, 0.0)
    actual = np.where(TIME_S >= BEGIN_S, 2.0 * (1.0 - np.exp(-(TIME_S - BEGIN_S) / 0.3)), 0.0)
    found = axis_metrics(TIME_S, actual, reference)
    assert found.overshoot_percent == 0.0
    assert found.rise_time_s == pytest.approx(0.3 * math.log(9.0), abs=0.002)
    assert found.settling_time_s == pytest.approx(0.3 * math.log(50.0), abs=0.002)


def test_a_lasting_error_is_told_and_never_settles() -> None:
    reference, actual = second_order(5.0, 0.7)
    found = axis_metrics(TIME_S, 0.95 * actual, reference)
    assert found.settling_time_s is None
    assert found.steady_state_error == pytest.approx(-0.05, abs=1e-4)


def test_a_response_that_never_rises_has_no_rise_time() -> None:
    reference, _ = second_order(5.0, 0.7)
    found = axis_metrics(TIME_S, np.zeros_like(TIME_S), reference)
    assert found.rise_time_s is None
    assert found.settling_time_s is None
    assert found.overshoot_percent == 0.0


def test_a_reference_without_a_rest_has_errors_alone() -> None:
    reference = np.sin(TIME_S)
    found = axis_metrics(TIME_S, reference + 0.1, reference)
    assert found.overshoot_percent is found.rise_time_s is found.settling_time_s is None
    assert found.rms_error == pytest.approx(0.1)
    assert found.steady_state_error == pytest.approx(0.1)


def test_overshoot_is_told_of_each_move_and_times_of_the_last_one() -> None:
    reference = np.where(TIME_S >= 6.0, 3.0, np.where(TIME_S >= 1.0, 1.0, 0.0))
    actual = reference.copy()
    actual[1500:1600] = 1.25  # a quarter of the first move
    actual[6000:6200] = 1.0  # the second rises 0.2 s late
    actual[7000:7100] = 3.1  # a twentieth of the second
    found = axis_metrics(TIME_S, actual, reference)
    assert [move.overshoot_percent for move in found.moves] == pytest.approx([25.0, 5.0])
    assert [(move.at_s, move.by) for move in found.moves] == [(1.0, 1.0), (6.0, 2.0)]
    assert found.overshoot_percent == pytest.approx(25.0)
    assert found.overshoot_median_percent == pytest.approx(15.0)
    assert found.settling_time_s == pytest.approx(1.1, abs=0.002)
    assert found.rise_time_s == pytest.approx(0.0, abs=0.002)


@pytest.mark.parametrize(
    ("place", "speed", "counts"),
    [(0.0, 0.0, True), (0.03, 0.0, True), (0.05, 0.0, False), (0.0, 0.03, True), (0.0, 0.05, False)],
)
def test_a_move_counts_only_if_the_axis_was_at_rest(place: float, speed: float, counts: bool) -> None:
    """2 % of a move of 2 m: 4 cm, and 4 cm/s."""
    reference = np.where(TIME_S >= 6.0, 3.0, np.where(TIME_S >= 1.0, 1.0, 0.0))
    actual = reference.copy()
    before = (TIME_S >= 5.0) & (TIME_S <= 6.0)
    actual[before] = 1.0 + place + speed * (TIME_S[before] - 6.0)
    actual[7000:7100] = 3.1
    first, second = axis_metrics(TIME_S, actual, reference).moves
    assert first.overshoot_percent is not None
    assert (second.overshoot_percent is not None) is counts


def test_a_loop_that_shivers_in_place_is_at_rest() -> None:
    reference = np.where(TIME_S >= 6.0, 1.0, 0.0)
    actual = reference + 1e-3 * np.where(np.arange(len(TIME_S)) % 2, 1.0, -1.0)
    assert axis_metrics(TIME_S, actual, reference).moves[0].overshoot_percent is not None


def test_nothing_settles_that_is_watched_for_less_than_four_seconds() -> None:
    for until_s, told in ((4.9, False), (5.0, True)):
        reference = np.where(np.logical_and(TIME_S >= 1.0, until_s > TIME_S), 1.0, 0.0)
        actual = reference.copy()
        actual[round(1e3 * until_s) - 100 :] += 0.3  # what comes then does not begin at rest
        found = axis_metrics(TIME_S, actual, reference)
        assert (found.rise_time_s is not None) is told
        assert found.overshoot_percent == pytest.approx(30.0)
        assert found.moves[1].overshoot_percent is None


def test_a_zigzag_that_comes_back_is_no_move() -> None:
    reference = np.where((TIME_S >= 2.0) & (TIME_S < 2.3), 1.0, 0.0)
    assert moves(TIME_S, reference) == []


def test_a_smooth_move_is_one_move() -> None:
    share = np.clip(TIME_S - 2.0, 0.0, 1.0)
    reference = 4.0 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    (move,) = moves(TIME_S, reference)
    assert (move.start, move.target, move.end) == (0.0, 4.0, len(TIME_S))
    assert move.begin * STEP_S == pytest.approx(2.0, abs=0.01)


def recording(position: FloatArray, reference: FloatArray, status: int = 0) -> Recording:
    """A flight of the case's 1 kHz: positions and references NED, all else at rest."""
    n = len(position)
    full = np.zeros((n, 4))
    full[:, :3] = reference
    three, four = np.zeros((n, 3)), np.zeros((n, 4))
    four[:, 1] = 0.3
    return Recording(
        Case("a", "smooth"), np.arange(n) * 1e-3, full, position, three, three, three, three, four, four, four,
        np.full(n, status), None, "",
    )  # fmt: skip


def test_a_flight_late_on_its_path_keeps_to_the_path() -> None:
    angle = np.linspace(0.0, 2.0 * math.pi, 8001)
    circle = np.column_stack((2.0 * np.sin(angle), 2.0 - 2.0 * np.cos(angle), np.zeros_like(angle)))
    late = np.vstack((np.repeat(circle[:1], 100, axis=0), circle[:-100]))
    found = path_metrics(recording(late, circle))
    assert found is not None
    assert found.max_error_m == pytest.approx(0.157, abs=0.001)  # 0.1 s at 1.57 m/s
    assert found.path_max_m < 0.0005
    assert found.beyond_m < 1e-9


def test_overshoot_at_a_corner_is_beyond_the_path() -> None:
    n = 6000
    reference, flight = np.zeros((n, 3)), np.zeros((n, 3))
    reference[1000:, 0] = 1.0
    reference[3000:, 1] = 1.0
    flight[1200:, 0] = 1.0
    flight[2000:2200, 0] = 1.2
    flight[3200:, 1] = 1.0
    found = path_metrics(recording(flight, reference))
    assert found is not None
    assert found.beyond_m == pytest.approx(0.2)
    assert found.path_max_m == pytest.approx(0.2)
    assert found.max_error_m == pytest.approx(1.0)


def test_a_path_that_rests_is_a_point() -> None:
    flight = np.zeros((2000, 3))
    flight[:, 0] = 0.3
    found = path_metrics(recording(flight, np.zeros((2000, 3))))
    assert found is not None
    assert found.path_rms_m == found.beyond_m == found.rms_error_m == pytest.approx(0.3)


def test_effort_counts_the_ticks_of_each_saturation() -> None:
    bits = LoopStatus.ROLL_SATURATED | LoopStatus.THRUST_SATURATED
    flight = recording(np.zeros((100, 3)), np.zeros((100, 3)), bits)
    flight.status[:75] = 0
    found = effort(flight)
    assert found.saturated_percent == {"roll": 25.0, "pitch": 0.0, "yaw": 0.0, "thrust": 25.0}
    assert found.torque_rms_n_m == pytest.approx((0.3, 0.0, 0.0))


def test_what_a_trajectory_does_not_steer_has_no_figures() -> None:
    flight = recording(np.zeros((100, 3)), np.full((100, 3), math.nan))
    assert set(measure(flight)) == {"roll", "pitch", "yaw"}
    assert path_metrics(flight) is None
