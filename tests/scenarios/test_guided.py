"""Guided flight: go to a place, at a speed, pause and go on; and flight by sticks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.params.config import DEFAULT_HOME
from tests.support.plan_items import circle
from tests.support.refusals import refused
from tests.support.streams import go_to, sticks, stream
from tests.support.truth import World

REJECTED, DENIED, UNSUPPORTED_FRAME = 1, 2, 9
NAN = math.nan


@pytest.fixture
def hovering() -> World:
    world = World()
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    world.run_for(4.0)
    return world


def heading(world: World) -> float:
    q = world.engine.simulator.frame.state[6:10]
    return 2.0 * math.atan2(q[3], q[0])


def fastest(world: World, seconds: float) -> np.ndarray:
    """Fly on; return the largest horizontal, upward and downward speed."""
    top = np.zeros(3)
    for _ in range(round(seconds / 0.1)):
        world.run_for(0.1)
        north, east, down = world.state.velocity_ned_m_s
        top = np.maximum(top, (math.hypot(north, east), -down, down))
    return top


def test_goto_flies_to_the_place_looking_there(hovering: World) -> None:
    go_to(hovering, 12.0, 9.0, 8.0)
    hovering.run_for(14.0)
    # a position in single precision is 0.4 m of latitude and longitude in a COMMAND_LONG
    assert math.dist(hovering.state.position_ned_m, (12.0, 9.0, -8.0)) < 0.6
    assert heading(hovering) == pytest.approx(math.atan2(9.0, 12.0), abs=0.05)
    assert hovering.state.mode == "HOLD"


def test_goto_in_degrees_above_home_is_exact_and_takes_its_heading_in_radians(hovering: World) -> None:
    place = LocalFrame(DEFAULT_HOME).to_geo(Vector3(10.0, -6.0, 0.0))
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    command = mavlink.MAV_CMD_DO_REPOSITION
    hovering.command_int(command, (2.0, 1, 0, 1.5), x, y, 7.0, frame=6)
    top = fastest(hovering, 15.0)
    assert (
        math.dist(hovering.state.position_ned_m, (10.0, -6.0, -7.0)) < 0.02
    )  # a unit of 1e-7 degrees is 0.011 m
    assert heading(hovering) == pytest.approx(1.5, abs=0.01)
    assert top[0] == pytest.approx(2.0, rel=0.02)


def test_what_a_goto_leaves_open_stays(hovering: World) -> None:
    go_to(hovering, altitude=9.0)
    hovering.run_for(8.0)
    assert hovering.state.position_ned_m == pytest.approx([0.0, 0.0, -9.0], abs=0.02)
    go_to(hovering, 8.0, 0.0, yaw=0.5)
    hovering.run_for(10.0)
    assert hovering.state.altitude_m == pytest.approx(9.0, abs=0.02)
    assert heading(hovering) == pytest.approx(0.5, abs=0.02)


def test_a_goto_of_nothing_is_a_pause(hovering: World) -> None:
    hovering.upload("square.plan")
    hovering.set_mode("MISSION")
    hovering.run_until(lambda _: float(np.linalg.norm(hovering.state.velocity_ned_m_s)) > 2.0)
    go_to(hovering)
    assert hovering.state.mode == "HOLD"
    hovering.run_for(5.0)
    assert np.linalg.norm(hovering.state.velocity_ned_m_s) < 0.02


@pytest.mark.parametrize(
    ("place", "result", "reason"),
    [
        ({"north": 5.0, "east": 0.0, "altitude": 1e4}, DENIED, "is above"),
        ({"north": 5e4, "east": 0.0}, DENIED, "km away"),
        ({"north": 5.0, "east": 0.0, "altitude": math.inf}, DENIED, "not a number"),
        ({"north": 5.0, "east": 0.0, "yaw": math.inf}, DENIED, "not a number"),
        ({"north": 2e7, "east": 0.0}, DENIED, "not on earth"),
    ],
)
def test_a_goto_that_cannot_be_is_refused(
    hovering: World, place: dict[str, float], result: int, reason: str
) -> None:
    with refused(result, reason):
        go_to(hovering, **place)


def test_a_goto_needs_the_air_a_known_frame_and_a_mode() -> None:
    world = World()
    with refused(REJECTED, "on the ground"):
        go_to(world, 5.0, 5.0, 5.0)
    command = mavlink.MAV_CMD_DO_REPOSITION
    with refused(UNSUPPORTED_FRAME, "frame 1 is not supported"):
        world.command_int(command, (-1.0, 1, 0, NAN), 0, 0, 7.0, frame=1)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not landed")
    with refused(REJECTED, "not in hold mode"):
        go_to(world, 5.0, 5.0, 5.0, flags=0.0)
    assert world.state.mode == "MISSION"


def test_speeds_change_in_flight_and_come_back(hovering: World) -> None:
    change = mavlink.MAV_CMD_DO_CHANGE_SPEED
    hovering.command(change, 1, 2.0, -1)
    hovering.command(change, 2, 1.0, -1)
    hovering.command(change, 3, 0.6, -1)
    go_to(hovering, 15.0, 0.0, 10.0)
    top = fastest(hovering, 12.0)
    assert top[:2] == pytest.approx([2.0, 1.0], rel=0.02)
    hovering.command(change, 1, -2.0, -1)
    go_to(hovering, -15.0, 0.0, 6.0)
    top = fastest(hovering, 14.0)
    assert top[0] == pytest.approx(4.0, rel=0.03)  # MPC_XY_CRUISE
    assert top[2] == pytest.approx(0.6, rel=0.02)
    for which, speed in ((1, 0.0), (1, NAN), (7, 3.0), (NAN, 3.0), (1, -5.0)):
        with refused(DENIED):
            hovering.command(change, which, speed, -1)
    hovering.command(change, 1, -1.0, -1)


def test_a_mission_flies_at_a_changed_speed_pauses_and_goes_on(hovering: World) -> None:
    hovering.upload("square.plan")
    hovering.set_mode("MISSION")
    hovering.run_until(lambda _: 1 in hovering.reached)
    hovering.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 1.0, -1)
    hovering.run_for(3.0)
    assert np.linalg.norm(hovering.state.velocity_ned_m_s[:2]) == pytest.approx(1.0, rel=0.05)
    hovering.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    assert hovering.state.mode == "HOLD"
    hovering.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1)
    assert hovering.state.mode == "MISSION"
    with refused(DENIED, "must be 0 (pause) or 1 (continue)"):
        hovering.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 2)
    hovering.run_until("not armed")
    assert hovering.reached == [0, 1, 2, 3, 4, 5]


def test_a_takeoff_above_home_by_its_frame() -> None:
    world = World()
    world.arm()
    take_off_int(world, 3, 6.0)
    world.run_until("mode == 'TAKEOFF'", 1.0)
    world.run_until("mode == 'HOLD'")
    world.run_for(4.0)
    assert world.state.altitude_m == pytest.approx(6.0, abs=0.02)


def test_a_generic_autopilot_takes_off_to_an_altitude_above_home() -> None:
    world = World(params={"FS_AUTOPILOT": 1})
    world.arm()
    world.command(mavlink.MAV_CMD_NAV_TAKEOFF, *[NAN] * 6, 6.0)
    world.run_until("mode == 'HOLD'")
    assert world.state.altitude_m == pytest.approx(6.0, abs=0.4)


def take_off_int(world: World, frame: int, altitude_m: float) -> None:
    """Send NAV_TAKEOFF as a COMMAND_INT."""
    world.command_int(mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, NAN), 0, 0, altitude_m, frame=frame)


@pytest.mark.parametrize(("frame", "altitude_m"), [(0, 494.0), (5, 494.0), (3, 6.0), (6, 6.0)])
def test_a_generic_autopilot_takes_an_altitude_as_its_frame_says(frame: int, altitude_m: float) -> None:
    world = World(params={"FS_AUTOPILOT": 1})
    world.arm()
    take_off_int(world, frame, altitude_m)
    world.run_until("mode == 'HOLD'")
    assert world.state.altitude_m == pytest.approx(6.0, abs=0.4)


@pytest.mark.parametrize("generic", [0, 1])
@pytest.mark.parametrize("frame", [1, 2, 8, 10, 11])
def test_a_takeoff_in_terrain_or_local_frames_is_not_supported(frame: int, generic: int) -> None:
    world = World(params={"FS_AUTOPILOT": generic})
    world.arm()
    with refused(UNSUPPORTED_FRAME, f"frame {frame} is not supported"):
        take_off_int(world, frame, 6.0)
    assert world.state.mode == "HOLD"


def test_a_goto_out_of_the_geofence_is_refused() -> None:
    world = World(params={"GF_MAX_HOR_DIST": 20, "GF_MAX_VER_DIST": 15})
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    with refused(DENIED, "the place is more than 20 m from home"):
        go_to(world, 30.0, 0.0)
    with refused(DENIED, "is above 15 m"):
        go_to(world, altitude=16.0)
    go_to(world, 15.0, 0.0, 12.0)


def test_who_is_outside_the_geofence_may_pause_and_come_nearer_but_not_go_farther() -> None:
    world = World(params={"GF_ACTION": 1})
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    go_to(world, 30.0, 0.0)
    world.run_for(14.0)
    world.upload("square.plan")
    world.set_mode("MISSION")
    world.engine.stack.params.set("GF_MAX_HOR_DIST", 20.0)
    world.engine.stack.params.set("GF_MAX_VER_DIST", 15.0)
    assert world.engine.stack.area.fence.refusal(*world.state.position_ned_m[:2]) is not None
    go_to(world)
    assert world.state.mode == "HOLD"
    with refused(DENIED, "more than 20 m from home"):
        go_to(world, 35.0, 0.0)
    with refused(DENIED, "is above 15 m"):
        go_to(world, 25.0, 0.0, 16.0)  # no farther, but too high
    go_to(world, 25.0, 0.0)
    world.run_for(6.0)
    assert world.state.north_m == pytest.approx(25.0, abs=0.6)


def test_a_goto_across_an_exclusion_area_is_refused() -> None:
    world = World()
    world.engine.stack.area.set_fence([circle((15.0, 0.0), 5.0, inclusion=False)])
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    with refused(DENIED, "beyond an edge of the geofence"):
        go_to(world, 30.0, 0.0)
    go_to(world, 15.0, 12.0)


# ---------------------------------------------------------------------- sticks


def test_sticks_need_a_stream_in_flight(hovering: World) -> None:
    for mode in ("POSITION", "ALTITUDE"):
        with refused(REJECTED, "no manual control"):
            hovering.set_mode(mode)


def test_a_whole_flight_by_sticks() -> None:
    world = World(params={"MPC_VEL_MANUAL": 3})
    stream(world, sticks(up=-1.0), 0.2)
    world.set_mode("POSITION")
    world.arm()
    stream(world, sticks(), 2.0)
    assert world.state.landed  # a centred throttle does not take off
    stream(world, sticks(up=1.0), 4.0)
    assert not world.state.landed
    stream(world, sticks(forward=1.0), 5.0)
    assert world.state.velocity_ned_m_s == pytest.approx([3.0, 0.0, 0.0], abs=0.02)
    stream(world, sticks(yaw=0.5), 3.0)
    stream(world, sticks(), 4.0)
    place = world.state.position_ned_m
    stream(world, sticks(), 4.0)
    assert math.dist(world.state.position_ned_m, place) < 0.01
    for _ in range(2000):
        if not world.state.armed:
            break
        stream(world, sticks(up=-1.0), 0.02)
    assert not world.state.armed
    assert abs(world.state.altitude_m) < 0.01
    assert math.dist(world.state.position_ned_m[:2], place[:2]) < 0.02


def test_position_mode_holds_its_place_in_wind() -> None:
    world = World(wind=(4.0, 2.0, 0.0), drag=True)
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    world.run_for(5.0)
    stream(world, sticks(), 0.1)
    world.set_mode("POSITION")
    place = world.state.position_ned_m
    stream(world, sticks(), 10.0)
    assert math.dist(world.state.position_ned_m, place) < 0.05


def test_altitude_mode_tilts_and_keeps_its_height(hovering: World) -> None:
    stream(hovering, sticks(), 0.1)
    hovering.set_mode("ALTITUDE")
    height = hovering.state.altitude_m
    stream(hovering, sticks(right=0.6), 1.5)
    q = hovering.engine.simulator.frame.state[6:10]
    roll = math.atan2(2.0 * (q[0] * q[1] + q[2] * q[3]), 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2))
    # past the dead zone, 0.5 of 0.9 of 35 degrees
    assert math.degrees(roll) == pytest.approx(35.0 * 0.5 / 0.9, abs=1.0)
    assert hovering.state.altitude_m == pytest.approx(height, abs=0.05)
    stream(hovering, sticks(), 0.5)
    drifting = hovering.state.velocity_ned_m_s.y
    assert drifting > 2.0  # level again, and nothing brakes it but the air
    hovering.set_mode("HOLD")
    hovering.run_for(6.0)
    assert np.linalg.norm(hovering.state.velocity_ned_m_s) < 0.02


def test_the_last_of_two_pilots_wins(hovering: World) -> None:
    stream(hovering, sticks(), 0.1)
    hovering.set_mode("POSITION")
    stream(hovering, sticks(forward=1.0), 2.0)
    stream(hovering, sticks(forward=-1.0), 6.0)
    assert hovering.state.velocity_ned_m_s.x < -3.0
