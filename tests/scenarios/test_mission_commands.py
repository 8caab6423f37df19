"""Commands that start a mission or choose its item: a refused one changes nothing."""

from __future__ import annotations

import math

import pytest

from flightstack.mavlink.dialect import mavlink
from tests.support.plan_items import item
from tests.support.refusals import refused
from tests.support.truth import World

REJECTED, DENIED = 1, 2
START, SET_CURRENT = mavlink.MAV_CMD_MISSION_START, mavlink.MAV_CMD_DO_SET_MISSION_CURRENT


def current(world: World) -> int:
    return world.engine.stack.now.progress.current


@pytest.mark.parametrize("seq", [99.0, -2.0, 1.5, math.inf])
def test_a_denied_choice_of_an_item_does_not_restart_the_mission(seq: float) -> None:
    world = World()
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until(lambda _: 1 in world.reached)
    assert current(world) == 2
    with refused(DENIED):
        world.command(SET_CURRENT, seq, 1)
    assert current(world) == 2
    world.run_until("not armed")
    assert world.reached == [0, 1, 2, 3, 4, 5]


def test_a_restart_and_an_item_act_together() -> None:
    world = World()
    world.upload("square.plan")
    world.command(SET_CURRENT, 3, 1)
    assert current(world) == 3
    world.command(SET_CURRENT, -1, 1)
    assert current(world) == 0


def test_a_start_that_may_not_arm_leaves_mode_and_item() -> None:
    world = World(params={"NAV_DLL_ACT": 2})
    world.upload("square.plan")
    world.engine.stack.parts.failsafes.links.gcs_lost = True
    assert world.engine.stack.parts.readiness.arming_refusals()
    with refused(REJECTED, "the ground station is lost"):
        world.command(START, 2)
    assert world.state.mode == "HOLD"
    assert current(world) == 0
    assert not world.state.armed


def test_a_start_at_no_item_leaves_mode_and_item() -> None:
    world = World()
    world.upload("square.plan")
    with refused(DENIED, "there is no mission item 77"):
        world.command(START, 77)
    assert world.state.mode == "HOLD"
    assert not world.state.armed
    world.command(START, 1)
    assert world.state.armed
    assert current(world) == 1


def test_a_start_at_an_item_that_stays_on_the_ground_is_refused() -> None:
    world = World()
    world.upload([item(22, z=3.0), item(16, north=5.0, z=3.0), item(21)])
    with refused(REJECTED, "the mission continues with a landing or a return"):
        world.command(START, 2)
    assert (world.state.mode, world.state.armed, current(world)) == ("HOLD", False, 0)
    world.arm()
    with refused(REJECTED, "the mission continues with a landing or a return"):
        world.command(START, 2)
    assert (world.state.mode, current(world)) == ("HOLD", 0)
    world.command(START, 1)


def test_a_current_item_that_stays_on_the_ground_keeps_it_from_arming() -> None:
    world = World()
    world.upload([item(22, z=3.0), item(16, north=5.0, z=3.0), item(21)])
    world.command(SET_CURRENT, 2)
    world.set_mode("MISSION")
    with refused(REJECTED, "the mission continues with a landing or a return"):
        world.arm()
    world.command(SET_CURRENT, 0)
    world.arm()
    world.run_until("not armed")
    assert world.reached == [0, 1, 2]


def test_a_finished_mission_starts_again() -> None:
    world = World()
    world.upload([item(22, z=3.0), item(21)])
    for _ in range(2):
        world.command(START)
        world.run_until("not armed")
    assert world.reached == [0, 1, 0, 1]
