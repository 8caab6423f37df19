"""Home, returns and missions within the limits: what may be moved in flight, and what never leads out of the fence."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.params.config import DEFAULT_HOME
from flightstack.plan import MissionItem, MissionType
from tests.support.plan_items import item, polygon, rally_point, square
from tests.support.refusals import refused
from tests.support.streams import sticks
from tests.support.truth import World

DENIED, UNSUPPORTED_FRAME = 2, 9
FRAME = LocalFrame(DEFAULT_HOME)
SET_HOME = mavlink.MAV_CMD_DO_SET_HOME


def upload(world: World, kind: MissionType, items: list[MissionItem]) -> None:
    """Upload a plan of any type."""
    world.upload(items, kind)


def hover(altitude_m: float = 5.0, **params: float) -> World:
    """A vehicle that hovers above home."""
    world = World(params=params)
    world.arm()
    world.takeoff(altitude_m)
    world.run_until("mode == 'HOLD'")
    world.run_for(4.0)
    return world


def set_home(world: World, north_m: float, east_m: float = 0.0, up_m: float = 0.0, frame: int = 0) -> None:
    """Send DO_SET_HOME as a COMMAND_INT: a place seen from where the vehicle started."""
    place = FRAME.to_geo(Vector3(north_m, east_m, -up_m))
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    world.command_int(SET_HOME, (0.0, 0.0, 0.0, 0.0), x, y, place.altitude_m, frame=frame)


def go_north(world: World, north_m: float, seconds: float) -> None:
    """Fly to a place to the north of the origin."""
    assert world.engine.stack.parts.requests.go_to(north_m, 0.0, math.nan, math.nan, math.nan) is None
    world.run_for(seconds)


def margin(world: World) -> float:
    """Distance to the nearest limit of the fence, as the vehicle sees it."""
    return world.engine.stack.area.fence.margin_m


# ---------------------------------------------------------------------- home and the geofence


def test_home_is_not_moved_out_of_the_geofence() -> None:
    world = hover()
    upload(world, MissionType.FENCE, polygon(square(20.0)))
    with refused(DENIED, "outside the geofence"):
        set_home(world, 40.0)
    assert world.engine.stack.area.home == DEFAULT_HOME
    world.rtl()
    world.run_until("not armed")
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.1


def test_a_return_lands_where_it_is_if_no_place_to_return_to_is_inside_the_geofence() -> None:
    """The vehicle armed outside while the fence was switched off: home came along."""
    world = World(params={"GF_ACTION": 0})
    upload(world, MissionType.FENCE, polygon(square(20.0)))
    world.arm()
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    go_north(world, 40.0, 18.0)
    world.land()
    world.run_until("not armed")
    world.arm()
    assert world.engine.stack.places.home.north_m == pytest.approx(40.0, abs=0.1)
    world.takeoff(5.0)
    world.run_until("mode == 'HOLD'")
    go_north(world, 5.0, 18.0)
    assert world.engine.stack.params.set("GF_ACTION", 3.0) is None
    world.run_for(0.1)
    world.rtl()
    assert world.state.mode == "LAND"
    world.run_for(0.02)
    assert sum("No place to return to" in text for text in world.texts) == 1
    world.run_until("not armed")
    assert math.dist(world.state.position_ned_m[:2], (5.0, 0.0)) < 0.1


def test_a_return_to_an_outside_home_takes_a_rally_point_inside() -> None:
    world = hover()
    upload(world, MissionType.RALLY, [rally_point((0.0, 8.0))])
    set_home(world, 40.0)  # and then a fence without it, from a reboot with other plans
    world.engine.stack.area.set_fence(polygon(square(20.0)))
    world.rtl()
    assert world.state.mode == "RETURN"
    world.run_until("not armed")
    assert math.dist(world.state.position_ned_m[:2], (0.0, 8.0)) < 0.1


def test_home_is_not_moved_so_far_that_a_flying_vehicle_would_break_the_limit() -> None:
    world = hover(GF_MAX_HOR_DIST=20)
    with refused(DENIED, "more than 20 m from the vehicle (GF_MAX_HOR_DIST)"):
        set_home(world, 30.0)
    set_home(world, 15.0)


# ---------------------------------------------------------------------- home and the mission in flight


def test_home_does_not_sink_under_a_mission_in_flight() -> None:
    world = World()
    world.upload([item(22, z=8.0), item(16, north=60.0, z=8.0), item(21, north=60.0)])
    world.arm()
    world.start_mission()
    world.run_until("north_m > 10.0")
    with refused(DENIED, "pause it first"):
        set_home(world, 0.0, up_m=-7.5)
    world.run_for(3.0)
    assert world.state.altitude_m == pytest.approx(8.0, abs=0.1)
    set_home(world, 5.0)  # its height stays


def test_home_is_not_moved_where_the_mission_in_flight_would_be_refused() -> None:
    world = World(params={"GF_MAX_HOR_DIST": 70})
    world.upload([item(22, z=8.0), item(16, north=60.0, z=8.0), item(21, north=60.0)])
    world.arm()
    world.start_mission()
    world.run_until("north_m > 10.0")
    with refused(DENIED, "is 90 m from home"):
        set_home(world, -30.0)


@pytest.mark.parametrize("up_m", [1_500.0, -1_500.0])
def test_home_is_not_a_kilometre_above_or_below_the_ground(up_m: float) -> None:
    world = World()
    with refused(DENIED, "above or below"):
        set_home(world, 0.0, up_m=up_m)


@pytest.mark.parametrize("frame", [1, 2, 8, 10, 11])
def test_home_in_terrain_or_local_frames_is_not_supported(frame: int) -> None:
    world = World()
    with refused(UNSUPPORTED_FRAME, f"frame {frame} is not supported"):
        set_home(world, 0.0, frame=frame)
    assert world.engine.stack.area.home == DEFAULT_HOME


def test_lower_limits_hold_a_mission_that_breaks_them() -> None:
    world = World()
    world.upload([item(22, z=8.0), item(16, north=60.0, z=20.0), item(21, north=60.0)])
    world.arm()
    world.start_mission()
    world.run_until("north_m > 5.0")
    assert world.engine.stack.params.set("GF_MAX_VER_DIST", 19.0) is None
    world.run_for(0.02)
    assert world.state.mode == "HOLD"
    assert any(text.startswith("Mission held: item 1 (NAV_WAYPOINT)") for text in world.texts), world.texts
    with refused(reason="altitude 20 m above home is outside 0 to 19 m"):
        world.set_mode("MISSION")
    assert world.state.mode == "HOLD"
    world.engine.stack.params.set("GF_MAX_VER_DIST", 25.0)
    world.set_mode("MISSION")


def test_a_mission_is_checked_whole_when_it_is_selected_from_another_home() -> None:
    world = hover()
    world.upload([item(16, north=60.0, z=8.0), item(21, north=60.0)])
    assert world.engine.stack.params.set("GF_MAX_HOR_DIST", 70.0) is None
    set_home(world, -30.0)
    with refused(reason="is 90 m from home"):
        world.set_mode("MISSION")
    assert world.state.mode == "HOLD"


# ---------------------------------------------------------------------- altitudes


def test_a_return_stays_below_the_highest_altitude_of_the_fence() -> None:
    world = hover(GF_MAX_VER_DIST=12, RTL_RETURN_ALT=30, GF_ACTION=3)
    go_north(world, 25.0, 12.0)
    world.rtl()
    highest_m = 0.0
    while world.state.armed:
        world.run_for(0.1)
        highest_m = max(highest_m, world.state.altitude_m)
        assert margin(world) > 0.0
        assert world.time_s < 120.0
    assert 10.5 < highest_m < 11.1  # a metre below the limit
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.1


def test_a_return_from_above_the_limit_comes_down_first() -> None:
    world = hover(20.0)
    go_north(world, 25.0, 12.0)
    assert world.engine.stack.params.set("GF_ACTION", 0.0) is None
    world.engine.stack.params.set("GF_MAX_VER_DIST", 12.0)
    world.rtl()
    world.run_until("north_m < 22.0")
    assert world.state.altitude_m < 11.5


def test_a_mission_that_begins_with_a_waypoint_rises_no_higher_than_the_fence() -> None:
    world = World(params={"GF_MAX_VER_DIST": 6, "MIS_TAKEOFF_ALT": 10, "GF_ACTION": 3})
    world.upload([item(16, north=8.0, z=3.0), item(21, north=8.0)])
    world.arm()
    world.start_mission()
    highest_m = 0.0
    while world.state.armed:
        world.run_for(0.1)
        highest_m = max(highest_m, world.state.altitude_m)
        assert world.time_s < 60.0, world.texts
    assert world.reached == [0, 1]
    assert highest_m < 5.2


def test_a_rally_points_altitude_counts_from_a_moved_home() -> None:
    world = hover(10.0)
    upload(world, MissionType.RALLY, [rally_point((30.0, 0.0), 2.0)])
    set_home(world, 0.0, up_m=4.0)
    (point,) = world.engine.stack.places.points
    assert point.altitude_m == pytest.approx(6.0, abs=1e-3)
    upload(world, MissionType.RALLY, [rally_point((30.0, 0.0), 3.0)])
    (point,) = world.engine.stack.places.points
    assert point.altitude_m == pytest.approx(7.0, abs=1e-3)


# ---------------------------------------------------------------------- near the ground


def slow_from(world: World) -> float:
    """Descend; return the altitude at which the vehicle has become slow: the last 0.6 m of it were for that."""
    world.run_until(lambda s: s.velocity_ned_m_s.z > 1.3)
    world.run_until(lambda s: s.velocity_ned_m_s.z < 0.8)
    return world.state.altitude_m


def begin_landing(world: World) -> None:
    world.land()


def begin_return(world: World) -> None:
    world.rtl()


def begin_mission(world: World) -> None:
    world.upload([item(21)])
    world.set_mode("MISSION")


def begin_sticks(world: World) -> None:
    world.gcs.streams["sticks"] = lambda: sticks(up=-1.0)
    world.run_for(0.1)
    world.set_mode("POSITION")


@pytest.mark.parametrize("begin", [begin_landing, begin_return, begin_mission, begin_sticks])
@pytest.mark.parametrize("home_up_m", [0.0, 4.0])
def test_every_descent_slows_down_at_the_same_height_above_home(begin, home_up_m: float) -> None:  # type: ignore[no-untyped-def]
    world = hover(16.0, MPC_LAND_ALT2=5, MPC_LAND_SPEED=0.7)
    set_home(world, 0.0, up_m=home_up_m)
    begin(world)
    assert slow_from(world) == pytest.approx(4.4 + home_up_m, abs=0.4)


def test_a_landing_beside_a_rally_point_takes_its_ground() -> None:
    world = hover(16.0, MPC_LAND_ALT2=5, MPC_LAND_SPEED=0.7)
    upload(world, MissionType.RALLY, [rally_point((30.0, 0.0), 3.0)])
    go_north(world, 29.0, 15.0)
    world.land()
    assert slow_from(world) == pytest.approx(7.4, abs=0.4)
