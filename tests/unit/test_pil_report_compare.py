"""Comparing two flights: ulps, units, times, signs, and what is left out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_cli.pil.compare import compared, deviation, status_differences, ticks_apart
from gcs_cli.pil.flight_samples import AIRBORNE_M
from gcs_cli.pil.signals import BY_NAME, SIGNALS
from gcs_cli.pil.ulps import steps_apart, ulp_of
from tests.support.flight_samples import changed, flight

floats = st.floats(width=32, allow_nan=False, allow_infinity=False)


def f32(*values: float) -> np.ndarray:
    return np.array(values, np.float32)


@given(floats, st.integers(0, 1000))
def test_steps_count_representable_numbers(start: float, count: int) -> None:
    value = np.float32(start)
    with np.errstate(over="ignore"):  # beyond the largest number is infinity
        for _ in range(count):
            value = np.nextafter(value, np.float32(np.inf))
    if np.isfinite(value):
        assert steps_apart(f32(start), f32(float(value))) == count
        assert steps_apart(f32(float(value)), f32(start)) == count


def test_steps_go_through_zero_and_both_zeros_are_one() -> None:
    tiny = float(np.nextafter(np.float32(0.0), np.float32(1.0)))
    assert steps_apart(f32(-tiny), f32(tiny)) == 2
    assert steps_apart(f32(-0.0), f32(0.0)) == 0


@pytest.mark.parametrize(
    ("magnitude", "ulp"), [(1.0, 2.0**-23), (-1.5, 2.0**-23), (2.0, 2.0**-22), (300.0, 2.0**-15)]
)
def test_an_ulp_is_that_of_float32(magnitude: float, ulp: float) -> None:
    assert ulp_of(magnitude) == ulp


def test_the_same_flight_does_not_differ() -> None:
    found = list(compared("A–B", flight(), flight()))
    assert [each.signal for each in found] == [signal.name for signal in SIGNALS]
    for each in found:
        assert (each.samples, each.largest, each.rms, each.steps) == (9, 0.0, 0.0, 0)
        assert math.isnan(each.at_s)


def test_a_difference_is_found_with_its_place_and_size() -> None:
    other = changed(flight(), "torque", 7, 1, 1.0 + 3.0 * 2.0**-23)
    (found,) = [each for each in compared("A–B", flight(), other) if each.largest]
    assert found.signal == "torque"
    assert found.largest == 3.0 * 2.0**-23
    assert found.rms == pytest.approx(found.largest / math.sqrt(27), rel=1e-12)  # one of nine ticks of three
    assert found.at_s == pytest.approx(0.014)
    assert (found.steps, found.ulps) == (3, 3.0)
    assert found.as_json(BY_NAME["torque"])["unit"] == "N m"


def test_small_signals_are_measured_against_their_least_scale() -> None:
    small = flight()
    zero = small.signals["torque"]._replace(values=np.zeros((10, 3), np.float32))
    small = small._replace(signals={**small.signals, "torque": zero})
    (found,) = [each for each in compared("A–B", small, changed(small, "torque", 3, 0, 1e-9)) if each.largest]
    assert found.full_scale == BY_NAME["torque"].least_scale
    assert found.ulps < 1.0 < found.steps


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_that_is_no_number_is_an_infinite_difference(value: float) -> None:
    other = changed(flight(), "thrust", 4, 0, value)
    (found,) = [each for each in compared("A–B", flight(), other) if each.largest]
    assert found.largest == math.inf
    assert found.as_json(BY_NAME["thrust"])["largest"] is None
    assert not any(each.largest for each in compared("A–B", other, other))


def test_the_negative_of_a_quaternion_is_the_same_attitude_and_of_a_torque_is_not() -> None:
    one = flight()
    for name, differs in (("target_attitude", False), ("torque", True)):
        samples = one.signals[name]
        turned = one._replace(signals={**one.signals, name: samples._replace(values=-samples.values)})
        assert any(each.largest for each in compared("A–B", one, turned)) is differs


def test_only_common_ticks_are_compared_and_the_others_counted() -> None:
    late = flight(start_us=1_004_000)
    found = {each.signal: each for each in compared("A–B", flight(), late)}
    assert found["thrust"].samples == 7  # of ten ticks two came before, and the late one stands in its first
    assert ticks_apart(flight(), late) == 2 + 2  # two before, two after
    assert status_differences(flight(), late) == (1, 8)


def test_touchdown_is_left_out_where_it_is_asked_for() -> None:
    one = changed(flight(), "position", 9, 2, -0.5 * AIRBORNE_M)  # the last tick is on the ground
    other = changed(one, "rates", 9, 0, 2.0)
    assert any(each.largest for each in compared("A–B", one, other))
    in_the_air = list(compared("A–B", one, other, airborne=True))
    assert not any(each.largest for each in in_the_air)
    assert {each.samples for each in in_the_air} == {8}


def test_a_signal_that_one_flight_lacks_is_not_compared() -> None:
    without = flight()
    without = without._replace(signals={name: s for name, s in without.signals.items() if name != "wrench"})
    less = without._replace(signals={name: s for name, s in without.signals.items() if name != "torque"})
    assert "torque" not in {each.signal for each in compared("A–B", without, less)}
    assert deviation(BY_NAME["torque"], without, less).size.shape == (0,)


def test_a_deviation_is_the_largest_component_over_time() -> None:
    other = changed(changed(flight(), "velocity", 5, 0, 1.5), "velocity", 5, 2, 3.0)
    apart = deviation(BY_NAME["velocity"], flight(), other)
    assert apart.size.tolist() == [0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0]
    assert apart.time_s[4] == pytest.approx(0.010)


def test_flights_that_never_flew_together_give_no_figures() -> None:
    other = flight(start_us=9_000_000)
    assert {each.samples for each in compared("A–B", flight(), other)} == {0}
