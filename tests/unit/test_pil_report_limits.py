"""Limits from a file, slopes in the verdict, and the checks as JUnit XML."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from flightstack.core.errors import ConfigError
from gcs_cli.pil.compare import Difference, compared
from gcs_cli.pil.flight_samples import FlightSamples
from gcs_cli.pil.junit import pil_junit
from gcs_cli.pil.limits_file import read_limits
from gcs_cli.pil.signals import BY_NAME, SIGNALS
from gcs_cli.pil.ulps import ulp_of
from gcs_cli.pil.verdict import DEFAULT_LIMITS, Limits, difference_checks
from tests.support.flight_samples import flight


def test_limits_of_a_file_replace_the_built_in_ones(tmp_path: Path) -> None:
    file = tmp_path / "limits.toml"
    file.write_text("[flight.torque]\nulp = 7\n[stages.torque]\nrms_ulp = 0.5\nslope_ppm = 1\n")
    limits = read_limits(file)
    assert limits.flight.ulp == {**DEFAULT_LIMITS.flight.ulp, "torque": 7.0}
    assert limits.replay == DEFAULT_LIMITS.replay
    assert limits.stages.ulp == DEFAULT_LIMITS.stages.ulp
    assert limits.stages.rms_ulp == {**DEFAULT_LIMITS.stages.rms_ulp, "torque": 0.5}
    assert limits.stages.slope_ppm["torque"] == 1.0
    assert read_limits(None) is DEFAULT_LIMITS


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[fligth.torque]\nulp = 1\n", "fligth: is not a known key"),
        ("[flight.torqe]\nulp = 1\n", "flight.torqe: is not a signal: use one of target_attitude"),
        ("[flight.torque]\nulps = 1\n", "flight.torque.ulps: is not a known key"),
        (
            "[flight.torque]\nulp = -1\n",
            "flight.torque.ulp: -1 is outside the allowed range 0 to 1000000000000",
        ),
        ("[flight.torque]\nulp = nan\n", "outside the allowed range"),
        ("[flight.torque]\nulp = '7'\n", "flight.torque.ulp: '7' is not a number"),
        ("flight = 3\n", "flight: must be a table"),
        ("[flight]\ntorque = 3\n", "flight.torque: must be a table"),
        ("[flight", "is not valid TOML"),
    ],
)
def test_a_limits_file_with_a_mistake_is_answered_in_one_sentence(
    text: str, words: str, tmp_path: Path
) -> None:
    file = tmp_path / "limits.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_limits(file)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


def varied(gain: float = 1.0, offset: float = 0.0) -> FlightSamples:
    """Return a flight whose torque about y varies, times ``gain`` plus ``offset``."""
    base = flight(ticks=100)
    torque = base.signals["torque"]
    values = np.zeros_like(torque.values)
    values[:, 1] = gain * np.sin(0.1 * np.arange(100)) + offset
    return base._replace(signals={**base.signals, "torque": torque._replace(values=values)})


def of_torque(first: FlightSamples, second: FlightSamples) -> Difference:
    return next(found for found in compared("A–B", first, second) if found.signal == "torque")


def test_slope_and_offset_are_those_of_the_least_squares_line() -> None:
    found = of_torque(varied(), varied(gain=1.01, offset=0.25))
    assert found.line is not None
    assert found.line.component == 1
    assert found.line.slope == pytest.approx(1.01, abs=1e-7)  # float32 has 6e-8
    assert found.line.offset == pytest.approx(0.25, abs=1e-7)
    assert found.slope_ppm == pytest.approx(10_000.0, rel=1e-4)
    row = found.as_json(BY_NAME["torque"])
    assert (row["slope"], row["slope_component"]) == (found.line.slope, 1)


def test_a_signal_that_does_not_vary_has_no_slope() -> None:
    found = of_torque(flight(), flight())
    assert found.line is None
    assert found.as_json(BY_NAME["torque"])["slope"] is None
    limits = Limits({}, {}, {"torque": 1.0})
    assert list(difference_checks("A–B", [found], limits)) == []


def test_a_gain_one_percent_off_fails_the_slope_within_other_limits() -> None:
    found = list(compared("A–B", varied(), varied(gain=1.01)))
    wide = {signal.name: 1e9 for signal in SIGNALS}
    checks = {
        check.name: check for check in difference_checks("A–B", found, Limits(wide, wide, {"torque": 100.0}))
    }
    failed = [check for check in checks.values() if not check.passed]
    assert [check.name for check in failed] == ["A–B wrench slope"]
    assert failed[0].about == "torque 1: slope 1.010000"
    assert checks["A–B wrench rms"].unit == "ulp"


def test_a_failed_check_without_tolerance_is_shown() -> None:
    torque = of_torque(varied(), varied(gain=1.01))
    thrust = torque._replace(signal="thrust", largest=0.5 * ulp_of(torque.full_scale))
    limits = Limits({"torque": 1.1 * torque.ulps, "thrust": 0.0})
    (failed,) = difference_checks("A–B", [torque, thrust], limits)
    assert (failed.passed, failed.measured, failed.limit) == (False, 0.5, 0.0)


def check(name: str, passed: bool, measured: float | None) -> dict[str, Any]:
    return {"name": name, "passed": passed, "measured": measured, "limit": 8.0, "unit": "ulp", "about": "a<b"}


def test_checks_are_written_as_junit_cases() -> None:
    checks = [check("wrench", True, 1.25), check("actuators", False, 9.0), check("target", False, None)]
    root = ElementTree.fromstring(pil_junit({"title": "hop\x00", "checks": checks}, "pil.fly", 1.5))
    (suite,) = root
    assert (suite.get("tests"), suite.get("failures"), suite.get("time")) == ("3", "2", "1.500")
    passed, failed, blank = suite
    assert (passed.get("classname"), passed.get("name")) == ("pil.fly.hop?", "wrench")
    assert passed.find("failure") is None
    assert {p.get("name"): p.get("value") for p in passed.iter("property")} == {
        "measured": "1.25 ulp",
        "limit": "8 ulp",
        "where": "a<b",
    }
    assert failed.find("failure").get("message") == "measured 9 ulp, limit 8 ulp"  # type: ignore[union-attr]
    assert blank.find("failure").get("message") == "measured not a number, limit 8 ulp"  # type: ignore[union-attr]
