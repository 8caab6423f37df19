"""Places below the ground, and descents into it: what is refused, and how gently the rest touches down."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.params.config import DEFAULT_HOME
from flightstack.testing import RefusedError
from tests.support.plan_items import item, rally_point
from tests.support.refusals import refused
from tests.support.truth import World

REJECTED, DENIED = 1, 2
GLOBAL, RELATIVE = mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
LANDING_M_S = 0.7
"""MPC_LAND_SPEED."""
NAN = math.nan


@pytest.fixture
def hovering() -> World:
    return hover(8.0)


def hover(altitude_m: float, **params: float) -> World:
    world = World(params=params)
    world.arm()
    world.takeoff(altitude_m)
    world.run_until("mode == 'HOLD'")
    world.run_for(2.0)
    return world


def reposition(world: World, frame: int, altitude_m: float, north: float = 0.0, east: float = 0.0) -> None:
    """Send DO_REPOSITION as a COMMAND_INT."""
    place = LocalFrame(DEFAULT_HOME).to_geo(Vector3(north, east, 0.0))
    scaled = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    world.command_int(mavlink.MAV_CMD_DO_REPOSITION, (-1, 1, 0, NAN), *scaled, altitude_m, frame=frame)


def guided_item(world: World, current: int, altitude_m: float) -> int:
    """MISSION_ITEM_INT with current 2 or 3; return its MAV_MISSION_RESULT."""
    x, y = round(DEFAULT_HOME.latitude_deg * 1e7), round(DEFAULT_HOME.longitude_deg * 1e7)
    world.gcs.received.pop("MISSION_ACK", None)
    world.gcs.send(
        mavlink.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, current, 0, 0, 0, 0, 0, x, y, altitude_m)
    )
    world.run_for(0.05)
    return int(world.gcs.received["MISSION_ACK"].type)


def set_home(world: World, up_m: float) -> None:
    home = DEFAULT_HOME
    world.command(179, 0, 0, 0, 0, home.latitude_deg, home.longitude_deg, home.altitude_m + up_m)


def touchdown_speed(world: World, limit_s: float = 90.0) -> float:
    """Fly until the vehicle is on the ground; return its speed downwards just above it."""
    last_m_s = 0.0
    began_s = world.time_s
    while world.state.altitude_m > 0.02:
        last_m_s = float(world.state.velocity_ned_m_s.z)
        world.tick()
        assert world.time_s - began_s < limit_s, world.state.altitude_m
    return last_m_s


def offboard(world: World, **setpoint: float) -> None:
    values = [setpoint.get(name, NAN) for name in ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")]
    world.gcs.streams["offboard"] = lambda: mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0, *values, NAN, NAN
    )
    world.run_for(0.2)
    world.set_mode("OFFBOARD")


# ---------------------------------------------------------------------- refused


@pytest.mark.parametrize("below_m", [0.1, 50.0, 1e6, 1e30])
def test_a_goto_below_the_ground_is_refused_in_every_frame(hovering: World, below_m: float) -> None:
    sea_m = DEFAULT_HOME.altitude_m
    with refused(DENIED, "is below the ground"):
        reposition(hovering, GLOBAL, sea_m - below_m)
    with refused(DENIED, "is below the ground"):
        reposition(hovering, RELATIVE, -below_m)
    with refused(DENIED, "is below the ground, which is at 0 m"):
        hovering.command(192, -1, 1, 0, NAN, NAN, NAN, sea_m - below_m)
    hovering.run_for(2.0)
    assert hovering.state.altitude_m == pytest.approx(8.0, abs=0.05)


@pytest.mark.parametrize("current", [2, 3])
def test_a_guided_item_below_the_ground_is_refused(hovering: World, current: int) -> None:
    assert guided_item(hovering, current, -50.0) == mavlink.MAV_MISSION_DENIED
    assert guided_item(hovering, current, 5.0) == mavlink.MAV_MISSION_ACCEPTED


def test_a_goto_to_the_ground_itself_touches_down_at_rest(hovering: World) -> None:
    reposition(hovering, RELATIVE, 0.0)
    assert touchdown_speed(hovering) < LANDING_M_S


def test_a_home_that_sank_opens_no_way_below_the_ground(hovering: World) -> None:
    set_home(hovering, -30.0)
    with refused(DENIED, "is below the ground"):
        reposition(hovering, RELATIVE, 10.0)
    reposition(hovering, RELATIVE, 36.0)


def test_a_goto_at_present_altitude_into_a_hill_is_refused(hovering: World) -> None:
    hovering.engine.stack.area.set_rally([rally_point((40.0, 0.0), 20.0)])
    with refused(DENIED, "is below the ground"):
        reposition(hovering, RELATIVE, 8.0, north=38.0)
    reposition(hovering, RELATIVE, 25.0, north=38.0)


def test_a_takeoff_below_the_vehicle_is_refused_and_the_usual_one_is_above_it() -> None:
    world = World()
    set_home(world, -10.0)
    world.takeoff(NAN)
    sea_m = DEFAULT_HOME.altitude_m
    for altitude_m in (sea_m - 5.0, sea_m, sea_m + 0.2):
        with refused(REJECTED, "is not above the vehicle"):
            world.command(22, *[NAN] * 6, altitude_m)
    world.arm()
    world.run_until("mode == 'HOLD'")
    world.run_for(3.0)
    assert world.state.altitude_m == pytest.approx(2.5, abs=0.05)


@pytest.mark.parametrize("altitude_m", [-0.5, -50.0, -1e30, math.inf, NAN])
def test_a_mission_below_home_is_refused(altitude_m: float) -> None:
    world = World()
    with pytest.raises(RefusedError):
        world.upload([item(22, z=3.0), item(16, north=5.0, z=altitude_m)])


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(91.0, 8.0), (47.0, 181.0), (math.inf, 8.0), (NAN, 8.0), (1e30, -1e30)]
)
def test_a_place_that_is_none_is_refused(hovering: World, latitude: float, longitude: float) -> None:
    with refused(DENIED):
        hovering.command(192, -1, 1, 0, NAN, latitude, longitude, DEFAULT_HOME.altitude_m + 5.0)


# ---------------------------------------------------------------------- gently down


@pytest.mark.parametrize(
    "setpoint",
    [
        {"x": 0.0, "y": 0.0, "z": 30.0},
        {"vx": 0.0, "vy": 0.0, "vz": 4.0},
        {"x": 0.0, "y": 0.0, "z": 5.0, "vx": 0.0, "vy": 0.0, "vz": 4.0},
        {"vx": 0.0, "vy": 0.0, "az": 2.0},
    ],
)
@pytest.mark.parametrize("descent_m_s", [1.5, 4.0])
def test_offboard_may_descend_into_the_ground_and_touches_it_slowly(
    setpoint: dict[str, float], descent_m_s: float
) -> None:
    world = hover(12.0, MPC_Z_VEL_MAX_DN=descent_m_s)
    offboard(world, **setpoint)
    assert touchdown_speed(world) < LANDING_M_S + 0.05  # 0.708 m/s seen


def hold_below_the_ground(world: World) -> None:
    assert world.engine.stack.parts.requests.go_to(0.0, 0.0, 20.0, NAN, NAN) is None


def return_to_a_sunken_home(world: World) -> None:
    set_home(world, -30.0)
    world.rtl()


def land_over_a_sunken_home(world: World) -> None:
    set_home(world, -30.0)
    world.land()


def return_to_a_rally_point_below_the_ground(world: World) -> None:
    world.engine.stack.area.set_rally([rally_point((0.0, 5.0), -20.0)])
    assert world.engine.stack.params.set("RTL_TYPE", 1) is None
    world.rtl()


def fly_a_mission_below_a_sunken_home(world: World) -> None:
    set_home(world, -30.0)
    world.upload([item(16, z=10.0)])
    world.set_mode("MISSION")


@pytest.mark.parametrize(
    "begin",
    [
        hold_below_the_ground,
        return_to_a_sunken_home,
        land_over_a_sunken_home,
        return_to_a_rally_point_below_the_ground,
        fly_a_mission_below_a_sunken_home,
    ],
)
def test_ground_that_was_placed_too_low_is_touched_slowly(
    begin: Callable[[World], None], hovering: World
) -> None:
    begin(hovering)
    assert touchdown_speed(hovering) < LANDING_M_S + 0.05


def test_an_offboard_place_beyond_the_earth_is_not_taken() -> None:
    world = hover(5.0)
    world.gcs.send(
        mavlink.MAVLink_set_position_target_global_int_message(
            0,
            1,
            1,
            mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            0b110111111000,
            2_000_000_000,
            0,
            5.0,
            *[0.0] * 8,
        )
    )
    world.run_for(0.1)
    assert any("not on earth" in text for text in world.texts), world.texts
