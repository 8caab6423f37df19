"""Faults that trigger failsafes of a ``World`` in flight."""

from __future__ import annotations

import math
from collections.abc import Callable

from flightstack.core.enums import Mode
from flightstack.core.geodesy import LocalFrame
from flightstack.guidance.fence import Fence
from flightstack.mavlink.dialect import mavlink
from tests.support.failsafe_phases import select_mode, setpoint
from tests.support.plan_items import item
from tests.support.streams import sticks
from tests.support.truth import World


def nothing(world: World) -> None:
    """Do nothing."""


def use_companion(world: World) -> None:
    """Send requests and streams from a companion from now on."""
    world.sender = world.add_client("companion", is_companion=True)
    world.sender.streams, world.gcs.streams = world.gcs.streams, {}


def cut_ground_station(world: World) -> None:
    """Cut the ground station's link to the vehicle; a companion sends requests and streams from now on."""
    use_companion(world)
    world.fault("link gcs to_vehicle cut")


def stop_heartbeats(world: World) -> None:
    """Leave 0.5 s of the 5 s for which a ground station may be silent."""
    use_companion(world)
    link = world.link.to_vehicle
    sent = link.sent
    world.run_until(lambda _: link.sent > sent, 2.0)  # a heartbeat, which is all that it sends now
    link.cut()
    world.run_for(4.5)


def stop_stream(name: str) -> Callable[[World], None]:
    return lambda world: world.sender.streams.pop(name) and None


def begin_setpoints(world: World) -> None:
    """Stream setpoints; on the ground also select OFFBOARD, without which their loss has no effect."""
    world.sender.streams["setpoint"] = setpoint(world)
    world.run_for(0.1)
    if world.state.altitude_m < 0.1:
        select_mode(world, Mode.OFFBOARD)


def begin_sticks(world: World) -> None:
    world.sender.streams["sticks"] = sticks
    world.run_for(0.1)
    if world.state.altitude_m < 0.1:
        select_mode(world, Mode.POSITION)


def breach_fence(world: World) -> None:
    """Set a fence that the vehicle is outside of; home is inside, unless the vehicle is at home."""
    north = world.state.north_m - 20.5 if world.state.north_m > 0.9 else -100.0
    far = item(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, north=north, p1=20.0)
    frame = LocalFrame(world.engine.config.home)
    world.engine.stack.area.fence.set_fence(Fence.from_items([far], frame))


def lose_states(world: World) -> None:
    world.engine.loses_states = True
    world.run_for(0.1)


def tip_over(world: World) -> None:
    """Rotate the vehicle instantly by 100° about its roll axis."""
    world.engine.simulator.plant.memory[0]["body"][6:10] = math.cos(0.87), math.sin(0.87), 0.0, 0.0  # type: ignore[attr-defined]
    world.run_for(0.004)


def blow_away(world: World) -> None:
    """Move the vehicle instantly by 30 m to the east."""
    world.engine.simulator.plant.memory[0]["body"][1] += 30.0  # type: ignore[attr-defined]


def set_param(name: str, value: float) -> Callable[[World], None]:
    def begin(world: World) -> None:
        world.param_set(name, value)
        world.run_for(0.2)

    return begin


def jump_gnss(world: World) -> None:
    world.fault("sensor:gnss:bias=30,0,0")
    world.run_for(0.4)


def inject(fault: str) -> Callable[[World], None]:
    def begin(world: World) -> None:
        world.fault(fault)
        world.run_for(0.2)

    return begin
