"""Parts of scenario files that need no flight, or a short one."""

from __future__ import annotations

from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.plan import Command, MissionItem, Plan
from flightstack.testing.expectations import Check
from flightstack.testing.expression import Expression
from flightstack.testing.log import Log
from flightstack.testing.orders import check_command, order
from flightstack.testing.properties import parse_window
from flightstack.testing.scenario import load_scenario
from flightstack.testing.scenario_run import run_scenario
from tests.support.truth import World

DRAINED = 'plan = "hop.plan"\nbattery_percent = 10.0\n[expect]\n'


def scenario(folder: Path, text: str) -> Path:
    path = folder / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("event", ["mode_RETURN", "failsafe_GCS_LOST", "link_cut"])
def test_window_names_events_with_capitals(event: str) -> None:
    assert parse_window(f"altitude_m > 1 within 3 s of {event}")[1].event == event


def test_log_without_bytes_has_no_topics() -> None:
    assert not Log(b"")


def test_refused_start_is_judged_by_its_reason(tmp_path: Path) -> None:
    path = scenario(tmp_path, DRAINED + 'refusal = "the battery is low"\n')
    assert run_scenario(load_scenario(path)).passed


def test_expectation_of_a_flight_fails_without_one(tmp_path: Path) -> None:
    path = scenario(tmp_path, DRAINED + 'outcome = "any"\nalways = ["altitude_m < 9"]\n')
    assert "did not arm" in run_scenario(load_scenario(path)).failures[0]


HOVER = """vehicle = "x_quad"
{end}
[[event]]
at_s = 0.1
command = "takeoff 2"
[[event]]
at_s = 0.2
command = "arm"
[[event]]
at_s = 4.0
command = "land"
[expect]
"""


@pytest.mark.parametrize(("end_s", "landed"), [(5.0, False), (40.0, True)])
def test_mode_as_outcome_needs_a_landing(tmp_path: Path, end_s: float, landed: bool) -> None:
    """The landing begins at 4 s, above 1 m."""
    path = scenario(tmp_path, HOVER.format(end=f"duration_s = {end_s}") + 'outcome = "LAND"\n')
    verdict = run_scenario(load_scenario(path))
    assert verdict.passed is landed, verdict.failures
    assert landed or verdict.failures == ["outcome LAND: it ended in mode LAND without a landing"]


def test_share_of_a_limit_of_zero_is_unknown() -> None:
    assert Check("always climb_m_s > 0", True, "holds", 0.3, 0.0).share is None


def test_idle_loop_is_refused_at_once() -> None:
    jump = MissionItem(Command.DO_JUMP, 2, param1=0.0, param2=-1.0)
    speed = MissionItem(Command.DO_CHANGE_SPEED, 2, param1=1.0, param2=3.0)
    land = MissionItem(Command.NAV_LAND, 3)
    with World() as world:
        assert "holds no item to fly" in world.fly(Plan((speed, jump, land))).outcome_text


def test_state_cannot_be_dropped_in_lockstep() -> None:
    with World() as world, pytest.raises(ConfigError, match="impossible in lockstep"):
        world.fault("state dropped")


def test_failsafe_is_a_signal_of_the_state() -> None:
    with World() as world:
        assert Expression("not failsafe").of_state(world.state)


@pytest.mark.parametrize("text", ["sticks 0 0 0", "setpoint 1 2", "silence 1", "mav_cmd", "velocity a b c"])
def test_order_with_wrong_numbers_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="is none of"):
        check_command(text)


def test_stream_replaces_the_one_before_it() -> None:
    with World() as world:
        order(world, "sticks 0.5 -1 0 0", world.gcs)
        sent = world.gcs.streams["sticks"]()
        assert (sent.x, sent.y, sent.z, sent.r) == (500, -1000, 500, 0)
        order(world, "setpoint 1 2 3", world.gcs)
        assert list(world.gcs.streams) == ["setpoint"]
        target = world.gcs.streams["setpoint"]()
        assert (target.x, target.y, target.z, target.coordinate_frame) == (
            1,
            2,
            -3,
            mavlink.MAV_FRAME_LOCAL_NED,
        )
        order(world, "silence", world.gcs)
        assert not world.gcs.streams


def test_log_marks_the_failsafe_as_long_as_it_acts() -> None:
    with World(params={"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5, "COM_FAIL_ACT_T": 2}) as world:
        world.takeoff(3.0)
        world.run_until("mode == 'HOLD' and altitude_m > 2.9")
        world.goto(15.0, 0.0)
        world.link.cut()
        world.run_until("failsafe and mode == 'RETURN'", timeout_s=10.0)
        world.run_for(2.0)
        world.link.restore()
        world.run_until("not failsafe", timeout_s=3.0)
        flight = world.flight()
        acts = [status.failsafe for status in flight.data.statuses]
        assert acts[-1] is False
        begin, end = acts.index(True), len(acts) - 1
        assert all(acts[begin:end])  # from hold to the end of the condition
