"""Print the kernels that flights compile, or load from the cache, after the vehicle was built: that of streams only."""

from __future__ import annotations

import gc

from numba.core.dispatcher import Dispatcher

from tests.support.streams import attitude, hover_thrust, level, local_point, sticks, stream
from tests.support.truth import World


def kernels() -> set[tuple[str, int]]:
    """Return name and number of compiled signatures of each kernel in use."""
    found = (kernel for kernel in gc.get_objects() if isinstance(kernel, Dispatcher))
    return {
        (f"{kernel.py_func.__module__}.{kernel.py_func.__name__}", len(kernel.overloads)) for kernel in found
    }


def fly_streams(world: World) -> None:
    """Fly in OFFBOARD and POSITION mode, and land."""
    world.arm()
    world.takeoff(3.0)
    world.run_until("mode == 'HOLD'", 30.0)
    point = local_point(position=(1.0, 0.0, -3.0))
    turned = attitude(level(0.3), hover_thrust(world))
    for message in (point, turned):
        stream(world, message, 0.5)
        world.set_mode("OFFBOARD")
        stream(world, message, 1.0)
    stream(world, sticks(forward=0.5), 0.5)
    world.set_mode("POSITION")
    stream(world, sticks(forward=0.5, yaw=0.5), 1.0)
    world.land()
    world.run_until("not armed")


def fly_mission(world: World) -> None:
    """Fly half of a mission and return."""
    world.upload("square.plan")
    world.arm()
    world.arm()
    world.start_mission()
    world.run_until(lambda _: world.reached == [0, 1], 30.0)
    world.rtl()
    world.run_until("not armed")


def main() -> None:
    """Fly in wind, so that the vehicle is tilted at touchdown."""
    world = World(vehicle="x_quad", wind=(5.0, 0.0, 0.0), gust=1.0)
    world.run_until("not armed")  # loads the kernel of ``State``
    before = kernels()
    fly_streams(world)
    fly_mission(world)
    print(*sorted(name for name, _ in kernels() - before))


if __name__ == "__main__":
    main()
