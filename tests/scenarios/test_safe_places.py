"""Geofence and rally points, from upload to flight."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.core.enums import Mode
from flightstack.plan import MissionType
from gcs_cli.clients.mission_client import Done, Failed
from tests.support.fences import circle, polygon, rally_point, square
from tests.support.world import World


def test_a_mission_that_leaves_the_fence_is_refused_with_its_item_and_a_lesser_one_is_flown() -> None:
    world = World()
    assert isinstance(world.upload(polygon(square(8.0)), MissionType.FENCE), Done)
    assert isinstance(world.upload("square.plan"), Failed)
    reason = "Mission refused: item 1 (NAV_WAYPOINT): is outside the geofence"
    assert reason in world.texts
    assert isinstance(world.upload(polygon(square(12.0)), MissionType.FENCE), Done)
    assert isinstance(world.upload("square.plan"), Done)
    world.start_mission()
    world.until_disarmed()
    assert world.reached == [0, 1, 2, 3, 4, 5]


def test_a_mission_is_not_started_across_a_fence_that_came_after_it() -> None:
    world = World()
    world.upload("square.plan")
    pillar = circle((10.0, 5.0), 2.0, inclusion=False)  # between two waypoints
    assert isinstance(world.upload([pillar], MissionType.FENCE), Done)
    world.start_mission()
    assert world.mode is not Mode.MISSION
    reason = "item 2 (NAV_WAYPOINT): the way from item 1 to it leaves the geofence, 10 m north and 5 m east of home"
    assert any(text.endswith(reason) for text in world.texts)


@pytest.mark.parametrize(
    ("return_type", "rally", "goal"),
    [(0, (12.0, 0.0), (12.0, 0.0)), (0, (40.0, 0.0), (0.0, 0.0)), (1, (40.0, 0.0), (40.0, 0.0))],
)
def test_a_return_goes_to_the_nearest_place(return_type: int, rally: tuple[float, float], goal) -> None:
    world = World(params=(f"RTL_TYPE={return_type}", "RTL_RETURN_ALT=4"))
    assert isinstance(world.upload([rally_point(rally)], MissionType.RALLY), Done)
    world.upload("square.plan")
    world.start_mission()
    world.until(lambda: 1 in world.reached)  # 10 m north of home
    world.return_home()
    assert world.mode is Mode.RETURN
    world.until_disarmed()
    # Measured: within 0.02 m.
    assert np.hypot(*(world.position[:2] - np.array(goal))) < 0.15
