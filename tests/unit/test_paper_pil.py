"""The paper's processor in the loop: its mission, and what is said where there is no target."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Command, MissionItem, check_mission, load_plan, save_plan
from gcs_cli.errors import USAGE, CliError
from gcs_cli.experiments.paper import pil_section
from gcs_cli.experiments.paper.flights.trajectory import load_trajectory
from gcs_cli.fly.fly_options import DEFAULT_HOME
from gcs_cli.pil.result import Outcome
from gcs_cli.pil.run import Finished


def place(item: MissionItem) -> tuple[float, float, float]:
    """North, east and height of an item [m]."""
    assert item.position_deg is not None
    ned = LocalFrame(DEFAULT_HOME).to_ned(GeoPoint(*item.position_deg, DEFAULT_HOME.altitude_m))
    return round(ned.x, 1) + 0.0, round(ned.y, 1) + 0.0, item.z


def test_the_mission_goes_where_the_desired_trajectory_turns() -> None:
    plan = pil_section.mission_along(load_trajectory("desired"))
    assert plan.items[0].command == Command.NAV_TAKEOFF
    assert plan.items[-1].command == Command.NAV_LAND
    corners = [item for item in plan.items if item.command == Command.NAV_WAYPOINT]
    assert [place(item)[:2] for item in corners] == [
        (0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (1.5, 3.0), (0.0, 3.0), (0.0, 0.0), (0.0, 0.0),
    ]  # fmt: skip
    assert [place(item)[2] for item in corners] == [2.0, 2.0, 2.0, 2.25, 2.5, 2.0, 1.0]
    assert [item.param4 for item in corners] == [0.0, 0.0, 90.0, 180.0, 180.0, 90.0, 0.0]
    assert place(plan.items[-1])[:2] == (0.0, 0.0)


def test_the_vehicle_takes_the_mission_and_its_file_holds_it(tmp_path: Path) -> None:
    plan = pil_section.mission_along(load_trajectory("desired"))
    save_plan(tmp_path / "desired.plan", plan)
    loaded = load_plan(tmp_path / "desired.plan")
    assert loaded.items == plan.items
    assert check_mission(loaded.items, DEFAULT_HOME) is None


def test_headings_are_those_of_a_compass() -> None:
    plan = pil_section.mission_along(load_trajectory("hard"))
    yaws = [item.param4 for item in plan.items if item.command == Command.NAV_WAYPOINT]
    assert all(math.isfinite(yaw) and 0.0 <= yaw < 360.0 for yaw in yaws)
    assert all(item.z >= 1.0 for item in plan.items if item.command == Command.NAV_WAYPOINT)


def not_there(*_: object) -> None:
    raise CliError("no compiler is there: pip install ziglang unicorn", USAGE)


def test_without_its_tools_the_emulated_target_is_left_out_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(pil_section, "check_there", not_there)
    found = pil_section.run(tmp_path)
    assert found["why_left_out"] == "no compiler is there: pip install ziglang unicorn"
    assert found["controllers"] == {}
    assert not list(tmp_path.iterdir())


def test_a_board_that_was_asked_for_and_is_not_there_is_an_error(tmp_path: Path) -> None:
    missing = f"serial:{tmp_path / 'ttyUSB7'}"
    why = pil_section.problem(missing)
    assert why is not None
    assert "ttyUSB7" in why
    with pytest.raises(CliError, match="ttyUSB7") as failure:
        pil_section.run(tmp_path, missing)
    assert failure.value.exit_code == USAGE


def test_a_target_of_no_kind_is_an_error() -> None:
    with pytest.raises(CliError, match="--target banana"):
        pil_section.problem("banana")


def timed(seconds: float) -> dict[str, Any]:
    """What ``pil.json`` says of a run on a machine that took so long."""
    flight = {
        "outcome": "completed", "loops": "C", "ticks": 9, "airborne_ticks": 8, "sim_time_s": 1.0,
        "wall_time_s": seconds, "log_sha256": "ab", "directory": "sil",
    }  # fmt: skip
    parts = dict.fromkeys(
        ("verdict", "checks", "differences", "compared", "profile", "target", "stack"), "the same"
    )
    link = {"round_trip_mean_us": seconds * 1e6}
    return {
        **parts,
        "link": link,
        "target_status_before": {"time_boot_ms": seconds},
        "flights": {"SIL": flight},
    }


def test_no_time_of_the_machine_is_kept() -> None:
    first, second = (json.dumps(pil_section.repeatable(timed(seconds))) for seconds in (1.0, 2.5))
    assert first == second
    assert "the same" in first


def test_ctrl_c_in_a_flight_ends_the_command_and_keeps_the_older_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupted(_options: object, _plan: object, _target: str, out: Path, _console: object) -> Finished:
        out.mkdir()
        result = {"flights": {"MIL": {"outcome": "completed"}, "SIL": {"outcome": "interrupted"}}}
        return Finished(out, Outcome(result, [], []), CliError("SIL: interrupted"))

    older = tmp_path / "pil-pid" / "pil.json"
    older.parent.mkdir()
    older.write_text("older")
    monkeypatch.setattr(pil_section, "check_there", lambda *_: None)
    monkeypatch.setattr(pil_section, "run_pil", interrupted)
    with pytest.raises(KeyboardInterrupt):
        pil_section.run(tmp_path, instance=98)
    assert older.read_text() == "older"
    assert [path.name for path in tmp_path.iterdir()] == ["pil-pid"]
