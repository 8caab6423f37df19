"""Flights out of a geofence, and the distance that the vehicle reaches."""

from __future__ import annotations

import math
from collections.abc import Callable

from flightstack.core.enums import Mode
from flightstack.plan import MissionType
from flightstack.testing import State
from tests.support.failsafe_phases import HEIGHT, QUICK
from tests.support.plan_items import circle, item
from tests.support.streams import go_to, local_point, sticks
from tests.support.truth import World

RADIUS = 20.0
SPEED = 4.0
BRAKING = SPEED**2 / (2.0 * 0.5 * 3.0) + 1.5
"""Braking distance at half of MPC_ACC_HOR, and the distance until braking starts [m]."""


def hovering(**params: float) -> World:
    """Return a world whose vehicle hovers above home."""
    world = World(vehicle="x_quad", params={**QUICK, **params})
    world.arm()
    world.takeoff(HEIGHT)
    world.run_until("mode == 'HOLD'", 15.0)
    return world


def fly_mission(world: World) -> Mode:
    world.upload([item(22, z=HEIGHT), item(16, north=200.0, z=HEIGHT)])
    world.set_mode("MISSION")
    return Mode.MISSION


def fly_goto(world: World) -> Mode:
    go_to(world, 200.0, 0.0, HEIGHT, speed=SPEED)
    return Mode.HOLD


def fly_offboard(world: World) -> Mode:
    north = local_point(velocity=(SPEED, 0.0, 0.0))
    world.gcs.streams["setpoint"] = lambda: north
    world.run_for(0.1)
    world.set_mode("OFFBOARD")
    return Mode.OFFBOARD


def fly_sticks(world: World) -> Mode:
    world.gcs.streams["sticks"] = lambda: sticks(forward=1.0)
    world.run_for(0.1)
    world.set_mode("POSITION")
    return Mode.POSITION


Movement = Callable[[World], Mode]
MOVEMENTS: tuple[Movement, ...] = (fly_mission, fly_goto, fly_offboard, fly_sticks)


def until_breach(world: World, movement: Movement) -> Mode:
    """Fly north out of a fence that is uploaded in flight: setpoints beyond a known fence are refused."""
    mode = movement(world)
    world.run_until("north_m > 3.0", 20.0)
    world.upload([circle((0.0, 0.0), RADIUS)], MissionType.FENCE)
    world.run_until(lambda s: s.north_m > RADIUS - 1.0, 20.0)
    assert world.state.mode == mode.name
    assert world.engine.stack.parts.failsafes.active == ()
    world.run_until(lambda s: s.north_m > RADIUS + 0.2, 5.0)
    return mode


def farthest_until(world: World, condition: Callable[[State], bool], limit_s: float = 60.0) -> float:
    """Run until ``condition`` is true; return the largest distance from home [m]."""
    far = 0.0

    def watch(state: State) -> bool:
        nonlocal far
        far = max(far, math.hypot(state.north_m, state.east_m))
        return condition(state)

    world.run_until(watch, limit_s)
    return far
