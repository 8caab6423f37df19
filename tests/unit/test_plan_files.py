"""Plan files: both formats, without loss, against pymavlink's loader, and with every kind of damage."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.mavwp import MAVWPLoader

from flightstack.core.errors import ConfigError, WriteError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import UNSET_E7, Command, Frame, MissionItem, Plan, check_mission, load_plan, save_plan
from flightstack.plan.qgc_plan import plan_to_json, read_plan
from flightstack.plan.waypoints import plan_to_waypoints, read_waypoints
from gcs_cli.transfers.plan_files import example_plans
from tests.support.random_plans import plans

NAN = float("nan")
MISSIONS = sorted(example_plans().values())
HOME = GeoPoint(47.397742, 8.545594, 488.0)

FREE_COMMANDS = st.sampled_from([command for command in Command if command != Command.DO_JUMP])


@settings(max_examples=150)
@given(plan=plans())
def test_a_plan_survives_both_formats(plan: Plan) -> None:
    again = read_plan(plan_to_json(plan), "test")
    assert (again.items, again.home) == (plan.items, plan.home)
    assert plan_to_json(again) == plan_to_json(plan)
    again = read_waypoints(plan_to_waypoints(plan, "test"), "test")
    assert again.items == plan.items
    assert again.home == (None if plan.home == GeoPoint(0.0, 0.0, 0.0) else plan.home)


@settings(max_examples=50)
@given(plan=plans())
def test_pymavlinks_loader_reads_the_same_waypoints(plan: Plan, tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("wp") / "plan.waypoints"
    save_plan(path, plan)
    loader = MAVWPLoader()
    assert loader.load(str(path)) == len(plan.items) + 1
    home = loader.item(0)
    assert (home.command, home.frame, home.current) == (16, 0, 1)
    assert (home.x, home.y, home.z) == plan.home
    for seq, item in enumerate(plan.items, start=1):
        read = loader.item(seq)
        assert (read.seq, read.frame, read.command) == (seq, item.frame, item.command)
        assert read.autocontinue == item.autocontinue
        shift = 1.0 if item.command == Command.DO_JUMP else 0.0  # the file counts home as item 0
        for got, expected in (
            (read.param1, item.param1 + shift),
            (read.param2, item.param2),
            (read.param3, item.param3),
            (read.param4, item.param4),
            (read.z, item.z),
            (
                read.x,
                NAN if item.is_global and item.x == UNSET_E7 else item.x / (1e7 if item.is_global else 1),
            ),
        ):
            assert got == expected or (math.isnan(got) and math.isnan(expected))


def test_reads_waypoints_of_pymavlink(tmp_path: Path) -> None:
    ours = load_plan("missions/triangle.waypoints")
    loader = MAVWPLoader()
    loader.load("missions/triangle.waypoints")
    loader.save(str(tmp_path / "again.waypoints"))
    theirs = load_plan(tmp_path / "again.waypoints")
    for one, other in zip(theirs.items, ours.items, strict=True):
        assert (one.command, one.frame, one.params[:3], one.z) == (
            other.command, other.frame, other.params[:3], other.z,
        )  # fmt: skip
        assert abs(one.x - other.x) <= 5  # it writes six decimals
    assert theirs.comments == ours.comments


@pytest.mark.parametrize("path", MISSIONS, ids=lambda path: path.name)
def test_the_projects_missions_are_sound_and_kept_to_the_letter(path: Path, tmp_path: Path) -> None:
    plan = load_plan(path)
    assert plan.home == HOME
    assert check_mission(plan.items, HOME) is None
    save_plan(tmp_path / path.name, plan)
    assert (tmp_path / path.name).read_bytes() == path.read_bytes()


def test_every_item_mission_has_all_supported_commands() -> None:
    used = {item.command for item in load_plan("missions/every_item.plan").items}
    assert used == set(Command)


def document(*listed: dict[str, Any]) -> dict[str, Any]:
    return {
        "fileType": "Plan",
        "geoFence": {
            "circles": [{"circle": {"center": [47.0, 8.0], "radius": 50}, "inclusion": True, "version": 1}],
            "polygons": [],
            "version": 2,
        },
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": 15,
            "hoverSpeed": 5,
            "items": list(listed),
            "plannedHomePosition": [47.397742, 8.545594, 488],
            "version": 2,
            "ours": {"kept": [1, 2, None]},
        },
        "rallyPoints": {"points": [[47.0, 8.0, 10]], "version": 2},
        "version": 1,
        "unknown": "ü",
    }


def simple(command: int = 16, *, frame: int = 3, params: Any = None, jump_id: int = 1) -> dict[str, Any]:
    return {
        "AMSLAltAboveTerrain": None,
        "Altitude": 10,
        "AltitudeMode": 1,
        "autoContinue": True,
        "command": command,
        "doJumpId": jump_id,
        "frame": frame,
        "params": [0, 0, 0, None, 47.397742, 8.545594, 10] if params is None else params,
        "type": "SimpleItem",
    }


def simple_jump(target: int, jump_id: int = 1) -> dict[str, Any]:
    return simple(177, frame=2, params=[target, 1, 0, 0, 0, 0, 0], jump_id=jump_id)


def with_params(*params: Any) -> dict[str, Any]:
    return document(simple(params=list(params)))


def survey(*listed: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": list(listed), "version": 1},
        "polygon": [[47.0, 8.0]],
    }


def write(path: Path, content: Any) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_unknown_keys_are_kept(tmp_path: Path) -> None:
    source = document(
        simple(),
        survey(simple(jump_id=2), simple(jump_id=3)),
        simple_jump(3, jump_id=4),
    )
    plan = load_plan(write(tmp_path / "a.plan", source))
    assert len(plan.items) == 4
    assert plan.items[3].param1 == 2.0  # the file's doJumpId 3 is item 2 on the wire
    save_plan(tmp_path / "b.plan", plan)
    assert json.loads((tmp_path / "b.plan").read_text()) == source


def test_changed_items_are_written_new_and_the_others_kept(tmp_path: Path) -> None:
    source = document(simple(jump_id=7), simple(jump_id=8), simple_jump(8, jump_id=9))
    plan = load_plan(write(tmp_path / "a.plan", source))
    changed = MissionItem(Command.NAV_LAND, Frame.GLOBAL_RELATIVE_ALT, 0.0, 0.0, 0.0, NAN, UNSET_E7, UNSET_E7)
    new = replace(plan, items=(plan.items[0], changed, *plan.items[2:]), home=GeoPoint(1.0, 2.0, 3.0))
    save_plan(tmp_path / "b.plan", new)
    again = load_plan(tmp_path / "b.plan")
    assert (again.items, again.home) == (new.items, new.home)
    written = json.loads((tmp_path / "b.plan").read_text())
    first, second, jump = written["mission"]["items"]
    assert first["AltitudeMode"] == 1
    assert "AltitudeMode" not in second
    assert second["params"] == [0, 0, 0, None, None, None, 0]
    assert jump["params"][0] == second["doJumpId"] == 2
    assert written["geoFence"] == source["geoFence"]
    assert written["mission"]["ours"] == source["mission"]["ours"]


def test_a_format_that_cannot_hold_the_fence_is_refused(tmp_path: Path) -> None:
    plan = load_plan(write(tmp_path / "a.plan", document(simple())))
    with pytest.raises(ConfigError, match=r"has no geofence.*save as \.plan"):
        save_plan(tmp_path / "a.waypoints", plan)
    assert not (tmp_path / "a.waypoints").exists()


def waypoints(*rows: str) -> str:
    home = "0\t1\t0\t16\t0\t0\t0\t0\t47.4\t8.5\t488\t1"
    return "\n".join(["QGC WPL 110", home, *rows]) + "\n"


ROW = "1\t0\t3\t16\t0\t0\t0\t0\t47.4\t8.5\t10\t1"

BAD_PLANS: dict[str, tuple[Any, str]] = {
    "not JSON": ("{", "is not valid JSON"),
    "deep": ("[" * 100_000, "is not valid JSON"),
    "long number": ('{"version": ' + "9" * 5000 + "}", "is not valid JSON"),
    "empty": ("", "is not valid JSON"),
    "another JSON": ([1], "fileType: None must be 'Plan'"),
    "another file": ({"fileType": "Parameters"}, "fileType: 'Parameters' must be 'Plan'"),
    "another version": ({"fileType": "Plan", "version": 3}, "version: 3 must be 1"),
    "no mission": ({"fileType": "Plan", "version": 1}, "mission: must be an object"),
    "no items": ({"fileType": "Plan", "version": 1, "mission": {}}, "mission.items: must be a list"),
    "item": (document("x"), "item 0: must be an object"),  # type: ignore[arg-type]
    "type": (document({"type": "Odd"}), "item 0, type: 'Odd' must be"),
    "structure scan": (
        document({"type": "ComplexItem", "complexItemType": "StructureScan"}),
        "item 0: the complex item 'StructureScan' has no list of simple items",
    ),
    "frame": (
        document(simple(), simple(frame=7)),
        "item 1, frame: 7 is not supported; supported are 0",
    ),
    "command": (
        document(simple(65536)),
        "item 0, command: 65536 must be a whole number from 0 to 65535",
    ),
    "command text": (document(simple("16")), "item 0, command: '16' must be a whole number from 0"),  # type: ignore[arg-type]
    "no command": (document(simple(None)), "item 0, command: is missing; it must be a whole number"),  # type: ignore[arg-type]
    "survey": (
        document(simple(), survey(simple(), simple(-1))),
        "item 2, command: -1 must be a whole number",
    ),
    "params": (with_params(0, 0), "item 0, params: must be a list of 7 numbers"),
    "param": (with_params(0, "x", 0, 0, 0, 0, 0), "item 0, param 2: 'x' must be a number"),
    "true": (with_params(True, 0, 0, 0, 0, 0, 0), "item 0, param 1: True must be a number"),
    "NaN latitude": (
        with_params(0, 0, 0, 0, NAN, 8.5, 10),
        "item 0, latitude: is NaN (null), and a NAV_WAYPOINT needs -90 to 90",
    ),
    "null longitude": (with_params(0, 0, 0, 0, 47.4, None, 10), "item 0, longitude: is NaN"),
    "infinite latitude": (
        with_params(0, 0, 0, 0, math.inf, 8.5, 10),
        "item 0, latitude: inf must be a finite",
    ),
    "latitude": (
        with_params(0, 0, 0, 0, 90.5, 8.5, 10),
        "item 0, latitude: 90.5 is outside the allowed range -90 to 90",
    ),
    "longitude": (
        with_params(0, 0, 0, 0, 47.4, -181, 10),
        "item 0, longitude: -181 is outside",
    ),
    "huge": (
        with_params(1e39, 0, 0, 0, 47.4, 8.5, 10),
        "item 0, param 1: 1e+39 must be a finite",
    ),
    "huger": (
        with_params(10**400, 0, 0, 0, 47.4, 8.5, 10),
        "item 0, param 1: inf must be a finite",
    ),
    "jump": (
        document(simple_jump(9)),
        "item 0, param 1: jumps to doJumpId 9, which no item has",
    ),
    "too many": (document(*[simple()] * 2001), "mission: has 2001 items, and at most 2000 are allowed"),
    "too many inside": (document(survey(*[simple()] * 2001)), "has 2001 items"),
    "home": (
        {**document(), "mission": {"items": [], "plannedHomePosition": [95, 0, 0]}},
        "latitude 95 is outside",
    ),
    "wrong text version": ("QGC WPL 120\n", "line 1: 'QGC WPL 120' must be 'QGC WPL 110'"),
    "short row": (waypoints("1 2 3"), "line 3: has 3 values and must have 12"),
    "word": (waypoints(ROW.replace("10", "high")), "line 3: 'high' is not a number"),
    "text frame": (waypoints(ROW.replace("\t3\t", "\t4\t")), "line 3, item 0, frame: 4 is not supported"),
    "text command": (
        waypoints(ROW.replace("16", "-1")),
        "line 3, item 0, command: -1 must be a whole number",
    ),
    "text latitude": (waypoints(ROW.replace("47.4", "nan")), "line 3, item 0, latitude: is NaN"),
    "text infinity": (waypoints(ROW.replace("47.4", "inf")), "line 3: inf must be a finite"),
    "text jump": (
        waypoints("1 0 2 177 5 1 0 0 0 0 0 1"),
        "line 3, item 0, param 1 (DO_JUMP): is 5, and the first column of the file's items has 1 to 1",
    ),
    "no home": (
        "QGC WPL 110\n" + ROW.replace("16", "22"),
        "line 2 (home): the first line is the home",
    ),
    "text too many": (waypoints(*[ROW] * 2001), "has 2001 items"),
}


@pytest.mark.parametrize(("content", "problem"), BAD_PLANS.values(), ids=BAD_PLANS)
def test_bad_file_raises_one_sentence(tmp_path: Path, content: Any, problem: str) -> None:
    path = write(tmp_path / "bad.plan", content)
    with pytest.raises(ConfigError) as caught:
        load_plan(path)
    assert problem in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_or_are_no_text(tmp_path: Path) -> None:
    for path, problem in (
        (tmp_path / "missing.plan", "No such file"),
        (tmp_path, "Is a directory"),
        (Path("a\0b.plan"), "cannot be read"),
    ):
        with pytest.raises(ConfigError, match=problem):
            load_plan(path)
    (tmp_path / "binary.plan").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="it is not text"):
        load_plan(tmp_path / "binary.plan")
    with pytest.raises(ConfigError, match="line 1"):
        load_plan(write(tmp_path / "no.waypoints", "1 2 3"))
    with (tmp_path / "huge.plan").open("wb") as file:
        file.truncate(50_000_001)
    with pytest.raises(ConfigError, match="larger than the allowed 50 MB"):
        load_plan(tmp_path / "huge.plan")


def test_a_byte_order_mark_and_windows_line_ends_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.waypoints").write_bytes(b"\xef\xbb\xbf" + waypoints(ROW).replace("\n", "\r\n").encode())
    assert len(load_plan(tmp_path / "a.waypoints").items) == 1


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "a.plan"
    save_plan(path, Plan((), HOME))
    before = path.read_bytes()

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(WriteError, match="cannot be written: No space left"):
        save_plan(path, load_plan("missions/square.plan"))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.plan"]
    with pytest.raises(ConfigError, match=r"'\.gpx' must be one of \.plan"):
        save_plan(tmp_path / "a.gpx", Plan((), HOME))
    with pytest.raises(WriteError, match="cannot be written"):
        save_plan(tmp_path / "no" / "a.plan", Plan((), HOME))


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    target, link = tmp_path / "target.plan", tmp_path / "link.plan"
    save_plan(target, Plan((), HOME))
    link.symlink_to(target)
    save_plan(link, load_plan("missions/hop.plan"))
    assert link.is_symlink()
    assert len(load_plan(target).items) == 2


def test_qgroundcontrols_required_keys_are_there_without_a_known_home() -> None:
    written = json.loads(plan_to_json(Plan((MissionItem(16, 3, x=473977420, y=85455940, z=5.0),))))
    assert written["mission"]["plannedHomePosition"] == [47.397742, 8.545594, 0]
    assert set(written) == {"fileType", "geoFence", "groundStation", "mission", "rallyPoints", "version"}


def test_file_of_another_kind_is_refused_with_the_formats(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text('plan = "square"\n')
    with pytest.raises(ConfigError, match=r"toml: is not a plan file: the formats are \.plan, .*\.mission$"):
        load_plan(path)
