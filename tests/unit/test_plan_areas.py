"""Geofences and rally points: their items, the files that hold them, and what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import LocalFrame
from flightstack.guidance.rally import HOME as AT_HOME
from flightstack.guidance.rally import NEAREST, RALLY_FIRST, ReturnPlace, choose, rally_points
from flightstack.mavlink.dialect import mavlink
from flightstack.plan import (
    DEFAULT_LIMITS,
    RALLY_POINT,
    Command,
    FenceCommand,
    Frame,
    MissionItem,
    MissionResult,
    Plan,
    check_mission,
    load_plan,
    save_plan,
)
from flightstack.plan.fence import check_fence, fence_shape
from flightstack.plan.rally import check_rally
from tests.support.plan_items import HOME, circle, degrees, polygon, rally_point, return_point, square

NAN = math.nan
SQUARE = polygon(square(50.0))


def at(
    place: tuple[float, float], command: int = Command.NAV_WAYPOINT, altitude_m: float = 5.0
) -> MissionItem:
    x, y = (round(value * 1e7) for value in degrees(place))
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT, x=x, y=y, z=altitude_m)


REFUSED: dict[str, tuple[list[MissionItem], int | None, str]] = {
    "foreign item": ([*SQUARE, at((0, 0))], 4, "is not an item of a geofence"),
    "two vertices": (
        polygon(square(50.0)[:2]),
        0,
        "vertex count 2 (parameter 1) must be a whole number from 3",
    ),
    "NaN count": ([replace(SQUARE[0], param1=NAN)], 0, "vertex count nan"),
    "cut short": (SQUARE[:3], 2, "ends after 3 of its 4 vertices"),
    "count changes": ([*SQUARE[:2], replace(SQUARE[2], param1=5.0), SQUARE[3]], 2, "5 differs from the 4"),
    "kind changes": ([*SQUARE[:2], circle((0, 0), 5.0), SQUARE[3]], 2, "stands where vertex 2 of the 4"),
    "group changes": ([*SQUARE[:3], replace(SQUARE[3], param2=1.0)], 3, "group 1 differs from the 0"),
    "bad group": ([replace(circle((0, 0), 9.0), param2=0.5)], 0, "inclusion group 0.5"),
    "no radius": ([circle((0, 0), 0.0)], 0, "radius 0 (parameter 1) must be above 0"),
    "infinite radius": ([circle((0, 0), math.inf)], 0, "radius inf"),
    "NaN radius": ([circle((0, 0), NAN)], 0, "radius nan"),
    "open place": ([replace(circle((0, 0), 9.0), x=2**31 - 1)], 0, "latitude and longitude must be given"),
    "no latitude": ([replace(circle((0, 0), 9.0), x=910_000_000)], 0, "latitude 91"),
    "wrong frame": ([replace(SQUARE[0], frame=Frame.MISSION)], 0, "needs a global frame"),
    "wrong frame later": ([*SQUARE[:3], replace(SQUARE[3], frame=Frame.MISSION)], 3, "needs a global frame"),
    "bow tie": (polygon([(50, 50), (-50, -50), (50, -50), (-50, 50)]), 0, "from vertices 0 and 2 meet"),
    "flat": (polygon([(0, -50), (0.015, 0), (0, 50)]), 0, "less than 1 square metre"),
    "two returns": ([*SQUARE, return_point((0, 0)), return_point((1, 1))], 5, "second return point"),
    "return outside": ([*SQUARE, return_point((60, 0))], None, "leaves out its return point"),
    "home outside": (polygon(square(5.0, at=(20.0, 0.0))), None, "leaves out the home position"),
    "home excluded": ([circle((1, 0), 5.0, inclusion=False)], None, "leaves out the home position"),
    "too many": ([circle((0, 0), 9.0)] * 201, None, "201 items, and at most 200"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_fences_that_are_refused_with_item_and_reason(name: str) -> None:
    items, seq, reason = REFUSED[name]
    rejection = check_fence(items, HOME)
    assert rejection is not None
    assert rejection.seq == seq
    assert reason in rejection.reason
    assert rejection.result != MissionResult.ACCEPTED
    assert seq is None or rejection.reason.startswith(f"item {seq} (")


def test_fences_that_are_taken() -> None:
    for items in (
        [], SQUARE, [circle((0, 0), 5.0)], [*SQUARE, return_point((10, 0))],
        [*polygon(square(50.0), group=NAN), circle((20, 0), 3.0, inclusion=False)],
        [replace(item, frame=Frame.GLOBAL_RELATIVE_ALT_INT) for item in SQUARE],
    ):  # fmt: skip
        assert check_fence(items, HOME) is None


def test_a_flying_vehicle_keeps_no_fence_that_it_would_break_at_once() -> None:
    assert check_fence(SQUARE, HOME, (49.0, 0.0)) is None
    rejection = check_fence(SQUARE, HOME, (51.0, 0.0))
    assert rejection is not None
    assert "leaves out the vehicle" in rejection.reason
    assert check_fence(SQUARE, HOME, (NAN, 0.0)) is None


NUMBERS = st.one_of(st.sampled_from([NAN, math.inf, -math.inf, 1e300, 3.0, 4.0, 0.0, 1.0]), st.floats())
ITEMS = st.builds(
    MissionItem,
    st.one_of(st.sampled_from([5000, 5001, 5002, 5003, 5004, 5100, 16]), st.integers(0, 65535)),
    st.sampled_from([0, 2, 3, 5, 6, 255]),
    NUMBERS, NUMBERS, NUMBERS, NUMBERS,
    st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1), NUMBERS,
)  # fmt: skip


@settings(max_examples=300)
@given(items=st.lists(ITEMS, max_size=8))
def test_no_items_raise(items: list[MissionItem]) -> None:
    for rejection in (check_fence(items, HOME, (0.0, 0.0)), check_rally(items, HOME)):
        assert rejection is None or rejection.reason
    shape = fence_shape(items, HOME)
    assert shape.allows(0.0, 0.0) in (True, False)
    check_mission([at((1.0, 1.0))], HOME, fence=shape)


def test_missions_that_leave_the_fence_are_refused_by_item_or_by_leg() -> None:
    fence = fence_shape([*SQUARE, circle((20.0, 0.0), 5.0, inclusion=False)], HOME)

    def reason(*items: MissionItem) -> str:
        rejection = check_mission(items, HOME, fence=fence)
        return "" if rejection is None else rejection.reason

    takeoff, back = at((0, 0), Command.NAV_TAKEOFF), MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION)
    assert reason(takeoff, at((0, 40)), at((40, 40)), at((40, 0))) == ""
    assert reason(takeoff, at((0, 40)), at((60, 40))) == "item 2 (NAV_WAYPOINT): is outside the geofence"
    assert reason(takeoff, at((20, 2))) == "item 1 (NAV_WAYPOINT): is outside the geofence"
    assert "item 1 (NAV_WAYPOINT): the way from item 0 to it leaves the geofence, 20 m north" in reason(
        takeoff, at((40, 0))
    )
    assert "item 3 (NAV_RETURN_TO_LAUNCH): the way from item 2" in reason(
        takeoff, at((0, 30)), at((40, 0)), back
    )
    jump = MissionItem(Command.DO_JUMP, Frame.MISSION, 1.0, 2.0)
    assert "item 1 (NAV_WAYPOINT): the way from item 3 to it" in reason(
        takeoff, at((10, 0)), at((10, 30)), at((40, 0)), jump
    )
    assert reason(takeoff, at((10, 0)), at((10, 30)), at((40, 0)), replace(jump, param2=0.0)) == ""


def test_limits_of_distance_and_altitude_hold_for_missions_and_rally_points() -> None:
    limits = DEFAULT_LIMITS._replace(max_home_distance_m=30.0, max_altitude_m=20.0)
    for place, altitude_m, said in (
        ((29, 0), 20.0, ""),
        ((31, 0), 5.0, "is 31 m from home"),
        ((0, 0), 21.0, "21 m"),
    ):
        for rejection in (
            check_mission([at(place, altitude_m=altitude_m)], HOME, limits),
            check_rally([rally_point(place, altitude_m)], HOME, limits),
        ):
            assert (rejection is None) == (said == "")
            assert rejection is None or said in rejection.reason


def test_rally_points_that_are_refused() -> None:
    fence = fence_shape(SQUARE, HOME)
    for items, reason in (
        ([rally_point((0, 0)), at((0, 0))], "item 1 (NAV_WAYPOINT): is not a rally point"),
        ([rally_point((0, 60))], "item 0 (RALLY_POINT): is outside the geofence"),
        ([rally_point((0, 0), NAN)], "item 0 (RALLY_POINT): altitude must be given"),
        ([rally_point((0, 0), math.inf)], "altitude must be given"),
        ([rally_point((0, 0))] * 101, "there are 101 rally points"),
    ):
        rejection = check_rally(items, HOME, fence=fence)
        assert rejection is not None
        assert reason in rejection.reason
    assert check_rally([rally_point((0, 49), 3.0)], HOME, fence=fence) is None


def test_where_a_return_goes() -> None:
    items = [
        rally_point((100, 0), 3.0),
        replace(rally_point((0, 100)), frame=Frame.GLOBAL, z=HOME.altitude_m + 7.0),
    ]
    points = rally_points(items, LocalFrame(HOME), HOME)
    assert points[0] == pytest.approx((100.0, 0.0, 3.0), abs=0.01)
    assert points[1] == pytest.approx((0.0, 100.0, 7.0), abs=0.01)
    assert choose((10.0, 0.0), AT_HOME, points, NEAREST) == AT_HOME
    assert choose((60.0, 0.0), AT_HOME, points, NEAREST) == points[0]
    assert choose((10.0, 20.0), AT_HOME, points, RALLY_FIRST) == points[1]
    assert choose((10.0, 20.0), AT_HOME, (), RALLY_FIRST) == AT_HOME
    elsewhere = ReturnPlace(55.0, 0.0, 1.0)
    assert choose((60.0, 0.0), elsewhere, points, NEAREST) == elsewhere


# -- files

FENCE: dict[str, Any] = {
    "breachReturn": [47.3979, 8.5456, 20],
    "circles": [{"circle": {"center": [47.3977, 8.5456], "radius": 120.5}, "inclusion": True, "version": 1}],
    "polygons": [
        {"inclusion": True, "polygon": [[47.398, 8.545], [47.398, 8.546], [47.397, 8.546]], "version": 1},
        {"inclusion": False, "polygon": [[47.3, 8.5], [47.3, 8.6], [47.2, 8.6]], "version": 1, "ours": 5},
    ],
    "theirs": "kept",
    "version": 2,
}
RALLY: dict[str, Any] = {"points": [[47.3975, 8.5455, 12.5], [47.3976, 8.5454, 0]], "version": 2}


def write(path: Path, fence: Any = FENCE, rally: Any = RALLY) -> Path:
    mission = {"items": [], "plannedHomePosition": list(HOME), "version": 2}
    path.write_text(
        json.dumps(
            {"fileType": "Plan", "version": 1, "mission": mission, "geoFence": fence, "rallyPoints": rally}
        )
    )
    return path


def test_a_plan_file_gives_the_items_that_qgroundcontrol_sends(tmp_path: Path) -> None:
    plan = load_plan(write(tmp_path / "a.plan"))
    commands = [item.command for item in plan.fence]
    assert commands == [5001] * 3 + [5002] * 3 + [5003, 5000]
    assert [item.param1 for item in plan.fence] == [3.0] * 6 + [120.5, 0.0]
    assert plan.fence[0] == MissionItem(5001, 0, 3.0, x=473980000, y=85450000)
    assert plan.fence[-1] == MissionItem(5000, 3, x=473979000, y=85456000, z=20.0)
    assert plan.rally == (
        MissionItem(5100, 3, x=473975000, y=85455000, z=12.5),
        MissionItem(5100, 3, x=473976000, y=85454000, z=0.0),
    )


def test_unchanged_areas_are_written_to_the_letter_and_changed_ones_read_back(tmp_path: Path) -> None:
    source = write(tmp_path / "a.plan")
    plan = load_plan(source)
    save_plan(tmp_path / "b.plan", plan)
    assert json.loads((tmp_path / "b.plan").read_text()) == json.loads(source.read_text())
    areas = (
        *polygon(square(50.0), group=3.0),
        circle((9.0, 9.0), 2.0, inclusion=False),
        return_point((1.0, 1.0)),
    )
    changed = replace(plan, fence=areas, rally=plan.rally[1:])
    save_plan(tmp_path / "c.plan", changed)
    again = load_plan(tmp_path / "c.plan")
    assert again.fence == areas
    assert again.rally == plan.rally[1:]
    assert json.loads((tmp_path / "c.plan").read_text())["geoFence"]["theirs"] == "kept"


def test_a_download_without_a_source_file_is_written_whole(tmp_path: Path) -> None:
    amsl = replace(rally_point((5.0, 5.0)), frame=Frame.GLOBAL, z=HOME.altitude_m + 4.0)
    save_plan(tmp_path / "a.plan", Plan((), HOME, fence=tuple(SQUARE), rally=(amsl,)))
    again = load_plan(tmp_path / "a.plan")
    assert again.fence == tuple(SQUARE)
    assert again.rally == (rally_point((5.0, 5.0), 4.0),)


@pytest.mark.parametrize(
    ("fence", "rally", "reason"),
    [
        ([], RALLY, "geoFence: must be an object"),
        ({"polygons": {}}, RALLY, "geoFence.polygons: must be a list"),
        ({"polygons": [5]}, RALLY, r"geoFence.polygons\[0\]: must be an object"),
        ({"polygons": [{"inclusion": 1}]}, RALLY, "inclusion: 1 must be true or false"),
        ({"polygons": [{"inclusion": True, "polygon": [[1, 2]]}]}, RALLY, "at least three points"),
        ({"polygons": [{"inclusion": True, "polygon": [[1, 2], [3], [4, 5]]}]}, RALLY, "list of 2 numbers"),
        ({"polygons": [{"inclusion": True, "polygon": [[1, 2], [91, 3], [4, 5]]}]}, RALLY, "latitude 91"),
        ({"circles": [{"inclusion": True, "circle": {"center": [1, 2]}}]}, RALLY, "radius"),
        ({"breachReturn": [1, 2]}, RALLY, "breachReturn: must be a list of 3 numbers"),
        (FENCE, {"points": [[1, 2]]}, r"rallyPoints.points\[0\]: must be a list of 3 numbers"),
        (FENCE, {"points": [[1, "x", 2]]}, "must be a number"),
        (FENCE, 5, "rallyPoints: must be an object"),
    ],
)
def test_bad_files_are_refused_with_their_place(tmp_path: Path, fence: Any, rally: Any, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        load_plan(write(tmp_path / "a.plan", fence, rally))


def test_older_versions_are_kept_but_not_read(tmp_path: Path) -> None:
    old = {"breachReturn": [1.0, 2.0], "polygon": [[1, 2], [3, 4], [5, 6]], "version": 1}
    plan = load_plan(write(tmp_path / "a.plan", old))
    assert plan.fence == ()
    assert plan.has_fence_or_rally
    save_plan(tmp_path / "b.plan", plan)
    assert json.loads((tmp_path / "b.plan").read_text())["geoFence"] == old


def test_numbers_of_items_are_mavlinks() -> None:
    for command in FenceCommand:
        assert getattr(mavlink, f"MAV_CMD_NAV_FENCE_{command.name}") == command
    assert mavlink.MAV_CMD_NAV_RALLY_POINT == RALLY_POINT
