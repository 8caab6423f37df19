"""INJECT_FAILURE from the ground: who may, what the simulator does, and what the client is told."""

from __future__ import annotations

import math

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.services.commands.system import LONGEST_WAIT_S
from tests.support.refusals import refused
from tests.support.truth import World

REJECTED, DENIED, UNSUPPORTED, FAILED = range(1, 5)
MOTOR, BATTERY, GPS = 101, 100, 4
OK, OFF = 0, 1
ALLOWED = {"SYS_FAILURE_EN": 1}


def fail(world: World, unit: float, failure: float, instance: float = 0) -> None:
    world.command(mavlink.MAV_CMD_INJECT_FAILURE, unit, failure, instance)


def hovering(**params: float) -> World:
    world = World(params={**ALLOWED, **params})
    world.arm()
    world.takeoff(6.0)
    world.run_until("mode == 'HOLD'")
    return world


def said(world: World, text: str) -> bool:
    world.run_for(0.02)
    return any(text in line for line in world.texts)


def test_a_rotor_that_is_told_to_stop_is_noticed_as_a_failure() -> None:
    world = hovering()
    fail(world, MOTOR, OFF, 2)
    world.run_until("mode == 'LAND'", 5.0)  # COM_ACT_FAIL_ACT
    assert (
        world.engine.simulator.frame.rotor_speed_rad_s[1]
        < 0.5 * world.engine.simulator.frame.rotor_speed_rad_s[0]
    )
    assert said(world, "A rotor does not follow its command"), world.texts


def test_a_failure_that_is_taken_back_leaves_a_vehicle_that_flies() -> None:
    world = World(params=ALLOWED)
    fail(world, MOTOR, OFF, 2)
    fail(world, MOTOR, OK, 2)
    world.arm()
    world.takeoff(3.0)
    world.run_until("mode == 'HOLD'", 10.0)


def test_nothing_fails_unless_it_is_allowed() -> None:
    world = World()
    with refused(DENIED, "SYS_FAILURE_EN is 0"):
        fail(world, MOTOR, OFF, 1)
    assert world.engine.stack.simulator.take_requests() == b""


@pytest.mark.parametrize(
    ("numbers", "result", "reason"),
    [
        ((MOTOR, OFF, 9), DENIED, "no such motor"),
        ((BATTERY, OFF, 3), DENIED, "no such motor, battery or sensor"),
        ((math.nan, OFF, 0), DENIED, "whole numbers"),
        ((MOTOR, math.inf, 0), DENIED, "whole numbers"),
        ((MOTOR, OFF, 1.5), DENIED, "whole numbers"),
        ((MOTOR, OFF, -1), DENIED, "whole numbers"),
    ],
)
def test_what_the_simulator_cannot_do_is_refused(
    numbers: tuple[float, ...], result: int, reason: str
) -> None:
    world = World(params=ALLOWED)
    with refused(result, reason):
        fail(world, *numbers)


def test_a_failure_of_what_the_simulator_has_not_is_unsupported() -> None:
    with refused(UNSUPPORTED, "sends no such sensor"):
        fail(World(params=ALLOWED), GPS, OFF)


def test_without_a_simulator_there_is_nothing_to_fail() -> None:
    world = World(params=ALLOWED)
    world.engine.stack.simulator.has_state = False
    with refused(REJECTED, "no simulator is connected"):
        fail(world, MOTOR, OFF, 1)


def test_a_simulator_that_does_not_answer_makes_the_command_fail() -> None:
    world = World(params=ALLOWED)
    world.engine.stack.simulator.take_requests = bytes  # type: ignore[method-assign]  # they get lost on the way
    began_s = world.time_s
    with refused(FAILED, "the simulator does not answer"):
        fail(world, MOTOR, OFF, 1)
    assert world.time_s - began_s == pytest.approx(LONGEST_WAIT_S, abs=0.05)
