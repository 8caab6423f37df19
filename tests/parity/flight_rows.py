"""Fly for a moment and write every number of the loops: run as a process to compare two ways of running them.

``python -m tests.parity.flight_rows VEHICLE CONTROLLER TICKS`` writes rows of float64 to its output.
"""

from __future__ import annotations

import sys

import numpy as np

from tests.support.plan_items import item
from tests.support.truth import World


def flight_rows(vehicle: str, controller: str, ticks: int) -> np.ndarray:
    """Row of the inner loop, setpoint, attitude target and state after each tick, shape (ticks, 77)."""
    drag = vehicle == "paper_quad"
    world = World(vehicle=vehicle, controller=controller, wind=(1.0, -2.0, 0.0), gust=0.5, drag=drag)
    world.upload([item(115, p1=30.0), item(22, z=1.0), item(16, north=3.0, east=-2.0, z=1.5), item(20)])
    world.arm()
    world.start_mission()
    now = world.engine.stack.now
    rows = []
    for _ in range(ticks):
        world.tick()
        rows.append(
            np.concatenate([now.row, now.setpoint, now.attitude_target, world.engine.simulator.frame.state])
        )
    return np.array(rows)


if __name__ == "__main__":
    name, law, count = sys.argv[1:]
    sys.stdout.buffer.write(flight_rows(name, law, int(count)).tobytes())
