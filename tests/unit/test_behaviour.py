"""Parameters of guidance and commander: declared once, PX4's names, and one sentence when one cannot be."""

from __future__ import annotations

import math
import re

import pytest

from flightstack.core.errors import ConfigError
from flightstack.guidance.params import guidance_params
from flightstack.params.behaviour import SPECS, Behaviour, with_assignments


def test_every_parameter_has_a_wire_name_a_range_that_holds_its_default_and_a_line_of_help() -> None:
    assert len(SPECS) == len(Behaviour().by_name())
    for name, spec in SPECS.items():
        assert re.fullmatch(r"[A-Z0-9_]{1,16}", name), "PARAM_VALUE holds 16 characters"
        assert spec.low <= spec.default <= spec.high
        assert spec.low < spec.high
        assert spec.help[0].isupper()
        assert spec.name == name


def test_a_change_is_a_copy() -> None:
    before = Behaviour()
    after = before.updated("MPC_XY_CRUISE", 7.0)
    assert (before.cruise_speed_m_s, after.cruise_speed_m_s) == (4.0, 7.0)
    assert after.by_name()["MPC_XY_CRUISE"] == 7.0
    assert after.updated("MPC_XY_CRUISE", 4.0) == before


def test_ranges_include_their_ends_and_nothing_beyond() -> None:
    for name, spec in SPECS.items():
        for end in (spec.low, spec.high):
            assert Behaviour().updated(name, end).by_name()[name] == end, name
        beyond = (spec.low - 0.01, spec.high + 0.01, math.nan, math.inf, -math.inf)
        sentence = rf"^parameter: {name}: \S+ is outside {spec.low:g} to {spec.high:g}"
        for value in beyond:
            with pytest.raises(ConfigError, match=sentence):
                pytest.fail(f"{name} is {Behaviour().updated(name, value).by_name()[name]}")


def test_assignments_are_read_in_order_and_in_any_case() -> None:
    changed = with_assignments(Behaviour(), ["mpc_xy_cruise=3", "NAV_ACC_RAD = 1.5", "MPC_XY_CRUISE=5"])
    assert (changed.cruise_speed_m_s, changed.acceptance_radius_m) == (5.0, 1.5)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("MPC_XY_CRUISE", "--param: MPC_XY_CRUISE must be NAME=VALUE with a number"),
        ("MPC_XY_CRUISE=fast", "--param: MPC_XY_CRUISE=fast must be NAME=VALUE with a number"),
        ("=3", "--param: =3 must be NAME=VALUE with a number"),
        ("NO_SUCH=3", "parameter: NO_SUCH: is not known"),
        ("MPC_XY_CRUISE=99", "parameter: MPC_XY_CRUISE: 99 is outside 0.1 to 20 m/s"),
        ("MPC_XY_CRUISE=nan", "parameter: MPC_XY_CRUISE: nan is outside 0.1 to 20 m/s"),
    ],
)
def test_assignments_that_cannot_be(text: str, sentence: str) -> None:
    with pytest.raises(ConfigError) as error:
        with_assignments(Behaviour(), [text])
    assert str(error.value) == sentence


def test_guidance_gets_radians_and_no_more_acceleration_than_the_jerk_sheds_in_time() -> None:
    p = guidance_params(Behaviour(), 5.4)
    assert (p.yaw_rate_rad_s, p.yaw_acceptance_rad) == (math.radians(60.0), math.radians(12.0))
    assert (p.acceleration_m_s2, p.vertical_acceleration_m_s2, p.weight_n) == (3.0, 3.0, 5.4)
    gentle = guidance_params(Behaviour().updated("MPC_JERK_AUTO", 3.0), 5.4)
    assert (gentle.acceleration_m_s2, gentle.vertical_acceleration_m_s2) == (1.0, 1.0)
