"""Properties of signals against definitions in plain loops, and against rtamt, an independent implementation."""

from __future__ import annotations

import math
import sys
import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.errors import ConfigError
from flightstack.testing import properties
from flightstack.testing.expression import SMALLEST
from flightstack.testing.properties import PropertyViolationError, Signals, Window, parse_window

STEP_S = 0.02
PAIRS = st.lists(st.tuples(st.floats(-9, 9, width=16), st.floats(-9, 9, width=16)), min_size=1, max_size=40)


def signals(altitude_m: list[float], climb_m_s: list[float] | None = None, **events: list[float]) -> Signals:
    values = {"altitude_m": np.array(altitude_m, float)}
    if climb_m_s is not None:
        values["climb_m_s"] = np.array(climb_m_s, float)
    return Signals(np.arange(len(altitude_m)) * STEP_S, values, events)


def both(pairs: list[tuple[float, float]]) -> tuple[Signals, list[float], list[float]]:
    a, b = [float(pair[0]) for pair in pairs], [float(pair[1]) for pair in pairs]
    return signals(a, b), a, b


# ---------------------------------------------------------------------- definitions


@given(PAIRS)
def test_always_is_the_smallest_margin(pairs: list[tuple[float, float]]) -> None:
    flown, a, _ = both(pairs)
    found = properties.always(flown, "altitude_m >= 1")
    assert found.margin == min(value - 1.0 for value in a)
    assert found.holds is all(value >= 1.0 for value in a)
    violations = [index for index, value in enumerate(a) if value < 1.0]
    at = violations[0] if violations else a.index(min(a))
    assert found.time_s == pytest.approx(at * STEP_S)


@given(PAIRS)
def test_eventually_is_the_largest_margin(pairs: list[tuple[float, float]]) -> None:
    flown, a, _ = both(pairs)
    found = properties.eventually(flown, "altitude_m >= 1")
    assert found.margin == max(value - 1.0 for value in a)
    assert found.holds is any(value >= 1.0 for value in a)


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("altitude_m < 5", 5.0),
        ("5 > altitude_m", 5.0),
        ("altitude_m < 2 * (1 + 1.5)", 5.0),
        ("altitude_m < 5 and climb_m_s < 9", 5.0),  # margins 1 and 8
        ("altitude_m < 50 and abs(climb_m_s) < 1.5", 1.5),  # margins 46 and 0.5
        ("-3 < climb_m_s < 1.25", 1.25),
        ("not altitude_m > 4.5", 4.5),
        ("altitude_m > climb_m_s", None),
        ("altitude_m - 5 < climb_m_s", None),
        ("altitude_m < 6 or climb_m_s < 0.5", 6.0),
    ],
)
def test_limit_of_a_margin_is_that_of_its_comparison(text: str, limit: float | None) -> None:
    flown = signals([3.0, 4.0, 2.0], [1.0, 1.0, 1.0])
    assert properties.always(flown, text).limit == limit


def test_limit_of_a_violation_is_that_of_the_worst_sample() -> None:
    flown = signals([3.0, 9.0, 4.0], [0.0, 0.0, 7.0])
    found = properties.always(flown, "altitude_m < 8 and climb_m_s < 2")
    assert (found.margin, found.limit) == (-5.0, 2.0)
    assert found.time_s == pytest.approx(STEP_S)  # the first violation
    found = properties.eventually(flown, "altitude_m > 8.5 and climb_m_s < 6")
    assert (found.margin, found.limit) == (0.5, 8.5)
    assert properties.always(flown, "altitude_m >= 3").limit == 3.0  # a margin of 0


@given(PAIRS)
def test_until_is_the_best_end_with_all_before_it(pairs: list[tuple[float, float]]) -> None:
    flown, a, b = both(pairs)
    expected = max(min([b[end], *a[:end]]) for end in range(len(a)))
    assert properties.until(flown, "altitude_m >= 0", "climb_m_s >= 0").margin == expected


@given(PAIRS, st.integers(0, 50))
def test_within_looks_at_every_sample_up_to_the_limit(pairs: list[tuple[float, float]], samples: int) -> None:
    flown, a, b = both(pairs)
    expected = min(max(-a[at], *b[at : at + samples + 1]) for at in range(len(a)))
    found = properties.within(flown, "altitude_m >= 0", "climb_m_s >= 0", samples * STEP_S)
    assert found.margin == pytest.approx(expected, abs=SMALLEST)


@given(PAIRS, st.lists(st.integers(0, 39), min_size=1, max_size=3), st.integers(0, 20))
def test_windows_count_from_each_event(pairs: list[tuple[float, float]], at: list[int], samples: int) -> None:
    _, a, _ = both(pairs)
    begins = [min(index, len(a) - 1) for index in at]
    flown = signals(a, cut=[index * STEP_S for index in begins])
    window = Window("cut", (samples + 0.5) * STEP_S)
    parts = [a[begin : begin + samples + 1] for begin in begins]
    assert properties.always(flown, "altitude_m >= 0", window).margin == min(min(part) for part in parts)
    assert properties.eventually(flown, "altitude_m >= 0", window).margin == min(max(part) for part in parts)


