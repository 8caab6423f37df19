"""Geofence and rally points, from upload to flight."""

from __future__ import annotations

import math

import pytest

from flightstack.plan import MissionType
from tests.support.plan_items import circle, polygon, rally_point, square
from tests.support.refusals import refused
from tests.support.truth import World


def test_a_mission_that_leaves_the_fence_is_refused_with_its_item_and_a_lesser_one_is_flown() -> None:
    world = World()
    world.upload(polygon(square(8.0)), MissionType.FENCE)
    with refused(reason="item 1 (NAV_WAYPOINT): is outside the geofence"):
        world.upload("square.plan")
    world.upload(polygon(square(12.0)), MissionType.FENCE)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed")
    assert world.reached == [0, 1, 2, 3, 4, 5]


def test_a_mission_is_not_started_across_a_fence_that_came_after_it() -> None:
    world = World()
    world.upload("square.plan")
    pillar = circle((10.0, 5.0), 2.0, inclusion=False)  # between two waypoints
    world.upload([pillar], MissionType.FENCE)
    world.arm()
    reason = "item 2 (NAV_WAYPOINT): the way from item 1 to it leaves the geofence, 10 m north and 5 m east of home"
    with refused(reason=reason):
        world.start_mission()
    assert world.state.mode != "MISSION"


@pytest.mark.parametrize(
    ("return_type", "rally", "goal"),
    [(0, (12.0, 0.0), (12.0, 0.0)), (0, (40.0, 0.0), (0.0, 0.0)), (1, (40.0, 0.0), (40.0, 0.0))],
)
def test_a_return_goes_to_the_nearest_place(return_type: int, rally: tuple[float, float], goal) -> None:
    world = World(params={"RTL_TYPE": return_type, "RTL_RETURN_ALT": 4})
    world.upload([rally_point(rally)], MissionType.RALLY)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until(lambda _: 1 in world.reached)  # 10 m north of home
    world.rtl()
    assert world.state.mode == "RETURN"
    world.run_until("not armed")
    # Measured: within 0.02 m.
    assert math.dist(world.state.position_ned_m[:2], goal) < 0.15
