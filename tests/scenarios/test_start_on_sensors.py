"""Starts of a vehicle on its sensors: on a slope, on a boat, and at any place on Earth."""

from __future__ import annotations

import pytest

from flightstack.core.geodesy import GeoPoint
from flightstack.params.config import DEFAULT_HOME
from flightstack.testing import World
from tests.support.estimate_errors import Errors, Watch

PLACES = {
    "arctic": GeoPoint(89.5, 20.0, 0.0),
    "antarctic": GeoPoint(-89.0, -120.0, 2800.0),
    "date line": GeoPoint(-17.0, 179.99999, 10.0),
    "equator": GeoPoint(0.0, 0.0, 0.0),
    "high plateau": GeoPoint(-16.5, -68.15, 4000.0),
}


LIMITS = Errors(tilt_deg=0.5, yaw_deg=2.5, velocity_m_s=0.1, horizontal_m=0.4, vertical_m=0.4, landing_m=0.6)
"""Measured: 0.35°, 1.81°, 0.05 m/s, 0.13 m, 0.20 m, 0.24 m."""


def hop(**conditions: object) -> Errors:
    """Take off, hold for 5 s and land; return the errors of the estimate."""
    with World(vehicle="x_quad", state="estimated", **conditions) as world:
        watch = Watch(world)
        world.wait_until_ready()
        world.takeoff(4.0)
        world.run_for(5.0)
        world.land()
        world.run_until("not armed")
        return watch.errors()


def assert_within(limits: Errors, errors: Errors) -> None:
    for name, limit, error in zip(Errors._fields, limits, errors, strict=True):
        assert error < limit, name


@pytest.mark.parametrize("name", PLACES)
def test_vehicle_starts_and_lands_at_any_place(name: str) -> None:
    """Near the magnetic pole the level field is 0.02 gauss, and iron of 0.006 gauss turns the heading: 13.7°.

    In the Antarctic it is 0.17 gauss: 0.3° to 3.7° in eight flights.
    """
    yaw_deg = {"arctic": 20.0, "antarctic": 4.0}.get(name, LIMITS.yaw_deg)
    assert_within(LIMITS._replace(yaw_deg=yaw_deg), hop(home=PLACES[name]))


@pytest.mark.parametrize("slope_deg", [10.0, -10.0])
def test_vehicle_starts_from_a_slope(slope_deg: float) -> None:
    assert_within(LIMITS, hop(slope_deg=slope_deg))


def test_vehicle_starts_from_a_boat_that_moves_slowly() -> None:
    """The filter takes a landed vehicle for still until the first fix: 0.5 m/s are off then."""
    slow = Errors(1.0, 2.0, 0.15, 1.0, 0.4, 1.3)  # measured: 0.47°, 0.64°, 0.07 m/s, 0.55 m, 0.01 m, 0.70 m
    assert_within(slow, hop(boat=(0.4, -0.3)))


def test_home_far_from_the_default_origin_is_kept_if_the_first_fix_is_near() -> None:
    """The vehicle assumes that it is in Zürich until then, and stands on the equator."""
    there = PLACES["equator"]
    with World(vehicle="x_quad", home=there) as world:
        area, places = world.engine.stack.area, world.engine.stack.places
        places.frame.move_to(DEFAULT_HOME)
        assert area.set_home(there._replace(latitude_deg=0.001)) is None
        world.wait_until_ready()
        assert places.home_point.latitude_deg == 0.001
        assert "km from where the vehicle started" in str(area.set_home(DEFAULT_HOME))


def test_home_far_from_the_first_fix_moves_there() -> None:
    with World(vehicle="x_quad") as world:
        area, places = world.engine.stack.area, world.engine.stack.places
        assert area.set_home(PLACES["equator"]) is None
        world.wait_until_ready()
        assert places.home_point.latitude_deg == pytest.approx(DEFAULT_HOME.latitude_deg, abs=1e-3)
        assert any("Home moved to the origin: home is more than 100 km" in text for text in world.texts)


def test_mission_starts_on_the_first_estimate() -> None:
    with World(vehicle="x_quad") as world:
        world.upload("hop")
        world.start_mission()
        assert world.state.armed


@pytest.mark.parametrize("seed", [6, 29, 45, 51])
def test_vehicle_that_is_ready_stays_ready(seed: int) -> None:
    """Seeds 29 and 51 had an axis of the compass refused for good; the ratios of any seed crossed their limit.

    Measured in 60 starts of 30 s: ratios of at most 0.37, with a limit of 0.5.
    """
    with World(state="estimated", seed=seed) as world:
        world.wait_until_ready()
        for _ in range(200):
            world.run_for(0.1)
            assert world.engine.stack.is_ready, world.time_s


@pytest.mark.parametrize("fault", ["sensor:mag:noise=0.3", "sensor:baro:noise=8"])
def test_errors_that_alternate_prevent_arming(fault: str) -> None:
    with World(state="estimated", seed=3) as world:
        world.wait_until_ready()
        world.fault(fault)
        world.run_for(2.0)
        for _ in range(150):
            world.run_for(0.1)
            assert not world.engine.stack.is_ready, world.time_s
