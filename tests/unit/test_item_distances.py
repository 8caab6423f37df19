"""Miss distance and overshoot of mission items."""

from __future__ import annotations

import pytest

from flightstack.plan import Command, Frame, MissionItem, Plan
from gcs_cli.report.flight_data import Flight, MissionProgress, Series
from gcs_cli.report.summary import item_ned_m, waypoint_rows
from tests.support.square_plan import item_at
from tests.support.synthetic_flight import CORNERS_NED_M, HOME
from tests.support.written_flights import armed_from, samples


def miss(position: Series, mission: list[MissionProgress], items: list[MissionItem]) -> list[float | None]:
    flight = Flight(
        home=HOME, position=position, mission=tuple(mission), statuses=armed_from(0.0), landed=((0.0, False),)
    )
    return [row["miss_distance_m"] for row in waypoint_rows(flight, Plan(tuple(items)))]


def test_miss_distance_counts_only_while_the_item_is_current() -> None:
    waypoints = [
        item_at(Command.NAV_WAYPOINT, (10.0, 0.0, -3.0)),
        item_at(Command.NAV_WAYPOINT, (0.0, 0.0, -3.0)),
    ]
    position = samples([0, 1, 2, 3], [[0, 0, -3], [4, 0, -3], [4, 0, -3], [5, 0, -3]])
    mission = [MissionProgress(1.0, 0, -1, 2, False), MissionProgress(2.0, 1, 0, 2, False)]
    # item 0 while at 4 m north of it: 6 m away; item 1: at best 4 m, though the flight began on it
    assert miss(position, mission, waypoints) == [pytest.approx(6.0, abs=0.01), pytest.approx(4.0, abs=0.01)]


def test_miss_distance_is_to_the_line_between_samples_in_three_dimensions() -> None:
    waypoint = item_at(Command.NAV_WAYPOINT, (0.0, 0.0, -10.0))
    position = samples([0, 1], [[-5, 3, -14], [5, 3, -14]])
    mission = [MissionProgress(0.0, 0, -1, 1, False)]
    [distance] = miss(position, mission, [waypoint])  # passes at 3 m east and 4 m above
    assert distance == pytest.approx(5.0, abs=0.01)


def test_an_item_flown_twice_counts_its_better_pass_and_its_first_time() -> None:
    waypoints = [
        item_at(Command.NAV_WAYPOINT, (10.0, 0.0, 0.0)),
        item_at(Command.NAV_WAYPOINT, (0.0, 0.0, 0.0)),
    ]
    position = samples([0, 1, 2, 3], [[8, 0, 0], [0, 0, 0], [0, 0, 0], [9, 0, 0]])
    mission = [
        MissionProgress(0.0, 0, -1, 2, False),
        MissionProgress(0.5, 1, 0, 2, False),
        MissionProgress(2.5, 0, 1, 2, False),
        MissionProgress(3.0, 0, 0, 2, True),
    ]
    flight = Flight(home=HOME, position=position, mission=tuple(mission), statuses=armed_from(0.0))
    first, _ = waypoint_rows(flight, Plan(tuple(waypoints)))
    assert first["time_s"] == 0.5
    assert first["miss_distance_m"] == pytest.approx(1.0, abs=0.01)


def test_items_without_position_and_items_never_flown_have_no_distance() -> None:
    items = [
        MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION),
        MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION),
        item_at(Command.NAV_WAYPOINT, (1.0, 0.0, 0.0)),
    ]
    flight = Flight(
        home=HOME, position=samples([0], [[0, 0, 0]]), mission=(MissionProgress(0.0, 0, -1, 3, False),)
    )
    assert waypoint_rows(flight, Plan(tuple(items))) == [
        {"seq": 0, "reached": False, "time_s": None, "miss_distance_m": None, "overshoot_m": None},
        {"seq": 2, "reached": False, "time_s": None, "miss_distance_m": None, "overshoot_m": None},
    ]


def test_a_flight_without_mission_has_no_distances() -> None:
    position = samples([0, 1], [[0, 0, 0], [1, 0, 0]])
    assert miss(position, [], [item_at(Command.NAV_WAYPOINT, (0.0, 0.0, 0.0))]) == [None]


def test_altitudes_above_sea_level_and_above_home() -> None:
    relative = item_at(Command.NAV_WAYPOINT, CORNERS_NED_M[1])
    absolute = MissionItem(16, Frame.GLOBAL, x=relative.x, y=relative.y, z=HOME.altitude_m + 4.0)
    flight = Flight(home=HOME)
    for item in (relative, absolute):
        assert item_ned_m(item, flight) == pytest.approx(CORNERS_NED_M[1], abs=0.01)
    assert item_ned_m(relative, Flight()) is None


# ---------------------------------------------------------------- overshoot, attitude, effort


def over(
    path: list[list[float]], items: list[tuple[float, float, float]], begins: list[float]
) -> list[float | None]:
    """Overshoots of waypoints that become current at the times ``begins``; the path has one sample a second."""
    plan = Plan(tuple(item_at(Command.NAV_WAYPOINT, place) for place in items))
    mission = [MissionProgress(at, seq, seq - 1, len(items), False) for seq, at in enumerate(begins)]
    flight = Flight(
        home=HOME,
        position=samples(list(range(len(path))), path),
        mission=tuple(mission),
        statuses=armed_from(0.0),
    )
    return [row["overshoot_m"] for row in waypoint_rows(flight, plan)]


def test_overshoot_is_the_way_beyond_a_waypoint_along_its_leg() -> None:
    path = [[0, 0, -3], [8, 0, -3], [10.6, 1, -3], [10.2, 4, -3], [9, 9, -3], [10, 10.25, -3], [10, 10, -3]]
    corners = [(10.0, 0.0, -3.0), (10.0, 10.0, -3.0)]
    assert over(path, corners, [0.0, 1.5]) == [pytest.approx(0.6, abs=0.01), pytest.approx(0.25, abs=0.01)]


def test_a_corner_that_is_cut_is_not_overshot() -> None:
    path = [[0, 0, -3], [8, 0, -3], [9.5, 1, -3], [9.8, 4, -3], [10, 10, -3]]
    assert over(path, [(10.0, 0.0, -3.0), (10.0, 10.0, -3.0)], [0.0, 1.5])[0] == pytest.approx(0.0, abs=0.01)


def test_overshoot_ends_when_the_vehicle_turns_round_or_reaches_the_next_item() -> None:
    climbs_later = [[0, 0, 0], [0, 0, -2.6], [5, 0, -2.9], [9.6, 0, -3], [10, 5, -5], [10, 10, -5]]
    items = [(0.0, 0.0, -3.0), (10.0, 0.0, -3.0), (10.0, 10.0, -5.0)]
    assert over(climbs_later, items, [0.0, 1.0, 3.0])[0] == pytest.approx(0.0, abs=0.01)
    returns = [[0, 0, -3], [10.3, 0, -3], [10.1, 3, -3], [30, 5, -3]]
    assert over(returns, [(10.0, 0.0, -3.0), (10.0, 50.0, -3.0)], [0.0, 1.0])[0] == pytest.approx(
        0.3, abs=0.01
    )


def test_a_waypoint_on_a_straight_path_has_no_overshoot() -> None:
    path = [[0, 0, -3], [10, 0, -3], [20.5, 0, -3], [20, 0, -3]]
    found = over(path, [(10.0, 0.0, -3.0), (20.0, 0.0, -3.0)], [0.0, 1.0])
    assert found == [None, pytest.approx(0.5, abs=0.01)]
