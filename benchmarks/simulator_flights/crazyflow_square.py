"""Crazyflow (JAX) flies a square in several worlds at once: its first-principles Crazyflie and its controller.

Argument: the number of worlds.
"""

from __future__ import annotations

import sys

import numpy as np
from answering import RATE_HZ, answer, place_m
from crazyflow.control import Control
from crazyflow.sim import Sim

WORLDS = int(sys.argv[1])
_OUTER_HZ = 100
_UPRIGHT = slice(9, 13)
"""Quaternion of the command, scalar last."""
_sim = Sim(n_worlds=WORLDS, control=Control.state, freq=RATE_HZ, state_freq=_OUTER_HZ, attitude_freq=RATE_HZ)


def _fly(seconds: float) -> tuple[float, float]:
    _sim.reset()
    command = np.zeros((WORLDS, 1, 16), dtype=np.float32)
    command[..., _UPRIGHT] = 0.0, 0.0, 0.0, 1.0
    for number in range(round(seconds * _OUTER_HZ)):
        command[..., :3] = place_m(number / _OUTER_HZ)
        _sim.state_control(command)
        _sim.step(RATE_HZ // _OUTER_HZ)
    at_m = np.asarray(_sim.data.states.pos)  # waits for the last step
    return WORLDS * seconds, np.linalg.norm(at_m - command[..., :3], axis=-1).max()


if __name__ == "__main__":
    answer(_fly)