def test_within_without_a_limit_looks_to_the_end() -> None:
    flown = signals([1.0, -1.0, -1.0, -1.0], [-1.0, -1.0, -1.0, 2.0])
    found = properties.within(flown, "altitude_m > 0", "climb_m_s > 0", math.inf)
    assert found.margin == 2.0


# ---------------------------------------------------------------------- rtamt


@cache
def specification(formula: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its parser imports typing.io
        import rtamt  # noqa: PLC0415  # 0.2 s, for a test of the long runs only
    spec = rtamt.StlDiscreteTimeSpecification()
    spec.declare_var("a", "float")
    spec.declare_var("b", "float")
    spec.spec = formula
    spec.parse()
    return spec


def robustness(formula: str, a: list[float], b: list[float]) -> Any:
    """Return rtamt's robustness at the first sample; that of equal values is 0 in it, and in ours ±SMALLEST."""
    values = specification(formula).evaluate({"time": list(range(len(a))), "a": a, "b": b})
    return pytest.approx(values[0][1], abs=SMALLEST)


@pytest.mark.skipif(
    sys.version_info >= (3, 13), reason="rtamt's parser needs typing.io, which Python 3.13 removed"
)
@given(PAIRS.filter(lambda pairs: len(pairs) > 1), st.sampled_from([1, 4]))
def test_margins_equal_those_of_rtamt(pairs: list[tuple[float, float]], samples: int) -> None:
    flown, a, b = both(pairs)
    x, y = "altitude_m >= 0", "climb_m_s >= 0"
    assert properties.always(flown, x).margin == robustness("always(a >= 0)", a, b)
    assert properties.eventually(flown, f"{x} and not {y}").margin == robustness(
        "eventually((a >= 0) and (not(b >= 0)))", a, b
    )
    assert properties.until(flown, x, y).margin == robustness("(a >= 0) until (b >= 0)", a, b)
    assert properties.within(flown, x, y, samples * STEP_S).margin == robustness(
        f"always((a >= 0) -> (eventually[0:{samples}](b >= 0)))", a, b
    )


# ---------------------------------------------------------------------- closed forms


def test_margin_of_a_sine_is_that_of_its_peak() -> None:
    time_s = np.arange(0.0, 10.0, STEP_S)
    flown = Signals(time_s, {"altitude_m": 3.0 + np.sin(time_s)}, {})
    assert properties.always(flown, "altitude_m < 5").margin == pytest.approx(
        1.0, abs=1e-4
    )  # between samples
    found = properties.always(flown, "altitude_m < 3.5")
    assert found.margin == pytest.approx(-0.5, abs=1e-4)
    assert math.asin(0.5) <= found.time_s <= math.asin(0.5) + STEP_S


# ---------------------------------------------------------------------- texts


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("altitude_m < 12", ("altitude_m < 12", Window())),
        ("altitude_m < 12 after takeoff", ("altitude_m < 12", Window("takeoff"))),
        ("armed within 2.5 s", ("armed", Window(None, 2.5))),
        ("armed within .5s of mode_RETURN", ("armed", Window("mode_RETURN", 0.5))),
        ("landed within 20 s after failsafe_GCS_LOST", ("landed", Window("failsafe_GCS_LOST", 20.0))),
    ],
)
def test_window_is_read_from_the_end_of_the_text(text: str, expected: tuple[str, Window]) -> None:
    assert parse_window(text) == expected


@pytest.mark.parametrize(
    "text", ["armed within 1.2.3 s", "armed within . s of takeoff", "armed after", "armed of x y"]
)
def test_malformed_window_is_an_error_of_the_expression(text: str) -> None:
    with pytest.raises(ConfigError, match="is not valid"):
        properties.always(signals([1.0]), *parse_window(text))


def test_unknown_event_names_those_of_the_flight() -> None:
    with pytest.raises(ConfigError, match="did not happen in this flight; its events are takeoff, landing"):
        properties.always(signals([1.0], takeoff=[0.0], landing=[0.0]), "altitude_m > 0", Window("cut"))


def test_violation_shows_the_values_around_it() -> None:
    flown = signals([1.0, 2.0, 3.0, 2.0], climb_m_s=[0.0, 0.5, 0.25, 0.0])
    error = PropertyViolationError(properties.always(flown, "altitude_m < 2.5 and climb_m_s < 1"))
    first, *rows = str(error).splitlines()
    assert first == "always altitude_m < 2.5 and climb_m_s < 1: violated at t = 0.04 s by 0.5"
    assert rows[2] == "> t =    0.04 s: altitude_m = 3.000, climb_m_s = 0.250"
    assert [row[0] for row in rows].count(">") == 1


def test_violation_by_equal_values_says_so() -> None:
    error = PropertyViolationError(properties.always(signals([3.0]), "altitude_m < 3"))
    assert str(error).splitlines()[0] == "always altitude_m < 3: violated at t = 0.00 s, at the limit"
