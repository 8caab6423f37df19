"""Scenario files as tests of pytest."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.plugin_run import load, prepare, run, section

pytest_plugins = ["pytester"]

WIND = """
vehicle = "x_quad"
plan = "hop"
seed = 4
repeat = 2
[expect]
always = ["altitude_m < {limit_m}"]
"""


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    load()


@pytest.fixture
def outside(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    return prepare(pytester, monkeypatch)


def test_scenario_file_has_a_test_for_each_seed(outside: pytest.Pytester) -> None:
    outside.makefile(".toml", wind=WIND.format(limit_m=50), other='[tool]\ntext = "expect"\n')
    Path("broken.toml").write_text("[expect\n")
    result = run(outside, "-v")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["wind.toml::seed=4 PASSED*", "wind.toml::seed=5 PASSED*"])


def test_failed_scenario_shows_expectation_and_commands(outside: pytest.Pytester) -> None:
    outside.makefile(".toml", wind=WIND.format(limit_m=0.5))
    result = run(outside, "wind.toml::seed=5", "--sitl-artifacts", "kept")
    result.assert_outcomes(failed=1)
    shown = section(result)
    assert shown["seed"] == "5"
    assert shown["fly"].startswith("gcs test ")
    assert shown["repeat"] == "pytest wind.toml::seed=5"
    log, report = map(Path, shown["files"].splitlines())
    assert log.stat().st_size > 1000
    assert "wind" in report.read_text()
    result.stdout.fnmatch_lines(["wind, seed 5: *altitude_m < 0.5*"])
    assert "Traceback" not in result.stdout.str()


def test_error_in_a_scenario_file_names_the_key(outside: pytest.Pytester) -> None:
    outside.makefile(".toml", wind=WIND.format(limit_m=0.5) + "altitude = 3\n")
    result = run(outside)
    result.assert_outcomes(errors=1)
    assert "altitude" in result.stdout.str()


def test_scenarios_outside_the_collected_directories_are_left_alone(outside: pytest.Pytester) -> None:
    outside.mkdir("missions")
    outside.mkdir("tests")
    Path("missions/wind.toml").write_text(WIND.format(limit_m=0.5))
    Path("tests/test_one.py").write_text("def test_one(): pass\n")
    run(outside, "tests").assert_outcomes(passed=1)
