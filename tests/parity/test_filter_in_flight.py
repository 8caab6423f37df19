"""A flight on sensors is the same, bit for bit, wherever filter and loops run."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from flightstack.firmware.pil.target_filter import HostFilter
from flightstack.process import assembly
from flightstack.testing import World


def flight(**options: Any) -> np.ndarray:
    """Take off and move sideways; return true state and estimate of every tenth tick, shape (n, 26)."""
    states = []
    with World(vehicle="x_quad", state="estimated", wind=(4.0, 2.0, 0.0), **options) as world:
        world.wait_until_ready()
        world.arm()
        world.takeoff(2.0)
        for tick in range(300):
            if tick == 150:
                world.goto(3.0, 2.0)
            world.run_for(0.02)
            states.append(np.concatenate([world.engine.simulator.frame.state, world.engine.stack.now.state]))
    return np.array(states)


@functools.cache
def flight_in_c() -> np.ndarray:
    """Fly with filter and loops in C in this process."""
    return flight(loops="c")


def test_flight_on_the_filter_in_c_in_double_has_the_bits_of_python(monkeypatch: pytest.MonkeyPatch) -> None:
    here = flight()
    monkeypatch.setattr(assembly, "make_filter", lambda loops: HostFilter("double"))
    assert np.array_equal(here, flight())
    assert here[-1, 2] < -1.5


@pytest.mark.parametrize("loops", ["host", "emulated"])
def test_flight_on_a_target_has_the_bits_of_c_in_this_process(loops: str) -> None:
    here, there = flight_in_c(), flight(loops=loops)
    assert np.array_equal(here, there)
    assert here[-1, 2] < -1.5
