"""``gcs mission``, ``gcs fence`` and ``gcs rally`` against a scripted vehicle over UDP, and once a real one."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from flightstack.plan import load_plan, save_plan
from tests.support.commands import Ended, gcs
from tests.support.fake_vehicle import HOLD, MISSION, FakeVehicle
from tests.support.plan_items import circle
from tests.support.told import MISSIONS, told
from tests.support.vehicle_processes import vehicle

FENCED = MISSIONS / "fenced_square.plan"


def objects(result: Ended) -> list[dict[str, object]]:
    """The lines of ``--json``."""
    return [json.loads(line) for line in result.stdout.splitlines()]


def test_verify_finds_each_difference_by_item(tmp_path: Path) -> None:
    fake = FakeVehicle()
    assert told(fake, "mission", "upload", FENCED).returncode == 0
    same = told(fake, "mission", "verify", FENCED)
    assert (same.returncode, same.stderr) == (0, "")
    assert same.stdout.splitlines()[-1] == "mission of 6 items: equal"
    plan = load_plan(FENCED)
    changed = replace(plan, items=(*plan.items[:2], replace(plan.items[2], z=7.5), *plan.items[3:-1]))
    save_plan(tmp_path / "changed.plan", changed)
    result = told(fake, "mission", "verify", tmp_path / "changed.plan", "--json")
    found = [each for each in objects(result) if each["event"] == "difference"]
    assert [(each["seq"], each["field"], each["expected"]) for each in found] == [
        (2, "altitude", 7.5),
        (5, "item", None),
    ]
    assert result.returncode == 1
    assert "2 differences from the plan on the vehicle" in result.stderr


def test_fence_and_rally_points_go_alone(tmp_path: Path) -> None:
    fake = FakeVehicle()
    told(fake, "mission", "upload", MISSIONS / "hop.plan")
    assert told(fake, "fence", "upload", FENCED).stdout == "geofence of 5 items uploaded\n"
    assert told(fake, "rally", "upload", FENCED).stdout == "list of rally points of 1 items uploaded\n"
    assert [len(fake.plans[kind]) for kind in (1, 2)] == [5, 1]
    assert len(fake.items) == len(load_plan(MISSIONS / "hop.plan").items)
    assert told(fake, "fence", "verify", FENCED).stdout == "geofence of 5 items: equal\n"
    assert "FENCE_POLYGON_VERTEX_INCLUSION" in told(fake, "fence", "show").stdout
    assert "RALLY_POINT" in told(fake, "rally", "show", FENCED).stdout
    copy = tmp_path / "fence.kml"
    assert told(fake, "fence", "download", copy).stdout == f"geofence of 5 items downloaded to {copy}\n"
    assert told(fake, "fence", "clear").stdout == "geofence cleared\n"
    assert told(fake, "fence", "show").stdout == "no geofence\n"
    assert told(fake, "fence", "upload", copy).returncode == 0
    result = told(fake, "rally", "upload", MISSIONS / "hop.plan")
    assert (result.returncode, result.stderr.strip()) == (
        2,
        f"gcs: {MISSIONS / 'hop.plan'}: has no list of rally points",
    )


def test_pause_resume_and_jump_wait_for_the_effect() -> None:
    fake = FakeVehicle(simulated_s_per_item=0.0)
    fake.armed, fake.mode = True, MISSION
    fake.plans[0] = [None] * 60_000
    assert told(fake, "mission", "pause").stdout == "mission paused: holding the position\n"
    assert fake.mode == HOLD
    assert told(fake, "mission", "jump", 3, "--json").stdout.count('"mission_jump"') == 1
    assert fake.current == 3
    assert told(fake, "mission", "resume").stdout == "mission resumed\n"
    assert fake.mode == MISSION


def test_pause_without_a_mission_in_flight_is_refused() -> None:
    result = told(FakeVehicle(), "mission", "pause")
    assert result.returncode == 1
    assert "mission pause: the vehicle does not fly a mission: it is disarmed" in result.stderr


def test_check_names_all_problems_of_a_file(tmp_path: Path) -> None:
    plan = load_plan(MISSIONS / "square.plan")
    items = [replace(item, z=-20.0) if seq in (2, 3) else item for seq, item in enumerate(plan.items)]
    save_plan(tmp_path / "low.plan", replace(plan, items=tuple(items)))
    result = gcs("mission", "check", tmp_path / "low.plan", "--json")
    problems = [each for each in objects(result) if each["event"] == "problem"]
    assert [(each["part"], each["seq"]) for each in problems] == [("mission", 2), ("mission", 3)]
    assert result.returncode == 2


@pytest.mark.parametrize("pattern", ["square", "circle", "lemniscate"])
def test_new_patterns_are_written_and_pass_the_check(tmp_path: Path, pattern: str) -> None:
    out = tmp_path / "new.plan"
    assert gcs("mission", "new", pattern, "--out", out, "--laps", 2, "--speed", 3).returncode == 0
    assert gcs("mission", "check", out).returncode == 0
    again = gcs("mission", "new", pattern, "--out", out)
    assert again.returncode == 2
    assert "--overwrite" in again.stderr


def test_new_survey_and_corridor_read_an_area(tmp_path: Path) -> None:
    area = {
        "type": "Polygon",
        "coordinates": [[[8.545, 47.397], [8.546, 47.397], [8.546, 47.398], [8.545, 47.397]]],
    }
    (tmp_path / "area.geojson").write_text(json.dumps(area))
    line = {"type": "LineString", "coordinates": [[8.545, 47.397], [8.546, 47.397]]}
    (tmp_path / "line.geojson").write_text(json.dumps(line))
    survey = gcs(
        "mission", "new", "survey", tmp_path / "area.geojson", "--out", tmp_path / "s.plan", "--angle", 90
    )
    assert (survey.returncode, survey.stderr) == (0, "")
    assert load_plan(tmp_path / "s.plan").fence == ()
    checked = gcs("mission", "check", tmp_path / "s.plan")
    assert (checked.returncode, checked.stderr) == (0, "")
    corridor = gcs("mission", "new", "corridor", tmp_path / "line.geojson", "--out", tmp_path / "c.kml")
    assert (corridor.returncode, corridor.stderr) == (0, "")
    result = gcs("mission", "new", "survey", "--out", tmp_path / "x.plan")
    assert (result.returncode, result.stderr) == (
        2,
        "gcs: mission new survey: it needs the file of an AREA\n",
    )
    result = gcs("mission", "new", "survey", tmp_path / "line.geojson", "--out", tmp_path / "x.plan")
    assert (result.returncode, "holds no polygon to survey" in result.stderr) == (2, True)


def test_convert_names_what_is_lost(tmp_path: Path) -> None:
    result = gcs("mission", "convert", "every_item", tmp_path / "a.gpx")
    assert result.returncode == 0
    assert "lost in" in result.stdout
    result = gcs("mission", "convert", "square", tmp_path / "a.doc")
    assert (result.returncode, "the suffix '.doc' must be one of .plan" in result.stderr) == (2, True)


def test_check_prints_each_of_several_problems_once(tmp_path: Path) -> None:
    square, path = load_plan(MISSIONS / "square.plan"), tmp_path / "far.plan"
    far = [replace(item, x=476000000) if seq in (1, 3) else item for seq, item in enumerate(square.items)]
    save_plan(path, replace(square, items=tuple(far)))
    result = gcs("mission", "check", path)
    assert [line.split(" (")[0] for line in result.stdout.splitlines()] == [
        "mission: item 1",
        "mission: item 2",
        "mission: item 3",
        "mission: item 4",
    ]
    assert (result.stderr, result.returncode) == (f"gcs: {path}: has 4 problems\n", 2)


@pytest.mark.parametrize(
    "words",
    [
        ["mission", "convert", "square", "none/a.geojson"],
        ["mission", "convert", "square", "none/a.plan"],
        ["mission", "show", "square", "--html", "none/a.html"],
        ["pil", "vectors", "none/a.csv"],
    ],
    ids=" ".join,
)
def test_file_that_cannot_be_written_is_exit_code_1(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = gcs(*words)
    assert (result.stdout, result.returncode) == ("", 1)
    assert re.fullmatch(r"gcs: \S+: cannot be written: No.* directory\n", result.stderr), result.stderr


def test_show_prints_a_table_a_drawing_and_a_page(tmp_path: Path) -> None:
    shown = gcs("mission", "show", "fenced_square").stdout
    assert "NAV_WAYPOINT" in shown
    assert "m, north up" in shown
    lines = objects(gcs("mission", "show", "fenced_square", "--json"))
    assert [line["event"] for line in lines].count("item") == 12
    assert lines[-1]["event"] == "plan"
    page = tmp_path / "plan.html"
    assert gcs("mission", "show", "square", "--html", page).returncode == 0
    assert "plotly" in page.read_text()


def test_a_real_vehicle_verifies_checks_and_jumps(tmp_path: Path) -> None:
    small = tmp_path / "small.plan"
    save_plan(small, replace(load_plan(MISSIONS / "hop.plan"), fence=(circle((0.0, 0.0), 3.0),)))
    with vehicle(tmp_path) as stack:
        link = ("--connect", stack.link)
        assert gcs(*link, "mission", "upload", small).returncode == 0
        assert gcs(*link, "mission", "verify", small).stdout.splitlines()[-1].endswith("equal")
        refused = gcs("mission", "check", MISSIONS / "square.plan", *link)
        assert refused.returncode == 1
        assert "is outside the geofence" in refused.stdout
        assert gcs(*link, "fence", "clear").stdout == "geofence cleared\n"
        assert gcs(*link, "mission", "upload", MISSIONS / "square.plan").returncode == 0
        assert gcs(*link, "mission", "jump", 2).stdout == "item 2 is the current one\n"
        result = gcs(*link, "mission", "jump", 99)
        assert (result.returncode, "there is no mission item 99" in result.stderr) == (1, True)
