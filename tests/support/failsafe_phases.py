"""Functions that bring a ``World`` into each phase of flight of the failsafe table."""

from __future__ import annotations

import math
from collections.abc import Callable

from flightstack.commander.failsafe import Phase
from flightstack.core.contract import Vector3
from flightstack.core.enums import Mode
from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from tests.support.plan_items import item
from tests.support.streams import sticks
from tests.support.truth import World

QUICK = {
    "MPC_Z_VEL_MAX_UP": 5,
    "MPC_Z_VEL_MAX_DN": 3,
    "MPC_LAND_SPEED": 1.5,
    "MPC_LAND_ALT2": 2,
    "MPC_TKO_SPEED": 3,
    "RTL_RETURN_ALT": 8,
    "RTL_MIN_DIST": 1,
    "COM_FAIL_ACT_T": 0.5,
}
HEIGHT = 6.0


def select_mode(world: World, mode: Mode) -> None:
    """Select a mode; fail if the vehicle does not enter it."""
    world.set_mode(mode)
    assert world.state.mode == mode.name


def _hover(world: World) -> None:
    """Hover at ``HEIGHT``, 8 m north of home."""
    world.upload([item(22, z=HEIGHT), item(16, north=8.0, z=HEIGHT)])
    world.arm()
    world.start_mission()
    world.run_until("mode == 'HOLD'", 30.0)


def setpoint(world: World) -> Callable[[], Message]:
    """Return the constructor of a setpoint at the vehicle's current position."""
    north, east, down = world.state.position_ned_m
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0b110111111000, north, east, down, 0, 0, 0, 0, 0, 0, 0, 0
    )
    return lambda: message


def disarmed(world: World, before: Callable[[], None]) -> None:
    world.run_for(0.1)
    before()


def standing(world: World, before: Callable[[], None]) -> None:
    before()
    world.arm()
    world.run_for(0.1)


def takeoff(world: World, before: Callable[[], None]) -> None:
    world.arm()
    world.takeoff(30.0)
    world.run_until("altitude_m > 1.0", 5.0)
    before()


def mission(world: World, before: Callable[[], None]) -> None:
    world.upload([item(22, z=HEIGHT), item(16, north=200.0, z=HEIGHT)])
    world.arm()
    world.start_mission()
    world.run_until("north_m > 1.0", 20.0)
    before()


def hold(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    world.run_for(0.2)


def goto(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    place = LocalFrame(world.engine.config.home).to_geo(Vector3(200.0, 0.0, -HEIGHT))
    reposition = mavlink.MAV_CMD_DO_REPOSITION
    world.command(reposition, -1, 1, 0, math.nan, *place)
    world.run_for(0.3)
    assert world.state.velocity_ned_m_s.x > 0.1


def manual(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    world.sender.streams["sticks"] = sticks
    world.run_for(0.1)
    before()
    select_mode(world, Mode.POSITION)
    world.run_for(0.3)


def offboard(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    world.sender.streams["setpoint"] = setpoint(world)
    world.run_for(0.1)
    before()
    select_mode(world, Mode.OFFBOARD)
    world.run_for(0.3)


def returning(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    world.rtl()
    world.run_for(0.3)


def landing(world: World, before: Callable[[], None]) -> None:
    _hover(world)
    before()
    world.land()
    world.run_for(0.3)


ENTER: dict[Phase, Callable[[World, Callable[[], None]], None]] = {
    Phase.DISARMED: disarmed,
    Phase.STANDING: standing,
    Phase.TAKEOFF: takeoff,
    Phase.MISSION: mission,
    Phase.HOLD: hold,
    Phase.GOTO: goto,
    Phase.MANUAL: manual,
    Phase.OFFBOARD: offboard,
    Phase.RETURN: returning,
    Phase.LAND: landing,
}
MODE_IN: dict[Phase, Mode] = {
    Phase.TAKEOFF: Mode.TAKEOFF,
    Phase.MISSION: Mode.MISSION,
    Phase.HOLD: Mode.HOLD,
    Phase.GOTO: Mode.HOLD,
    Phase.MANUAL: Mode.POSITION,
    Phase.OFFBOARD: Mode.OFFBOARD,
    Phase.RETURN: Mode.RETURN,
    Phase.LAND: Mode.LAND,
}
