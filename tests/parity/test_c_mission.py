"""Whole missions: the core in C makes of each tick's inputs what Python's loops made of them in flight.

Both keep their own memories from takeoff to landing; only the inputs are shared. With double every number has the
same bits. With float the largest difference is bounded in float32's units of the last place of the largest value of
its quantity in the flight. An angle has 1e-7 rad of rounding there; the reference filter (60 rad/s) and the stiffness
of the law turn that into acceleration, and the yaw of a rotor's small drag into speed.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from tests.firmware.core_support import PARTS, Core, Loops, same_bits, ulps
from tests.parity.recorded_loops import OUTER_DUE, RESET, SET_TARGET, Recording, record

FLIGHTS: dict[str, dict[str, Any]] = {
    "paper_quad by PID": {"vehicle": "paper_quad", "controller": "pid"},
    "x_quad by backstepping in gusts": {
        **{"vehicle": "x_quad", "controller": "backstepping", "wind": (4.0, 1.0, 0.0), "gust": 1.0},
    },
    "x_quad by PID in gusts": {
        "vehicle": "x_quad",
        "controller": "pid",
        "wind": (4.0, 1.0, 0.0),
        "gust": 1.0,
    },
    "the paper's gains and ideal rotors": {
        **{"vehicle": "paper_quad", "controller": "backstepping", "gains": "paper", "ideal_rotors": True},
    },
    "the paper's gains by PID in gusts": {
        **{
            "vehicle": "paper_quad",
            "controller": "pid",
            "gains": "paper",
            "wind": (2.0, 0.0, 0.0),
            "gust": 0.5,
            "drag": True,
        },
    },
}
NEAR_IN_FLOAT = [name for name in FLIGHTS if name != "the paper's gains by PID in gusts"]
"""In that one yaw is at its limit most of the time, and one tick in 70 is by rounding on another side of it."""
FLOAT_ULPS = {
    "attitude target": 16,  # measured 5.2
    "target thrust": 32,  # 9.3
    "reference attitude": 16,  # 4.9
    "reference rates": 512,  # 162
    "reference acceleration": 4096,  # 991: 0.004 rad/s²
    "thrust": 32,  # 9.3
    "torque": 8192,  # 2029: 6e-5 N m
    "achieved thrust": 320,  # 161
    "achieved torque": 8192,  # 2029
    "rotor command": 16384,  # 4627: 0.28 rad/s
}
"""Bounds, the largest difference of the four flights beside each."""


@functools.cache
def flight(name: str) -> Recording:
    return record("square.plan", **FLIGHTS[name])


def differences(made: np.ndarray, recording: Recording) -> dict[str, tuple[float, float]]:
    """Largest difference of each quantity, and its largest value."""
    return {
        name: (
            float(np.abs(made[:, part] - recording.outputs[:, part]).max()),
            float(np.abs(recording.outputs[:, part]).max()),
        )
        for name, part in PARTS.items()
    }


@pytest.mark.parametrize("name", FLIGHTS)
def test_mission_in_double_has_pythons_bits(name: str) -> None:
    r = flight(name)
    made, status = Loops(Core("double"), r.numbers).run(r.states, r.setpoints, r.targets, r.flags)
    assert np.array_equal(status, r.status)
    for quantity, part in PARTS.items():
        assert same_bits(made[:, part], r.outputs[:, part]), quantity


@pytest.mark.parametrize("name", NEAR_IN_FLOAT)
def test_a_mission_in_float_stays_near_python(name: str) -> None:
    r = flight(name)
    made, status = Loops(Core("float"), r.numbers).run(r.states, r.setpoints, r.targets, r.flags)
    assert np.count_nonzero(status != r.status) <= 1e-3 * status.size  # measured none
    for quantity, (difference, largest) in differences(made, r).items():
        assert ulps(np.array(difference), largest, np.dtype(np.float32)) < FLOAT_ULPS[quantity], quantity


def test_the_missions_use_every_way_into_the_loops() -> None:
    r = flight("x_quad by backstepping in gusts")
    assert {0, OUTER_DUE, SET_TARGET, RESET | OUTER_DUE} <= set(r.flags.tolist())
    assert {0, 8, 16} <= set(r.status.tolist())  # yaw and thrust at their limits
