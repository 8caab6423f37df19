"""Every mission item as guidance flies it, on a vehicle that follows exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.lib.recfunctions import structured_to_unstructured

from flightstack.core.enums import Mode
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.mission import LOG_SIZE, plan_table
from flightstack.plan import MissionItem
from tests.support.perfect_vehicle import NAN, PerfectVehicle

WAYPOINT, LOITER_TIME, RTL, LAND, TAKEOFF, DELAY, YAW, JUMP, SPEED = 16, 19, 20, 21, 22, 93, 115, 177, 178


def waypoint(north=NAN, east=NAN, down=NAN, hold=0.0, radius=0.0, yaw=NAN) -> tuple[float, ...]:
    return (WAYPOINT, hold, radius, 0.0, yaw, north, east, down)


def flying(*plan: tuple[float, ...], at=(0.0, 0.0, -3.0), jumps=None, **params: float) -> PerfectVehicle:
    """A vehicle in the air that has just begun the mission."""
    vehicle = PerfectVehicle(**params)
    vehicle.airborne_at(*at)
    vehicle.plan(*plan, jumps=jumps)
    vehicle.enter(Mode.MISSION)
    return vehicle


def test_takeoff_climbs_straight_first_and_then_flies_to_its_own_place() -> None:
    vehicle = PerfectVehicle()
    vehicle.plan((TAKEOFF, 0.0, 0.0, 0.0, NAN, 6.0, -4.0, -3.0), waypoint(6.0, -4.0, -3.0, hold=1.0))
    vehicle.enter(Mode.MISSION)
    vehicle.until_reached(1)
    path = np.array(vehicle.path)
    assert np.abs(path[path[:, 2] > -2.6 + 0.02][:, :2]).max() == 0.0  # up to the altitude acceptance, 0.4 m
    assert np.diff(path[:, 2]).min() * 50.0 >= -1.5 * 1.004  # takeoff speed
    vehicle.run(5.0)
    assert vehicle.position == pytest.approx([6.0, -4.0, -3.0], abs=1e-3)


def test_takeoff_without_a_place_is_vertical_and_may_turn() -> None:
    vehicle = PerfectVehicle()
    vehicle.plan((TAKEOFF, 0.0, 0.0, 0.0, 90.0, NAN, NAN, -2.0), (DELAY, 5.0))
    vehicle.enter(Mode.MISSION)
    vehicle.until_finished()
    assert np.abs(np.array(vehicle.path)[:, :2]).max() == 0.0
    assert vehicle.yaw == pytest.approx(math.pi / 2, abs=1e-3)


def test_a_waypoint_counts_from_its_acceptance_radius() -> None:
    """Parameter 2, or the parameter NAV_ACC_RAD; a pass is no stop: the next leg begins at once."""
    for radius, expected in ((0.0, 0.5), (2.0, 2.0)):
        vehicle = flying(waypoint(20.0, 0.0, radius=radius), waypoint(20.0, 20.0))
        vehicle.until_reached(1)
        assert expected - 0.16 <= 20.0 - vehicle.position[0] <= expected  # a tick or two at 4 m/s


def test_a_waypoint_holds_for_its_time_within_its_radius() -> None:
    vehicle = flying(waypoint(5.0, 0.0, hold=2.5), waypoint(5.0, 5.0))
    vehicle.until(lambda: vehicle.position[0] >= 4.5)
    assert vehicle.until_reached(1) == pytest.approx(2.5, abs=0.05)
    assert vehicle.position == pytest.approx([5.0, 0.0, -3.0], abs=0.1)


@pytest.mark.parametrize("yaw", [90.0, -170.0, 270.0, 720.0])
def test_a_waypoint_with_a_heading_is_reached_only_with_it(yaw: float) -> None:
    vehicle = flying(waypoint(0.2, 0.0, yaw=yaw), waypoint(0.2, 0.0, hold=5.0))
    vehicle.until_reached(1)
    error = math.remainder(vehicle.yaw - math.radians(yaw), 2 * math.pi)
    assert abs(math.degrees(error)) <= 12.0  # MIS_YAW_ERR
    if yaw != 720.0:
        assert vehicle.time_s > 0.5  # the place alone was reached at once


def test_without_a_heading_the_nose_leads_or_stays() -> None:
    toward = flying(waypoint(0.0, 10.0, hold=1.0))
    toward.until_finished()
    assert toward.yaw == pytest.approx(math.pi / 2, abs=1e-3)
    kept = flying(waypoint(0.0, 10.0, hold=1.0), MPC_YAW_MODE=5.0)
    kept.until_finished()
    assert kept.yaw == 0.0
    near = flying(waypoint(0.0, 0.9, hold=1.0))  # too near for a direction
    near.until_finished()
    assert near.yaw == 0.0


def test_what_a_waypoint_leaves_open_stays_as_it_is() -> None:
    vehicle = flying(waypoint(5.0, 6.0, -4.0), waypoint(down=-7.0), waypoint(north=1.0, hold=3.0))
    vehicle.until_reached(2)
    assert vehicle.position[:2] == pytest.approx([5.0, 6.0], abs=0.5)
    vehicle.until_finished()
    assert vehicle.position == pytest.approx([1.0, 6.0, -7.0], abs=0.01)


def test_loiter_time_stays_and_has_no_heading_of_its_own() -> None:
    vehicle = flying((LOITER_TIME, 3.0, 0.0, 0.0, 45.0, 6.0, 0.0, -3.0), waypoint(6.0, 6.0))
    vehicle.until(lambda: vehicle.position[0] >= 5.5)
    assert vehicle.until_reached(1) == pytest.approx(3.0, abs=0.05)
    assert abs(vehicle.yaw) < 0.01  # the next leg has just begun


def test_delay_waits_where_the_vehicle_is() -> None:
    vehicle = flying((DELAY, 4.0), waypoint(3.0, 0.0))
    assert vehicle.until_reached(1) == pytest.approx(4.0, abs=0.05)
    assert vehicle.position == pytest.approx([0.0, 0.0, -3.0], abs=1e-3)


def test_land_flies_there_at_height_and_slows_down_near_the_ground() -> None:
    vehicle = flying((LAND, 0.0, 0.0, 0.0, NAN, 5.0, 0.0, 0.0), at=(0.0, 0.0, -6.0))
    vehicle.until(lambda: vehicle.position[0] > 4.4)
    assert np.array(vehicle.path)[:, 2].tolist() == [-6.0] * len(vehicle.path)
    vehicle.until_finished()
    assert vehicle.navigator.landed
    assert vehicle.position == pytest.approx([5.0, 0.0, 0.0], abs=0.01)
    path = np.array(vehicle.path)
    sink = np.diff(path[:, 2]) * 50.0
    assert sink.max() == pytest.approx(1.5, rel=0.004)
    below = path[1:, 2] > -2.0  # MPC_LAND_ALT2 is 3 m; a metre to slow down
    assert sink[below].max() == pytest.approx(0.7, abs=0.01)


def test_return_to_launch_hands_over() -> None:
    vehicle = flying((RTL,), waypoint(5.0, 0.0))
    vehicle.run(0.1)
    assert vehicle.navigator.progress.wants_return
    assert vehicle.reached == [0]


@pytest.mark.parametrize(
    ("speeds", "expected"), [((2.0,), 2.0), ((2.0, -1.0), 2.0), ((2.0, -2.0), 4.0), ((50.0,), 12.0)]
)
def test_change_speed_sets_keeps_resets_and_is_limited(speeds: tuple[float, ...], expected: float) -> None:
    changes = [(SPEED, 1.0, speed, -1.0, 0.0) for speed in speeds]
    vehicle = flying(*changes, waypoint(120.0, 0.0))
    vehicle.until_finished()
    fastest = np.diff(np.array(vehicle.path)[:, 0]).max() * 50.0
    assert fastest == pytest.approx(expected, rel=0.004)
    assert vehicle.reached == list(range(len(speeds) + 1))


# ---------------------------------------------------------------------- CONDITION_YAW


@pytest.mark.parametrize(
    ("start", "angle", "direction", "relative", "turn"),
    [
        # absolute: the short way, clockwise, counter-clockwise
        (0.0, 90.0, 0.0, 0.0, 90.0),
        (0.0, 270.0, 0.0, 0.0, -90.0),
        (0.0, 90.0, 1.0, 0.0, 90.0),
        (0.0, 90.0, -1.0, 0.0, -270.0),
        (0.0, 270.0, 1.0, 0.0, 270.0),
        (150.0, -150.0, -1.0, 0.0, -300.0),
        (150.0, -150.0, NAN, 0.0, 60.0),
        (90.0, 90.0, 1.0, 0.0, 0.0),
        # relative: direction gives the sign, more than half a circle is flown
        (30.0, 90.0, 1.0, 1.0, 90.0),
        (30.0, 90.0, -1.0, 1.0, -90.0),
        (30.0, 270.0, 1.0, 1.0, 270.0),
        (30.0, 270.0, -1.0, 1.0, -270.0),
        (30.0, 360.0, 1.0, 1.0, 360.0),
        (30.0, 360.0, -1.0, 1.0, -360.0),
        (30.0, 270.0, 0.0, 1.0, -90.0),
        (30.0, -90.0, 0.0, 1.0, -90.0),
        (30.0, 90.0, 0.0, 1.0, 90.0),
    ],
)
def test_condition_yaw_turns_as_far_and_in_the_direction_it_says(
    start: float, angle: float, direction: float, relative: float, turn: float
) -> None:
    vehicle = PerfectVehicle()
    half = math.radians(start) / 2
    vehicle.state[6], vehicle.state[9] = math.cos(half), math.sin(half)
    vehicle.airborne_at(0.0, 0.0, -3.0)
    vehicle.plan((YAW, angle, 0.0, direction, relative), (DELAY, 6.0))
    vehicle.enter(Mode.MISSION)
    vehicle.until_reached(1)
    # done when the heading is within MIS_YAW_ERR of the end of the whole turn
    assert abs(math.degrees(vehicle.turned) - turn) <= 12.5
    vehicle.until_finished()
    assert math.degrees(vehicle.turned) == pytest.approx(turn, abs=0.01)


def test_condition_yaw_keeps_its_rate_and_the_next_item_has_its_own() -> None:
    vehicle = flying((YAW, 90.0, 20.0, 1.0, 1.0), waypoint(yaw=0.0), (DELAY, 3.0))
    vehicle.until_reached(1)
    rates = np.abs(np.diff(np.unwrap(vehicle.yaws))) * 50.0
    assert math.degrees(rates.max()) == pytest.approx(20.0, abs=0.01)
    vehicle.until_finished()
    assert math.degrees(np.abs(np.diff(np.unwrap(vehicle.yaws))).max() * 50.0) == pytest.approx(60.0, abs=0.3)
    fast = flying((YAW, 180.0, 500.0, 1.0, 1.0), (DELAY, 3.0))
    fast.until_finished()
    assert math.degrees(np.abs(np.diff(np.unwrap(fast.yaws))).max() * 50.0) <= 60.1  # MPC_YAWRAUTO_MAX


def test_a_heading_once_given_stays_for_legs_without_one() -> None:
    vehicle = flying((YAW, 45.0, 0.0, 0.0, 0.0), waypoint(0.0, 20.0), waypoint(20.0, 20.0))
    vehicle.until_finished()
    assert vehicle.yaw == pytest.approx(math.radians(45.0), abs=1e-3)


def test_on_the_ground_condition_yaw_waits_for_no_turn_and_is_made_in_the_air() -> None:
    vehicle = PerfectVehicle()
    vehicle.plan((YAW, 90.0, 0.0, 0.0, 0.0), (TAKEOFF, 0.0, 0.0, 0.0, NAN, NAN, NAN, -2.0), (DELAY, 3.0))
    vehicle.enter(Mode.MISSION)
    vehicle.run(0.1)
    assert vehicle.reached == [0]
    vehicle.enter(Mode.MISSION)  # as the autopilot does when it starts the loops
    vehicle.until_finished()
    assert vehicle.yaw == pytest.approx(math.pi / 2, abs=1e-3)


# ---------------------------------------------------------------------- DO_JUMP


@pytest.mark.parametrize(("repeats", "rounds"), [(0.0, 1), (1.0, 2), (3.0, 4)])
def test_do_jump_repeats_so_many_times(repeats: float, rounds: int) -> None:
    vehicle = flying(
        waypoint(1.0, 0.0), waypoint(0.0, 0.0), (JUMP, 0.0, repeats), waypoint(2.0, 0.0), jumps={2: repeats}
    )
    vehicle.until_finished()
    assert vehicle.reached == [0, 1, 2] * rounds + [3]


def test_do_jump_for_ever_never_goes_on() -> None:
    vehicle = flying(waypoint(1.0, 0.0), (DELAY, 0.5), (JUMP, 0.0, -1.0), waypoint(2.0, 0.0), jumps={2: -1.0})
    vehicle.run(200.0)
    assert len(vehicle.reached) > 150
    assert 3 not in vehicle.reached
    assert not vehicle.navigator.progress.finished


def test_nested_jumps_and_jumps_ahead() -> None:
    vehicle = flying(
        (DELAY, 0.1), (JUMP, 3.0, 1.0), (DELAY, 0.1), (DELAY, 0.1), (JUMP, 0.0, 1.0), jumps={1: 1.0, 4: 1.0}
    )
    vehicle.until_finished()
    assert vehicle.reached == [0, 1, 3, 4, 0, 1, 2, 3, 4]


def test_a_finished_mission_begins_anew_with_all_its_jumps() -> None:
    vehicle = flying((DELAY, 0.1), (JUMP, 0.0, 2.0), jumps={1: 2.0})
    vehicle.until_finished()
    first, vehicle.reached = vehicle.reached, []
    vehicle.enter(Mode.MISSION)
    vehicle.until_finished()
    assert vehicle.reached == first == [0, 1] * 3


# ---------------------------------------------------------------------- interruptions


def test_after_a_hold_the_item_begins_anew_at_the_speed_and_heading_set_before() -> None:
    vehicle = flying((SPEED, 1.0, 2.0), (YAW, 30.0, 0.0, 0.0, 0.0), waypoint(100.0, 0.0), MPC_YAW_MODE=0.0)
    vehicle.until(lambda: vehicle.position[0] > 20.0)
    vehicle.enter(Mode.HOLD)
    vehicle.run(5.0)
    stopped = vehicle.position
    vehicle.enter(Mode.MISSION)
    vehicle.path.clear()
    vehicle.until_finished()
    assert np.diff(np.array(vehicle.path)[:, 0]).max() * 50.0 == pytest.approx(2.0, rel=0.004)
    assert vehicle.yaw == pytest.approx(math.radians(30.0), abs=1e-3)
    assert stopped[0] < 23.0
    assert vehicle.reached == [0, 1, 2]


def test_a_jump_to_an_item_begins_there() -> None:
    vehicle = flying(waypoint(50.0, 0.0), waypoint(0.0, 5.0), (DELAY, 1.0))
    vehicle.run(1.0)
    vehicle.navigator.set_current(1)
    vehicle.until_finished()
    assert vehicle.reached == [1, 2]


def test_many_items_reached_in_one_tick_are_all_reported() -> None:
    changes = [(SPEED, 1.0, 3.0)] * (LOG_SIZE - 4)
    vehicle = flying(*changes, (DELAY, 0.1))
    vehicle.until_finished()
    assert vehicle.reached == list(range(LOG_SIZE - 3))


def test_an_empty_plan_is_finished_at_once() -> None:
    vehicle = flying()
    vehicle.run(0.1)
    assert vehicle.navigator.progress.finished


def test_plan_table_places_items_around_home_and_leaves_open_what_they_do() -> None:
    home = GeoPoint(47.4, 8.5, 488.0)
    frame = LocalFrame(home)
    unset = 2**31 - 1
    items = [
        MissionItem(22, 3, 0.0, 0.0, 0.0, NAN, unset, unset, 3.0),
        MissionItem(16, 0, 1.0, 2.0, 0.0, 90.0, 474010000, 85020000, 500.0),
        MissionItem(16, 6, 0.0, 0.0, 0.0, NAN, 474010000, 85020000, NAN),
        MissionItem(177, 2, 1.0, 5.0),
    ]
    table, jumps = plan_table(items, LocalFrame(home), home.altitude_m)
    plan = structured_to_unstructured(table)
    place = frame.to_ned(GeoPoint(47.401, 8.502, 488.0))
    assert plan[0].tolist()[:4] == [22.0, 0.0, 0.0, 0.0]
    assert np.isnan(plan[0, 4:7]).all()
    assert plan[0, 7] == -3.0
    assert plan[1].tolist() == pytest.approx([16.0, 1.0, 2.0, 0.0, 90.0, place.x, place.y, -12.0])
    assert math.isnan(plan[2, 7])
    assert jumps.tolist() == [0.0, 0.0, 0.0, 5.0]
