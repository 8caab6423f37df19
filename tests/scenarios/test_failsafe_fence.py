"""The geofence as it is flown: every action against every way of moving, with a fence from the ground station."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.core.enums import Mode
from flightstack.plan import MissionType
from gcs_cli.clients.mission_client import Done
from tests.support.failsafe_phases import HEIGHT
from tests.support.fence_breaches import (
    ACCEPTED,
    BRAKING,
    DENIED,
    MOVEMENTS,
    RADIUS,
    SPEED,
    Movement,
    farthest_until,
    fly_goto,
    hovering,
    until_breach,
)
from tests.support.fences import circle
from tests.support.streams import go_to


@pytest.mark.parametrize("movement", MOVEMENTS)
@pytest.mark.parametrize("action", [1, 2, 3, 4, 5])
def test_each_action_of_the_fence_against_each_movement(action: int, movement: Movement) -> None:
    world = hovering(f"GF_ACTION={action}", f"MPC_VEL_MANUAL={SPEED}")
    mode = until_breach(world, movement)
    if action == 1:
        world.until(lambda: world.position[0] > RADIUS + 15.0, 10.0)
        assert world.mode is mode
    elif action == 2:
        far = farthest_until(world, lambda: bool(np.abs(world.velocity).max() < 0.02), 15.0)
        world.run(5.0)
        assert world.mode is Mode.HOLD
        assert max(far, world.position[0]) < RADIUS + BRAKING
        assert world.position[0] > RADIUS
        assert abs(world.altitude - HEIGHT) < 0.3
    elif action == 3:
        far = farthest_until(world, lambda: not world.armed)
        assert far < RADIUS + BRAKING
        assert np.linalg.norm(world.position[:2]) < 0.6
    elif action == 4:
        assert world.mode is Mode.TERMINATION
        far = farthest_until(world, lambda: world.altitude < 0.3, 5.0)
        assert far < RADIUS + 2.0 * SPEED  # it falls for 1.1 s
    else:
        far = farthest_until(world, lambda: not world.armed)
        assert RADIUS < world.position[0] <= far < RADIUS + BRAKING
        assert world.altitude < 0.05
    world.run(0.1)
    assert sum(text.startswith("Geofence breached") for text in world.texts) == 1


def test_a_fast_goto_turns_within_its_braking_distance() -> None:
    world = hovering("GF_ACTION=3", "COM_FAIL_ACT_T=5")
    speed = 12.0
    assert go_to(world, 600.0, 0.0, HEIGHT, speed=speed) == ACCEPTED
    world.until(lambda: world.velocity[0] > speed - 0.2, 30.0)
    limit = float(world.position[0]) + 10.0
    assert isinstance(world.upload([circle((0.0, 0.0), limit)], MissionType.FENCE), Done)
    world.until(lambda: bool(world.stack.parts.failsafes.active), 3.0)
    far = farthest_until(world, lambda: world.velocity[0] < -1.0, 25.0)
    # 48 m with half of MPC_ACC_HOR, and what the jerk limit takes at 12 m/s
    assert far - limit < speed**2 / (2.0 * 0.5 * 3.0) + 0.4 * speed


def test_a_fast_goto_that_looks_ahead_hardly_leaves_the_fence() -> None:
    world = hovering("GF_ACTION=3", "GF_PREDICT=1")
    assert go_to(world, 600.0, 0.0, HEIGHT, speed=12.0) == ACCEPTED
    world.until(lambda: world.position[0] > 40.0, 30.0)
    assert isinstance(world.upload([circle((0.0, 0.0), 120.0)], MissionType.FENCE), Done)
    far = farthest_until(world, lambda: world.velocity[0] < -1.0, 35.0)
    assert 80.0 < far < 150.0


def test_a_goto_through_an_exclusion_area_is_refused_and_one_past_it_is_flown() -> None:
    world = hovering()
    assert isinstance(world.upload([circle((30.0, 0.0), 10.0, inclusion=False)], MissionType.FENCE), Done)
    assert go_to(world, 60.0, 0.0, HEIGHT) == DENIED
    world.run(0.02)
    assert any("the place is beyond an edge of the geofence" in text for text in world.texts), world.texts
    assert go_to(world, 30.0, 20.0, HEIGHT) == ACCEPTED


def test_a_goto_leads_back_from_outside() -> None:
    world = hovering("GF_ACTION=1")
    until_breach(world, fly_goto)
    assert go_to(world, 0.0, 0.0, HEIGHT) == ACCEPTED
    world.until(lambda: world.position[0] < 5.0, 30.0)
