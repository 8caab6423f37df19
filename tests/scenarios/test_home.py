"""Home: where it is when the vehicle arms, who may move it, who is told, and what is measured from it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.params.config import DEFAULT_HOME
from flightstack.plan import MissionItem
from flightstack.process.assembly import transfer_state
from flightstack.testing import RefusedError
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.summary import item_ned_m
from tests.support.plan_items import item, polygon
from tests.support.truth import World

FRAME = LocalFrame(DEFAULT_HOME)


def square(half_m: float) -> list[MissionItem]:
    """A geofence around the place where the simulator starts."""
    return polygon([(half_m, half_m), (half_m, -half_m), (-half_m, -half_m), (-half_m, half_m)])


def landed_away(**params: float) -> World:
    """A vehicle that flew 20 m north, landed there and disarmed itself."""
    world = World(params=params)
    world.upload([item(22, z=3.0), item(16, north=20.0, z=3.0), item(21, north=20.0)])
    world.arm()
    world.start_mission()
    world.run_until("not armed")
    assert abs(world.state.north_m - 20.0) < 0.1
    return world


def fly_and_return(world: World) -> None:
    """Arm where it stands, go 15 m east and return."""
    world.arm()
    world.takeoff(3.0)
    world.run_until("mode == 'HOLD'")
    north_m, east_m = world.state.position_ned_m[:2]
    world.engine.stack.parts.requests.go_to(north_m, east_m + 15.0, math.nan, math.nan, math.nan)
    world.run_for(10.0)
    world.rtl()
    world.run_until("not armed")


def told_home(world: World) -> Vector3:
    """Where the vehicle last said that home is."""
    said = world.gcs.received["HOME_POSITION"]
    return FRAME.to_ned(GeoPoint(said.latitude / 1e7, said.longitude / 1e7, said.altitude / 1e3))


def test_home_moves_to_where_the_vehicle_arms_and_a_return_ends_there() -> None:
    world = landed_away()
    assert world.engine.stack.area.home == DEFAULT_HOME  # not by landing: by arming
    north_m = world.state.north_m
    fly_and_return(world)
    assert abs(world.state.north_m - north_m) < 0.1
    assert abs(world.state.east_m) < 0.1
    assert told_home(world).x == pytest.approx(north_m, abs=0.02)


def test_everybody_is_told_at_once() -> None:
    world = landed_away()
    world.run_for(0.02)
    before = world.gcs.counts["HOME_POSITION"]
    world.arm()
    assert world.gcs.counts["HOME_POSITION"] == before + 1  # the stream sends one every two seconds
    assert told_home(world).x == pytest.approx(world.state.north_m, abs=0.02)


def test_the_first_flight_leaves_home_exactly_where_it_was_configured() -> None:
    world = World()
    world.arm()
    assert world.engine.stack.area.home == DEFAULT_HOME


def test_com_home_en_off_keeps_home() -> None:
    world = landed_away(COM_HOME_EN=0)
    fly_and_return(world)
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.1


def test_a_home_that_was_chosen_stays_and_the_present_place_does_not() -> None:
    world = landed_away()
    here = FRAME.to_geo(Vector3(5.0, 0.0, 0.0))
    numbers = (0, 0, 0, math.nan, here.latitude_deg, here.longitude_deg, here.altitude_m)
    world.command(mavlink.MAV_CMD_DO_SET_HOME, *numbers)
    fly_and_return(world)
    home = world.engine.stack.places.home
    assert (home.north_m, home.east_m) == pytest.approx((5.0, 0.0), abs=0.5)  # degrees in a float32
    assert world.state.position_ned_m[:2] == pytest.approx([home.north_m, home.east_m], abs=0.1)
    world.command(mavlink.MAV_CMD_DO_SET_HOME, 1)
    assert not world.engine.stack.places.home_is_chosen


def test_a_takeoff_selected_before_home_rose_ends_above_the_new_one() -> None:
    assert altitude_of_takeoff(math.nan) == pytest.approx(2.5, abs=0.02)


def test_a_takeoff_to_an_altitude_above_the_sea_ends_there_though_home_rose() -> None:
    assert altitude_of_takeoff(5.0) == pytest.approx(5.0, abs=0.02)


def altitude_of_takeoff(altitude_m: float) -> float:
    """Select a takeoff while home is a metre below the vehicle, arm, and return where it ends."""
    world = World()
    world.engine.stack.area.set_home(FRAME.to_geo(Vector3(0.0, 0.0, 1.0)), chosen=False)
    world.command(mavlink.MAV_CMD_NAV_TAKEOFF, *[math.nan] * 6, DEFAULT_HOME.altitude_m + altitude_m)
    world.arm()
    world.run_until("mode == 'HOLD'")
    world.run_for(3.0)
    return world.state.altitude_m


def test_a_geofence_is_judged_where_it_lies_after_home_has_moved() -> None:
    world = landed_away()
    world.arm()
    world.disarm()
    assert world.engine.stack.places.home.north_m == pytest.approx(20.0, abs=0.1)
    area = world.engine.stack.area
    around_old_home = square(10.0)
    rejection = area.check_fence(around_old_home)
    assert rejection is not None
    assert "leaves out the home position" in rejection.reason
    area.set_fence(polygon([(5, 9), (5, -9), (15, -9), (15, 9)], inclusion=False))
    with pytest.raises(RefusedError, match="the way from home to it leaves the geofence"):
        world.upload([item(16, north=-5.0, z=3.0)])  # from here, not from where home was
    world.upload([item(16, north=25.0, z=3.0)])


def test_the_log_knows_home_and_origin(tmp_path) -> None:  # type: ignore[no-untyped-def]
    world = landed_away()
    north_m = float(world.state.north_m)
    fly_and_return(world)
    path = tmp_path / "flight.ulg"
    path.write_bytes(world.flight().log.content)
    flight = read_flight(path)
    assert flight.origin == DEFAULT_HOME
    assert flight.home_ne_m() == pytest.approx((north_m, 0.0), abs=0.01)
    place = item_ned_m(item(16, north=30.0, z=3.0), flight)
    assert place == pytest.approx([30.0, 0.0, -3.0], abs=0.02)


def test_moved_origin_leaves_places_where_they_are() -> None:
    """A vehicle on sensors knows its origin with the first fix, perhaps after the upload of its plans."""
    with World() as world:
        world.upload("square")
        area, places = world.engine.stack.area, world.engine.stack.places
        area.set_fence(square(10.0))
        corner, home = FRAME.to_geo(Vector3(9.0, 9.0, -2.0)), FRAME.to_geo(Vector3(3.0, 4.0, -4.0))
        outside = FRAME.to_geo(Vector3(11.0, 0.0, 0.0))
        area.move_origin(home)
        assert (places.frame.origin, area.home) == (home, home)
        allows = places.fence.shape.allows
        assert allows(*places.frame.to_ned(corner)[:2])
        assert not allows(*places.frame.to_ned(outside)[:2])
        area.set_home(corner)
        area.move_origin(FRAME.to_geo(Vector3(-2.0, 5.0, 8.0)))
        assert area.home == corner  # set by a user
        assert places.home.altitude_m == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("north_m", "down_m", "reason"),
    [
        (150_000.0, 0.0, "home is more than 100 km from where the vehicle started"),
        (0.0, -1500.0, "home is more than 1000 m above or below where the vehicle started"),
    ],
)
def test_home_that_the_first_fix_refuses_is_announced(north_m: float, down_m: float, reason: str) -> None:
    with World() as world:
        stack = world.engine.stack
        home = GeoPoint(DEFAULT_HOME.latitude_deg + 0.01, DEFAULT_HOME.longitude_deg, DEFAULT_HOME.altitude_m)
        origin = FRAME.to_geo(Vector3(north_m, 0.0, down_m))
        assert stack.area.set_home(home) is None
        stack.area.move_origin(origin)
        assert stack.area.home == origin
        assert stack.journal.texts[-1].severity == mavlink.MAV_SEVERITY_WARNING
        assert stack.journal.texts[-1].text == f"Home moved to the origin: {reason}"


def test_origin_without_a_chosen_home_moves_home_silently() -> None:
    with World() as world:
        stack = world.engine.stack
        count = len(stack.journal.texts)
        stack.area.move_origin(FRAME.to_geo(Vector3(150_000.0, 0.0, 0.0)))
        assert len(stack.journal.texts) == count


def test_reboot_on_sensors_keeps_a_home_near_the_first_fix() -> None:
    """The first fix may be far from the default origin, which a rebooted stack has at first."""
    with World(state="estimated") as old, World(state="estimated") as new:
        place = FRAME.to_geo(Vector3(150_000.0, 0.0, 0.0))
        old.engine.stack.area.move_origin(place)
        assert old.engine.stack.area.set_home(place) is None
        transfer_state(old.engine.stack, new.engine.stack)
        assert new.engine.stack.area.home == place
        assert new.engine.stack.places.home_is_chosen
