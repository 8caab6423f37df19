"""A flight whose loops run on the emulated Cortex-M4F is, bit for bit, the flight of the same C on this machine."""

from __future__ import annotations

import numpy as np

from tests.support.truth import World


def flight(loops: str) -> np.ndarray:
    """Fly in gusts and return the plant's state of every tenth tick, shape (n, 13)."""
    world = World(loops=loops, wind=(4.0, 2.0, 0.0), gust=2.0, drag=True)
    world.upload("hop.plan")
    world.arm()
    world.start_mission()
    states = []
    while world.state.armed:
        states.append(world.engine.simulator.frame.state.copy())
        world.run_for(0.02)
    return np.array(states)


def test_the_flight_is_that_of_the_loops_on_the_host() -> None:
    here, there = flight("c"), flight("emulated")
    assert len(here) > 150
    assert np.array_equal(here, there)
