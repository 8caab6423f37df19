"""Missions of a pattern, and distances, times and drawings of missions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.plan import DEFAULT_LIMITS, Command, Frame, MissionItem, Plan, check_mission
from gcs_cli.plans import patterns
from gcs_cli.plans.check import limits_of, plan_problems
from gcs_cli.plans.drawing import draw, places_of
from gcs_cli.plans.itinerary import flown_order, itinerary
from gcs_cli.plans.page import plan_page
from gcs_cli.plans.survey import survey
from gcs_cli.plans.table import clock, totals
from tests.support.plan_items import HOME, circle, item, rally_point

BOX = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 60.0], [0.0, 60.0]])
C_SHAPE = np.array(
    [[0, 0], [100, 0], [100, 60], [70, 60], [70, 20], [30, 20], [30, 60], [0, 60]], dtype=float
)


@pytest.mark.parametrize(
    "places", [patterns.square(20.0), patterns.circle(20.0, 12), patterns.lemniscate(40.0, 16)]
)
@pytest.mark.parametrize("ending", ["return", "land", "none"])
def test_patterns_are_missions_that_the_vehicle_takes(places: np.ndarray, ending: patterns.Ending) -> None:
    route = patterns.Route(5.0, 3.0, laps=3, ending=ending)
    items = patterns.pattern_items(places, HOME, HOME, route)
    assert check_mission(items, HOME) is None
    assert items[0].command == Command.NAV_TAKEOFF
    assert next(each for each in items if each.command == Command.DO_JUMP).param2 == 2.0


def test_circle_and_lemniscate_have_their_size() -> None:
    ring = patterns.circle(20.0, 64)
    assert np.hypot(ring[:, 0], ring[:, 1]) == pytest.approx(10.0)
    eight = patterns.lemniscate(40.0, 64)
    assert np.ptp(eight[:, 1]) == pytest.approx(40.0)
    assert eight[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert eight[-1] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_corridor_passes_are_parallel_and_alternate() -> None:
    line = np.array([[0.0, 0.0], [100.0, 0.0]])
    places = patterns.corridor(line, 30.0, 10.0)
    assert places == pytest.approx(np.array([[0, -10], [100, -10], [100, 0], [0, 0], [0, 10], [100, 10]]))


def test_corridor_keeps_its_distance_in_corners() -> None:
    line = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0]])
    assert patterns.corridor(line, 20.0, 20.0) == pytest.approx(line)
    inner = patterns.corridor(line, 20.0, 10.0)[3:]
    assert inner == pytest.approx(np.array([[95.0, 100.0], [95.0, 5.0], [0.0, 5.0]]))


def test_survey_of_a_box_flies_to_and_fro() -> None:
    places = survey([BOX], 20.0, 0.0)
    assert places == pytest.approx(np.array([[0, 10], [100, 10], [100, 30], [0, 30], [0, 50], [100, 50]]))


def test_survey_flies_each_arm_of_an_area_as_a_whole() -> None:
    places = survey([C_SHAPE], 10.0, 0.0)
    legs = np.hypot(*np.diff(places, axis=0).T)
    # east of 20 m each line has two parts: one cell after the other, with one long way between them
    assert sum(legs > 45.0) == 3  # two lines of 100 m, and the way to the second arm


def test_survey_leaves_out_holes() -> None:
    hole = np.array([[40.0, 20.0], [60.0, 20.0], [60.0, 40.0], [40.0, 40.0]])
    places = survey([BOX, hole], 10.0, 0.0)
    middles = 0.5 * (places[0::2] + places[1::2])  # of the lines
    inside = (abs(middles[:, 0] - 50.0) < 10.0) & (abs(middles[:, 1] - 30.0) < 10.0)
    assert not inside.any()


@settings(max_examples=60)
@given(
    angle=st.floats(-180.0, 180.0),
    spacing=st.floats(3.0, 40.0),
    radii=st.lists(st.floats(20.0, 100.0), min_size=3, max_size=9),
)
def test_survey_lines_cover_any_star_shaped_area(angle: float, spacing: float, radii: list[float]) -> None:
    turns = np.linspace(0.0, 2.0 * math.pi, len(radii), endpoint=False)
    outline = np.array(radii)[:, None] * np.column_stack((np.cos(turns), np.sin(turns)))
    places = survey([outline], spacing, angle)
    across = np.array([-math.sin(math.radians(angle)), math.cos(math.radians(angle))])
    lines = np.unique(np.round(places @ across, 6))
    extent = outline @ across
    assert lines[0] - extent.min() <= spacing
    assert extent.max() - lines[-1] <= spacing
    assert np.diff(lines).max(initial=0.0) <= spacing + 1e-6
    assert places[0::2] @ across == pytest.approx(places[1::2] @ across)  # lines are straight


def test_survey_of_too_many_lines_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 2000 are allowed: increase the spacing"):
        survey([BOX], 0.01, 0.0)


def test_itinerary_gives_distance_heading_and_time() -> None:
    items = (
        item(Command.NAV_TAKEOFF, 0.0, 0.0, 5.0),
        MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, 1.0, 10.0, -1.0),
        item(Command.NAV_WAYPOINT, 100.0, 0.0, 5.0, p1=3.0),
        item(Command.NAV_WAYPOINT, 100.0, 50.0, 5.0),
        MissionItem(Command.DO_JUMP, Frame.MISSION, 2.0, 1.0),
        MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION),
    )
    flight = itinerary(items, HOME)
    assert list(flown_order(items)) == [0, 1, 2, 3, 2, 3, 5]
    second = flight.stops[2]
    assert (second.seq, round(second.leg_m), second.heading_deg) == (2, 100, pytest.approx(0.0, abs=0.01))
    assert second.time_s == pytest.approx(5.0 / 2.5 + 10.0 + 3.0, abs=0.01)
    assert flight.stops[3].heading_deg == pytest.approx(90.0, abs=0.01)
    assert flight.distance_m == pytest.approx(100 + 50 + 50 + 50 + math.hypot(100, 50), abs=0.1)
    assert (flight.highest_m, round(flight.farthest_m)) == (5.0, 112)


def test_a_mission_that_repeats_for_ever_has_no_end() -> None:
    items = (
        item(Command.NAV_WAYPOINT, 10.0, 0.0, 5.0),
        MissionItem(Command.DO_JUMP, Frame.MISSION, 0.0, -1.0),
        item(Command.NAV_LAND),
    )
    flight = itinerary(items, HOME)
    assert math.isinf(flight.time_s)
    assert [stop.seq for stop in flight.stops] == [0]
    assert totals(flight) == "the mission repeats for ever"
    assert clock(3725.4) == "1:02:05"


def test_the_drawing_shows_items_home_fence_and_rally_points() -> None:
    items = tuple(
        item(Command.NAV_WAYPOINT, *place, 5.0) for place in ((40.0, 0.0), (40.0, 40.0), (0.0, 40.0))
    )
    plan = Plan(items, HOME, fence=(circle((20.0, 20.0), 60.0),), rally=(rally_point((10.0, 20.0)),))
    flight = itinerary(plan.items, HOME)
    drawn = draw(places_of(plan, flight, HOME), 60, 20).text().plain
    lines = drawn.splitlines()
    assert len(lines) == 20
    row = {
        mark: next(index for index, line in enumerate(lines) if mark in line)
        for mark in ("0", "1", "2", "H", "R0")
    }
    assert row["0"] == row["1"] < row["R0"] < row["H"] == row["2"]
    assert "50 m, north up" in drawn


def test_a_plan_of_one_place_is_drawn() -> None:
    plan = Plan((item(Command.NAV_WAYPOINT, 0.0, 0.0, 5.0),), HOME)
    assert "H" in draw(places_of(plan, itinerary(plan.items, HOME), HOME), 40, 8).text().plain


def test_the_page_holds_charts_items_and_problems() -> None:
    items = tuple(item(Command.NAV_WAYPOINT, *place, 5.0) for place in ((40.0, 0.0), (40.0, 40.0)))
    plan = Plan(items, HOME, fence=(circle((20.0, 20.0), 60.0),))
    page = plan_page("<square>", plan, itinerary(items, HOME), HOME, ["item 1: is outside the geofence"])
    assert "&lt;square&gt;" in page
    assert "item 1: is outside the geofence" in page
    assert page.count('data-chart="') == 3
    assert "NAV_WAYPOINT" in page


def test_a_foreign_vehicle_is_checked_against_its_geofence_alone() -> None:
    spline = item(82, 20.0, 0.0, 5.0)
    plan = Plan((spline, replace(spline, x=spline.x + 10_000)), HOME)
    fence = (circle((0.0, 0.0), 50.0),)
    assert [problem.seq for problem in plan_problems(plan, HOME, fence=fence)] == [0, 1]
    assert [problem.seq for problem in plan_problems(plan, HOME, fence=fence, is_foreign=True)] == [1]


def test_limits_come_from_the_parameters_of_the_vehicle() -> None:
    limits = limits_of({"MIS_DIST_WPS": 30.0, "GF_MAX_VER_DIST": 0.0})
    assert (limits.max_distance_m, limits.max_altitude_m) == (30.0, DEFAULT_LIMITS.max_altitude_m)
