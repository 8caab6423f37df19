"""Commands that start a mission or choose its item: a refused one changes nothing."""

from __future__ import annotations

import math

import pytest

from flightstack.core.enums import Mode
from flightstack.mavlink.dialect import mavlink
from tests.support.world import World, item

ACCEPTED, REJECTED, DENIED = 0, 1, 2
START, SET_CURRENT = mavlink.MAV_CMD_MISSION_START, mavlink.MAV_CMD_DO_SET_MISSION_CURRENT


def current(world: World) -> int:
    return world.stack.now.progress.current


@pytest.mark.parametrize("seq", [99.0, -2.0, 1.5, math.inf])
def test_a_denied_choice_of_an_item_does_not_restart_the_mission(seq: float) -> None:
    world = World()
    world.upload("square.plan")
    world.start_mission()
    world.until(lambda: 1 in world.reached)
    assert current(world) == 2
    assert world.command(SET_CURRENT, seq, 1) == DENIED
    assert current(world) == 2
    world.until_disarmed()
    assert world.reached == [0, 1, 2, 3, 4, 5]


def test_a_restart_and_an_item_act_together() -> None:
    world = World()
    world.upload("square.plan")
    assert world.command(SET_CURRENT, 3, 1) == ACCEPTED
    assert current(world) == 3
    assert world.command(SET_CURRENT, -1, 1) == ACCEPTED
    assert current(world) == 0


def test_a_start_that_may_not_arm_leaves_mode_and_item() -> None:
    world = World(params=["NAV_DLL_ACT=2"])
    world.upload("square.plan")
    world.stack.parts.failsafes.links.gcs_lost = True
    assert world.stack.parts.readiness.arming_refusals()
    assert world.command(START, 2) == REJECTED
    assert world.mode is Mode.HOLD
    assert current(world) == 0
    assert not world.armed


def test_a_start_at_no_item_leaves_mode_and_item() -> None:
    world = World()
    world.upload("square.plan")
    assert world.command(START, 77) == DENIED
    assert world.mode is Mode.HOLD
    assert not world.armed
    assert world.command(START, 1) == ACCEPTED
    assert world.armed
    assert current(world) == 1


def test_a_start_at_an_item_that_stays_on_the_ground_is_refused() -> None:
    world = World()
    world.upload([item(22, z=3.0), item(16, north=5.0, z=3.0), item(21)])
    assert world.command(START, 2) == REJECTED
    assert (world.mode, world.armed, current(world)) == (Mode.HOLD, False, 0)
    world.arm()
    assert world.command(START, 2) == REJECTED
    assert (world.mode, current(world)) == (Mode.HOLD, 0)
    assert world.command(START, 1) == ACCEPTED


def test_a_current_item_that_stays_on_the_ground_keeps_it_from_arming() -> None:
    world = World()
    world.upload([item(22, z=3.0), item(16, north=5.0, z=3.0), item(21)])
    assert world.command(SET_CURRENT, 2) == ACCEPTED
    assert world.resume_mission() == ACCEPTED
    assert world.arm() == REJECTED
    assert world.command(SET_CURRENT, 0) == ACCEPTED
    assert world.arm() == ACCEPTED
    world.until_disarmed()
    assert world.reached == [0, 1, 2]


def test_a_finished_mission_starts_again() -> None:
    world = World()
    world.upload([item(22, z=3.0), item(21)])
    for _ in range(2):
        assert world.command(START) == ACCEPTED
        world.until_disarmed()
    assert world.reached == [0, 1, 0, 1]
