"""Expressions over signals: their margin, what is allowed, and that one state is judged as a whole flight is."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.enums import Mode
from flightstack.core.errors import ConfigError
from flightstack.testing.expression import SIGNALS, SMALLEST, Expression
from tests.support.truth import World

INF = math.inf


def margin(text: str, **signals: object) -> list[float]:
    found: list[float] = Expression(text).margin({name: np.array(v) for name, v in signals.items()}).tolist()
    return found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("altitude_m < 12", [2.0, -3.0]),
        ("altitude_m >= 12", [-2.0, 3.0]),
        ("not altitude_m < 12", [-2.0, 3.0]),
        ("5 < altitude_m < 12", [2.0, -3.0]),
        ("altitude_m > 9 and climb_m_s < 3", [1.0, 1.0]),
        ("altitude_m > 14 or climb_m_s < 3", [2.0, 1.0]),
        ("altitude_m == 10", [SMALLEST, -5.0]),
        ("altitude_m != 10", [-SMALLEST, 5.0]),
        ("abs(climb_m_s - 2) + 1 < 2", [-SMALLEST, 1.0]),
        ("min(altitude_m, 12, 11) > max(1, climb_m_s) * 2", [8.0, 7.0]),
        ("hypot(climb_m_s * 3, 4 * climb_m_s) <= sqrt(100)  / 2", [SMALLEST, -5.0]),
        ("-altitude_m < -1", [9.0, 14.0]),
    ],
)
def test_margin_is_the_distance_from_the_other_truth(text: str, expected: list[float]) -> None:
    assert margin(text, altitude_m=[10.0, 15.0], climb_m_s=[1.0, 2.0]) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("mode == 'LAND'", [INF, -INF]),
        ("mode != 'LAND'", [-INF, INF]),
        ("armed", [INF, -INF]),
        ("not armed and mode == 'HOLD'", [-INF, INF]),
        ("armed == True", [INF, -INF]),
        ("mode == 'LAND' or item < 3", [INF, -1.0]),
    ],
)
def test_modes_and_flags_have_an_infinite_margin(text: str, expected: list[float]) -> None:
    assert margin(text, mode=["LAND", "HOLD"], armed=[True, False], item=[4, 4]) == expected


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("item < 3", False), ("item <= 3", True), ("item > 3", False), ("item >= 3", True),
        ("item == 3", True), ("item != 3", False), ("not item == 3", False), ("not item <= 3", False),
        ("not item != 3", True), ("not item < 3", True),
    ],
)  # fmt: skip
def test_equal_values_hold_only_where_the_comparison_does(text: str, holds: bool) -> None:
    assert (margin(text, item=[3])[0] > 0.0) is holds


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("error_m < 1", -INF),
        ("not error_m < 1", -INF),
        ("error_m < 1 or altitude_m > 2", 1.0),
        ("error_m < 1 and altitude_m > 2", -INF),
        ("not (error_m < 1 and altitude_m < 2)", 1.0),
        ("sqrt(0 - altitude_m) < 1", -INF),
        ("altitude_m / (altitude_m - altitude_m) < 1", -INF),
    ],
)
def test_unknown_values_count_as_a_violation(text: str, expected: float) -> None:
    assert margin(text, error_m=[math.nan], altitude_m=[3.0]) == [expected]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("height < 3", "unknown name height; known are time_s, mode, armed, landed"),
        ("abs < 3", "unknown name abs"),
        ("mode == 'FLY'", "no mode 'FLY'; modes are HOLD, TAKEOFF, MISSION"),
        ("mode < 3", "a mode (mode) instead of a number"),
        ("altitude_m == 'LAND'", "a mode ('LAND') instead of a number"),
        ("armed + 1 > 1", "a condition (armed) instead of a number"),
        ("not altitude_m", "a number (altitude_m) instead of a condition"),
        ("altitude_m", "is a number, not a condition"),
        ("mode", "is a mode, not a condition"),
        ("open('x') < 1", "may call abs, sqrt, hypot, min, max only"),
        ("min(altitude_m) < 1", "min with 1 arguments instead of 2 or more"),
        ("abs(1, 2) < 1", "abs with 2 arguments instead of 1"),
        ("abs(x=1) < 1", "may call"),
        ("altitude_m.real < 1", "Attribute, which is not allowed"),
        ("[altitude_m] == 1", "List, which is not allowed"),
        ("(lambda: 1) == 1", "Lambda, which is not allowed"),
        ("altitude_m in (1, 2)", "Compare, which is not allowed"),
        ("altitude_m < 1j", "1j, which is neither a number nor a text"),
        ("altitude_m < 1" + "0" * 400, "neither a number"),
        ("altitude_m <", "is not valid"),
        ("", "is not valid"),
        ("(" * 5000, "is not valid"),
        ("altitude_m < 1\0", "is not valid"),
    ],
)
def test_expression_that_is_not_allowed_says_what_is(text: str, reason: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Expression(text)
    assert reason in str(caught.value)


NUMBERS = st.one_of(st.floats(-20, 20), st.integers(-3, 3).map(float), st.just(math.nan))
COMPARISONS = st.builds(
    "{} {} {}".format,
    st.sampled_from(["altitude_m", "abs(climb_m_s)", "error_m - 1", "min(altitude_m, error_m)"]),
    st.sampled_from(["<", "<=", ">", ">=", "==", "!="]),
    st.one_of(st.integers(-3, 3).map(str), st.just("climb_m_s")),
)
CONDITIONS = st.recursive(
    st.one_of(COMPARISONS, st.sampled_from(["armed", "mode == 'LAND'", "mode != 'HOLD'"])),
    lambda parts: st.one_of(
        st.builds("not ({})".format, parts),
        st.builds("({}) and ({})".format, parts, parts),
        st.builds("({}) or ({})".format, parts, parts),
    ),
    max_leaves=6,
)
STATES = st.builds(
    SimpleNamespace,
    altitude_m=NUMBERS, climb_m_s=NUMBERS, error_m=NUMBERS, armed=st.booleans(),
    mode=st.sampled_from(list(Mode.__members__)),
)  # fmt: skip


@given(text=CONDITIONS, states=st.lists(STATES, min_size=1, max_size=5))
def test_a_state_is_judged_as_a_flight_is(text: str, states: list[SimpleNamespace]) -> None:
    expression = Expression(text)
    names = ("altitude_m", "climb_m_s", "error_m", "armed", "mode")
    signals = {name: np.array([getattr(state, name) for state in states]) for name in names}
    found = (expression.margin(signals) > 0.0).tolist()
    assert found == [expression.of_state(state) for state in states]


@given(text=CONDITIONS, state=STATES)
def test_truth_is_that_of_python_where_all_is_known(text: str, state: SimpleNamespace) -> None:
    values = vars(state)
    if not any(math.isnan(value) for value in values.values() if isinstance(value, float)):
        expected = eval(text, {"abs": abs, "min": min}, dict(values))
        assert Expression(text).of_state(state) is bool(expected)


def test_every_signal_is_an_attribute_of_the_state() -> None:
    with World() as world:
        missing = [name for name in SIGNALS if not hasattr(world.state, name)]
    assert not missing


@pytest.mark.parametrize(
    ("text", "margin", "limit"),
    [
        ("mode == 'HOLD' and altitude_m < 5", 2.0, 5.0),
        ("armed == True and 5 > altitude_m", 2.0, 5.0),
        ("mode == 'HOLD'", INF, None),
        ("armed or altitude_m < 5", INF, None),
    ],
)
def test_limit_is_that_of_the_comparison_of_numbers(text: str, margin: float, limit: float | None) -> None:
    assert Expression(text).limit({"mode": "HOLD", "armed": True, "altitude_m": 3.0}, margin) == limit
