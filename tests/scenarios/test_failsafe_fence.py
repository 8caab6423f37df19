"""The geofence as it is flown: every action against every way of moving, with a fence from the ground station."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.plan import MissionType
from tests.support.failsafe_phases import HEIGHT
from tests.support.fence_breaches import (
    BRAKING,
    MOVEMENTS,
    RADIUS,
    SPEED,
    Movement,
    farthest_until,
    fly_goto,
    hovering,
    until_breach,
)
from tests.support.plan_items import circle
from tests.support.refusals import refused
from tests.support.streams import go_to


@pytest.mark.parametrize("movement", MOVEMENTS)
@pytest.mark.parametrize("action", [1, 2, 3, 4, 5])
def test_each_action_of_the_fence_against_each_movement(action: int, movement: Movement) -> None:
    world = hovering(GF_ACTION=action, MPC_VEL_MANUAL=SPEED)
    mode = until_breach(world, movement)
    if action == 1:
        world.run_until(lambda s: s.north_m > RADIUS + 15.0, 10.0)
        assert world.state.mode == mode.name
    elif action == 2:
        far = farthest_until(world, lambda state: bool(np.abs(state.velocity_ned_m_s).max() < 0.02), 15.0)
        world.run_for(5.0)
        assert world.state.mode == "HOLD"
        assert max(far, world.state.north_m) < RADIUS + BRAKING
        assert world.state.north_m > RADIUS
        assert abs(world.state.altitude_m - HEIGHT) < 0.3
    elif action == 3:
        far = farthest_until(world, lambda state: not state.armed)
        assert far < RADIUS + BRAKING
        assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.6
    elif action == 4:
        assert world.state.mode == "TERMINATION"
        far = farthest_until(world, lambda state: state.altitude_m < 0.3, 5.0)
        assert far < RADIUS + 2.0 * SPEED  # it falls for 1.1 s
    else:
        far = farthest_until(world, lambda state: not state.armed)
        assert RADIUS < world.state.north_m <= far < RADIUS + BRAKING
        assert world.state.altitude_m < 0.05
    world.run_for(0.1)
    assert sum(text.startswith("Geofence breached") for text in world.texts) == 1


def test_a_fast_goto_turns_within_its_braking_distance() -> None:
    world = hovering(GF_ACTION=3, COM_FAIL_ACT_T=5)
    speed = 12.0
    go_to(world, 600.0, 0.0, HEIGHT, speed=speed)
    world.run_until(lambda s: s.velocity_ned_m_s.x > speed - 0.2, 30.0)
    limit = world.state.north_m + 10.0
    world.upload([circle((0.0, 0.0), limit)], MissionType.FENCE)
    world.run_until(lambda _: bool(world.engine.stack.parts.failsafes.active), 3.0)
    far = farthest_until(world, lambda state: state.velocity_ned_m_s.x < -1.0, 25.0)
    # 48 m with half of MPC_ACC_HOR, and what the jerk limit takes at 12 m/s
    assert far - limit < speed**2 / (2.0 * 0.5 * 3.0) + 0.4 * speed


def test_a_fast_goto_that_looks_ahead_hardly_leaves_the_fence() -> None:
    world = hovering(GF_ACTION=3, GF_PREDICT=1)
    go_to(world, 600.0, 0.0, HEIGHT, speed=12.0)
    world.run_until("north_m > 40.0", 30.0)
    world.upload([circle((0.0, 0.0), 120.0)], MissionType.FENCE)
    far = farthest_until(world, lambda state: state.velocity_ned_m_s.x < -1.0, 35.0)
    assert 80.0 < far < 121.0  # 118.6; 121.3 if the prediction brakes with all of MPC_ACC_HOR


def test_a_goto_through_an_exclusion_area_is_refused_and_one_past_it_is_flown() -> None:
    world = hovering()
    world.upload([circle((30.0, 0.0), 10.0, inclusion=False)], MissionType.FENCE)
    with refused(mavlink.MAV_RESULT_DENIED, "the place is beyond an edge of the geofence"):
        go_to(world, 60.0, 0.0, HEIGHT)
    go_to(world, 30.0, 20.0, HEIGHT)


def test_a_goto_leads_back_from_outside() -> None:
    world = hovering(GF_ACTION=1)
    until_breach(world, fly_goto)
    go_to(world, 0.0, 0.0, HEIGHT)
    world.run_until("north_m < 5.0", 30.0)
