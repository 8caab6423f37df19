"""The fixture ``sitl`` and the reports of the pytest plugin, in runs of their own."""

from __future__ import annotations

import importlib
import json
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from pyulog import ULog

from gcs_cli.link.tlog import decode_records
from gcs_cli.transfers.plan_files import example_plans
from tests.support.console_blocks import File, steps
from tests.support.plugin_run import PLUGIN, load, prepare, run, section
from tests.support.tools import NIGHTLY

pytest_plugins = ["pytester"]

HEAVY = ("numpy", "numba", "scipy", "pymavlink", "typer", "plotly")
FAILING = """
    import pytest

    @pytest.mark.parametrize("limit_m", [1.5])
    def test_climbs(sitl, limit_m):
        world = sitl(vehicle="x_quad", params={"MIS_TAKEOFF_ALT": 3.0}, seed=7)
        world.takeoff()
        world.run_until(f"altitude_m > {limit_m}", timeout_s=1.0)
"""


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    load()


@pytest.fixture
def outside(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    return prepare(pytester, monkeypatch)


def test_plugin_imports_nothing_heavy() -> None:
    code = (
        "import sys, flightstack.testing.pytest_plugin\n"
        f"print([name for name in sys.modules if name.partition('.')[0] in {HEAVY!r}\n"
        "       or name.startswith('flightstack.') and not name.startswith('flightstack.testing')])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_run_without_fixtures_imports_nothing_heavy(outside: pytest.Pytester) -> None:
    outside.makefile(".toml", settings="[tool.other]\nvalue = 1\n")
    outside.makepyfile(
        f"import sys\ndef test_light(): assert not [name for name in {HEAVY!r} if name in sys.modules]"
    )
    arguments = (*PLUGIN, "-W", "error", "-p", "no:hypothesispytest")
    outside.runpytest_subprocess(*arguments).assert_outcomes(passed=1)


def test_plugin_adds_one_option(outside: pytest.Pytester) -> None:
    text = outside.runpytest_subprocess(*PLUGIN, "--help").stdout.str()
    group = text.partition("flightstack:\n")[2].partition("\n\n")[0]
    assert [line.split()[0] for line in group.splitlines() if line.strip().startswith("-")] == [
        "--sitl-artifacts=DIR"
    ]


def test_worlds_close_with_their_test_or_fixture(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        from pathlib import Path
        import pytest

        def noted(world, name):
            close = world.close
            world.close = lambda: (note(name), close())

        def note(name):
            with Path("closed").open("a") as file:
                file.write(name + " ")

        @pytest.fixture(scope="module")
        def shared(sitl):
            world = sitl()
            noted(world, "shared")
            return world

        @pytest.fixture
        def fresh(sitl):
            noted(sitl(), "fresh")

        def test_own(sitl, shared, fresh):
            noted(sitl(), "own")

        def test_shared(shared):
            assert set(Path("closed").read_text().split()) == {"own", "fresh"}
            shared.arm()
    """)
    run(outside).assert_outcomes(passed=2)
    assert Path("closed").read_text().split()[2:] == ["shared"]


def test_plan_beside_the_test_comes_before_that_of_the_root(outside: pytest.Pytester) -> None:
    plans = example_plans()
    folder = outside.mkdir("sub")
    outside.makeini("[pytest]\n")
    (folder / "mine.plan").write_bytes(plans["hop"].read_bytes())
    (outside.path / "mine.plan").write_bytes(plans["square"].read_bytes())
    (outside.path / "root.plan").write_bytes(plans["square"].read_bytes())
    (folder / "test_plans.py").write_text(
        "def test_plans(sitl):\n"
        "    world = sitl(vehicle='x_quad')\n"
        "    counts = []\n"
        "    for name in ('mine.plan', 'root.plan', 'fenced_square.plan'):\n"
        "        world.upload(name)\n"
        "        counts.append(len(world.download()))\n"
        f"    assert counts == {[len(items_of(plans[name])) for name in ('hop', 'square', 'fenced_square')]}\n"
    )
    run(outside).assert_outcomes(passed=1)


def items_of(path: Path) -> list[object]:
    return list(json.loads(path.read_text())["mission"]["items"])


def test_failed_test_shows_state_seed_setup_and_files(outside: pytest.Pytester) -> None:
    outside.makepyfile(test_it=FAILING)
    result = run(outside)
    result.assert_outcomes(failed=1)
    shown = section(result)
    assert list(shown) == ["state", "texts", "seed", "setup", "files", "repeat"]
    assert shown["state"].startswith("t = 2.1")  # 1.1 s until it is ready
    assert shown["texts"].splitlines()[0] == "Armed"
    assert shown["seed"] == "7"
    assert shown["setup"] == "sitl(vehicle='x_quad', params={'MIS_TAKEOFF_ALT': 3.0}, seed=7)"
    assert shown["repeat"] == "pytest 'test_it.py::test_climbs[1.5]'"
    assert ">       world.run_until(" in result.stdout.str()
    assert "raise ConditionTimeoutError" not in result.stdout.str()  # the failure is the user's line


def test_files_of_a_failed_test_are_readable(outside: pytest.Pytester) -> None:
    outside.makepyfile(FAILING)
    log, tlog, report = map(Path, section(run(outside))["files"].splitlines())
    assert ULog(str(log)).get_dataset("vehicle_local_position").data["z"].min() < -0.1
    times_us = [record.time_us for record in decode_records(tlog.read_bytes())]
    assert times_us == sorted(times_us)
    assert 2.0e6 <= times_us[-1] <= 2.2e6
    assert "did not come true within 1 s" in report.read_text()
    assert log.is_relative_to(outside.path / ".pytest_cache")


def test_repeat_command_repeats_the_failed_test_alone(outside: pytest.Pytester) -> None:
    outside.makepyfile(FAILING + "\n    def test_other(): assert False\n")
    shown = section(run(outside))
    program, *arguments = shlex.split(shown["repeat"])
    assert program == "pytest"
    run(outside, *arguments).assert_outcomes(failed=1)


def test_last_failed_repeats_the_failed_flight(outside: pytest.Pytester) -> None:
    outside.makepyfile(FAILING + "\n    def test_other(sitl): sitl()\n")
    run(outside).assert_outcomes(failed=1, passed=1)
    run(outside, "--lf").assert_outcomes(failed=1)


def test_artifacts_option_takes_a_folder_for_each_test(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest

        @pytest.mark.parametrize("name", ["a/b", "a b", "a-b", "x" * 300])
        def test_fails(sitl, name):
            sitl().arm()
            assert False
    """)
    run(outside, "--sitl-artifacts", "kept").assert_outcomes(failed=4)
    folders = sorted((outside.path / "kept").iterdir())
    assert len(folders) == 4
    assert all((folder / "report.html").exists() for folder in folders)
    assert all(len(folder.name) < 100 for folder in folders)


@pytest.mark.skipif(not NIGHTLY, reason="20 s; parallel workers of real processes are tested each time")
def test_parallel_workers_write_into_one_directory(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest

        @pytest.mark.parametrize("number", range(2))
        def test_fails(sitl, number, worker_id):
            sitl(seed=number).arm()
            assert worker_id == "none"
    """)
    result = outside.runpytest_subprocess(*PLUGIN, "-n", "2", "--sitl-artifacts", "kept", "-W", "error")
    result.assert_outcomes(failed=2)
    assert len(list((outside.path / "kept").glob("*/flight.ulg"))) == 2
    assert section(result)["repeat"].startswith("pytest 'test_parallel_workers")


def test_junit_report_has_the_paths(outside: pytest.Pytester) -> None:
    outside.makepyfile(FAILING)
    run(outside, "--junit-xml=junit.xml", "-o", "junit_family=xunit1")
    properties = {item.get("name"): item.get("value") for item in ET.parse("junit.xml").iter("property")}
    assert set(properties) == {"flightstack_log", "flightstack_tlog", "flightstack_report"}
    assert all(Path(str(path)).is_file() for path in properties.values())


def test_html_report_links_the_files(outside: pytest.Pytester) -> None:
    """With a stand-in for pytest-html, of its public function ``extras.url``."""
    outside.makeconftest("""
        import sys, types
        extras = types.SimpleNamespace(url=lambda content, name: (name, content))
        sys.modules["pytest_html"] = types.SimpleNamespace(extras=extras)

        def pytest_configure(config):
            config.pluginmanager.register(types.ModuleType("html"), "html")

        def pytest_runtest_logreport(report):
            for name, url in getattr(report, "extras", []):
                print("link", name, url)
    """)
    outside.makepyfile(FAILING)
    result = run(outside, "-s")
    result.stdout.fnmatch_lines(
        ["*link log file:///*.ulg", "link tlog file:///*", "link report file:///*.html"]
    )


def test_failed_fixture_is_reported(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest

        @pytest.fixture
        def flying(sitl):
            world = sitl(seed=4)
            world.run_until("altitude_m > 1", timeout_s=0.1)

        def test_flies(flying): pass
    """)
    result = run(outside)
    result.assert_outcomes(errors=1)
    assert section(result)["seed"] == "4"


def test_failed_test_shows_the_world_of_its_fixture(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest

        @pytest.fixture(scope="module")
        def shared(sitl):
            return sitl(seed=5)

        def test_passes(sitl): sitl(seed=6)
        def test_fails(shared): assert False
    """)
    assert section(run(outside))["seed"] == "5"


def test_tests_without_a_flight_have_no_section(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest

        def test_plain(): assert False

        def test_without_world(sitl): assert False

        @pytest.mark.xfail(strict=True)
        def test_expected(sitl):
            sitl().arm()
            assert False

        def test_passes(sitl): sitl().arm()
    """)
    result = run(outside, "--sitl-artifacts", "kept")
    result.assert_outcomes(failed=2, passed=1, xfailed=1)
    assert not section(result)
    assert not Path("kept").exists()


def test_directory_that_cannot_be_written_is_reported(outside: pytest.Pytester) -> None:
    outside.makepyfile(FAILING)
    Path("kept").write_text("a file")
    result = run(outside, "--sitl-artifacts", "kept")
    result.assert_outcomes(failed=1)
    shown = section(result)
    assert shown["files"].startswith("none: ")
    assert shown["repeat"]


def test_wind_of_a_failing_flight_shrinks(outside: pytest.Pytester) -> None:
    """Each example has a world of its own; that of the smallest failing wind is kept."""
    outside.makepyfile("""
        from hypothesis import given, settings, strategies as st

        worlds = []

        @settings(derandomize=True, database=None, max_examples=10, deadline=None)
        @given(wind=st.integers(0, 40))
        def test_stands(sitl, wind):
            assert not any(not world.closed for world in worlds)
            world = sitl(vehicle="x_quad", wind=(float(wind), 0.0))
            world.closed, close = False, world.close
            def noted():
                world.closed = True
                close()
            world.close = noted
            worlds.append(world)
            world.arm()
            world.run_for(0.1)
            assert wind < 13
    """)
    result = run(outside, "--sitl-artifacts", "kept")
    result.assert_outcomes(failed=1)
    assert section(result)["setup"] == "sitl(vehicle='x_quad', wind=(13.0, 0.0), seed=1)"
    assert len(list(Path("kept").iterdir())) == 1
    result.stdout.fnmatch_lines(["E * wind=13,"])


def test_fixture_serves_unittest_cases(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import unittest
        import pytest

        class TestVehicle(unittest.TestCase):
            @pytest.fixture(autouse=True)
            def _worlds(self, sitl):
                self.sitl = sitl

            def test_arms(self):
                self.sitl().arm()

            def test_fails(self):
                self.sitl(seed=9).arm()
                self.fail("as expected")
    """)
    result = run(outside)
    result.assert_outcomes(passed=1, failed=1)
    assert section(result)["seed"] == "9"


def test_setup_and_conditions_exclude_each_other(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        import pytest
        from flightstack.testing import Setup

        def test_both(sitl):
            assert sitl(Setup(seed=2)).setup.seed == 2
            with pytest.raises(TypeError, match="not both"):
                sitl(Setup(), seed=2)
    """)
    run(outside).assert_outcomes(passed=1)


def test_world_options_reach_the_world(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        def test_telemetry(sitl):
            slow, fast = sitl(), sitl(telemetry=True)
            for world in (slow, fast):
                world.run_for(1.0)
            assert fast.gcs.counts["ATTITUDE"] > 5 * slow.gcs.counts["ATTITUDE"]
    """)
    run(outside).assert_outcomes(passed=1)


def test_examples_of_the_page_pass(outside: pytest.Pytester) -> None:
    page = Path(__file__).parents[2] / "docs" / "how-to" / "pytest.md"
    for step in steps(page):
        assert isinstance(step, File)
        (outside.path / step.name).write_text(step.text)
    run(outside).assert_outcomes(passed=5)


@pytest.mark.parametrize("name", ["flightstack", "sim_bridge", "gcs_cli"])
def test_package_may_be_imported_before_pytest(name: str) -> None:
    """pytest marks all packages of a plugin's distribution for rewriting, and warns of those imported before."""
    assert "PYTEST_DONT_REWRITE" in str(importlib.import_module(name).__doc__)
