"""Flights out of a geofence, and the distance that the vehicle reaches."""

from __future__ import annotations

import math
from collections.abc import Callable

from flightstack.core.enums import Mode
from flightstack.plan import MissionType
from gcs_cli.clients.mission_client import Done
from tests.support.failsafe_phases import HEIGHT, QUICK
from tests.support.fences import circle
from tests.support.streams import go_to, local_point, select, sticks
from tests.support.world import World, item

RADIUS = 20.0
SPEED = 4.0
BRAKING = SPEED**2 / (2.0 * 0.5 * 3.0) + 1.5
"""Braking distance at half of MPC_ACC_HOR, and the distance until braking starts [m]."""
ACCEPTED, DENIED = 0, 2


def hovering(*params: str) -> World:
    """Return a world whose vehicle hovers above home."""
    world = World(vehicle="x_quad", params=[*QUICK, *params])
    assert world.arm() == ACCEPTED, world.texts
    assert world.takeoff(HEIGHT) == ACCEPTED
    world.until(lambda: world.mode is Mode.HOLD, 15.0)
    return world


def fly_mission(world: World) -> Mode:
    world.upload([item(22, z=HEIGHT), item(16, north=200.0, z=HEIGHT)])
    assert world.resume_mission() == ACCEPTED
    return Mode.MISSION


def fly_goto(world: World) -> Mode:
    assert go_to(world, 200.0, 0.0, HEIGHT, speed=SPEED) == ACCEPTED
    return Mode.HOLD


def fly_offboard(world: World) -> Mode:
    north = local_point(velocity=(SPEED, 0.0, 0.0))
    world.streams["setpoint"] = lambda: north
    world.run(0.1)
    assert select(world, 6) == ACCEPTED
    return Mode.OFFBOARD


def fly_sticks(world: World) -> Mode:
    world.streams["sticks"] = lambda: sticks(forward=1.0)
    world.run(0.1)
    assert select(world, 3) == ACCEPTED
    return Mode.POSITION


Movement = Callable[[World], Mode]
MOVEMENTS: tuple[Movement, ...] = (fly_mission, fly_goto, fly_offboard, fly_sticks)


def until_breach(world: World, movement: Movement) -> Mode:
    """Fly north out of a fence that is uploaded in flight: setpoints beyond a known fence are refused."""
    mode = movement(world)
    world.until(lambda: world.position[0] > 3.0, 20.0)
    assert isinstance(world.upload([circle((0.0, 0.0), RADIUS)], MissionType.FENCE), Done)
    world.until(lambda: world.position[0] > RADIUS - 1.0, 20.0)
    assert world.mode is mode
    assert world.stack.parts.failsafes.active == ()
    world.until(lambda: world.position[0] > RADIUS + 0.2, 5.0)
    return mode


def farthest_until(world: World, condition: Callable[[], bool], limit_s: float = 60.0) -> float:
    """Run until ``condition`` is true; return the largest distance from home [m]."""
    far = 0.0

    def watch() -> bool:
        nonlocal far
        far = max(far, math.hypot(*world.position[:2]))
        return condition()

    world.until(watch, limit_s)
    return far
