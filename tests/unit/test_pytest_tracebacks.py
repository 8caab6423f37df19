"""Tracebacks of tests that use the fixture ``sitl``."""

from __future__ import annotations

import re

import pytest

from tests.support.plugin_run import load, prepare, run

pytest_plugins = ["pytester"]


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    load()


@pytest.fixture
def outside(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    return prepare(pytester, monkeypatch)


def test_traceback_of_a_bad_argument_ends_at_the_users_line(outside: pytest.Pytester) -> None:
    outside.makepyfile(
        test_it="""
        import pytest

        @pytest.fixture
        def windy(sitl): return sitl(wind=(500.0, 0.0))

        def test_fixture(windy): pass
        def test_name(sitl): sitl(wnd=5.0)
        def test_vehicle(sitl): sitl(vehicle="x_qud")
        def test_plan(sitl): sitl.fly("sqare")
        def test_command(sitl): sitl().command(176, 1.0)
        def test_start(sitl): sitl().start_mission()
        def test_mode(sitl): sitl().set_mode("LOITR")
        def test_parameter(sitl): sitl().param_set("MIS_TAKEOFF_AL", 3.0)
        def test_fault(sitl): sitl().fault("wnd step 5,0,0")
        def test_expression(sitl): sitl().run_until("altitud_m > 1")
        def test_link(sitl): sitl().link.loss(2.0)
        def test_time(sitl): sitl().run_until("altitude_m > 1", timeout_s=0.1)
        def test_property(sitl): sitl.fly("hop", vehicle="x_quad").always("altitude_m < 0.5")

        def test_callback(sitl):
            world = sitl()
            def ask(): world.set_mode("LOITR")
            world.after(0.1, ask)
            world.run_for(0.2)
    """
    )
    result = run(outside, "--tb=short")
    result.assert_outcomes(failed=13, errors=1)
    assert len(ends := last_frames(result)) == 14
    assert {file for file, _ in ends} == {"test_it.py"}
    assert ends[-1] == ("test_it.py", "ask")
    assert "raise ConfigError(" in run(outside, "--full-trace", "-k", "vehicle").stdout.str()


def test_traceback_of_a_defect_shows_all_frames(outside: pytest.Pytester) -> None:
    outside.makepyfile("""
        def test_defect(sitl):
            world = sitl()
            world.after(0.0, None)
            world.run_for(0.1)
    """)
    assert last_frames(run(outside, "--tb=short"))[0][1] == "_call_due"


def test_defects_that_the_stack_raises_show_all_frames(outside: pytest.Pytester) -> None:
    """A wrong row of a log is found by a raise statement, and a method that a dataclass makes has no source."""
    outside.makepyfile("""
        from flightstack.process.clock import TimingReport

        def test_row(sitl, monkeypatch):
            monkeypatch.setattr(TimingReport, "log_fields", lambda self, ticks: {"tikcs": 1})
            sitl().fly("hop")

        def test_frozen(sitl): sitl().setup.seed = 2
        def test_later(): assert True
    """)
    result = run(outside, "--tb=short")
    result.assert_outcomes(failed=2, passed=1)
    assert last_frames(result)[0][0].endswith("flight_log.py")


def last_frames(result: pytest.RunResult) -> list[tuple[str, str]]:
    """Return file and function of the last frame of each traceback, printed with ``--tb=short``."""
    texts = re.split(r"\nE   \S+: ", result.stdout.str())[:-1]
    return [re.findall(r"^(\S+):\d+: in (\w+)$", text, re.MULTILINE)[-1] for text in texts]
