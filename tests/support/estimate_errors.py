"""Errors of the estimate in flight against the truth of the simulator."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, Quaternion
from flightstack.core.geometry import euler_from_quaternion
from flightstack.testing import World


class Errors(NamedTuple):
    """Root mean squares of a flight; positions count from the origin of each."""

    tilt_deg: float
    yaw_deg: float
    velocity_m_s: float
    horizontal_m: float
    vertical_m: float
    landing_m: float
    """Horizontal error of the estimated position after the landing."""


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


class Watch:
    """Records estimate and truth of an armed vehicle in each outer tick; create it before the flight."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._rows: list[tuple[FloatArray, FloatArray]] = []
        world.watch(self._take)

    def _take(self) -> None:
        engine = self._world.engine
        if engine.stack.now.status.armed:
            self._rows.append((engine.stack.now.state.copy(), engine.simulator.frame.state.copy()))

    def errors(self) -> Errors:
        """Return the errors of the flight."""
        estimate, truth = (np.array(column) for column in zip(*self._rows, strict=True))
        angles = _angles_deg(estimate) - _angles_deg(truth)
        angles = (angles + 180.0) % 360.0 - 180.0
        off = estimate - truth
        return Errors(
            _rms(np.linalg.norm(angles[:, :2], axis=1)),
            _rms(angles[:, 2]),
            _rms(np.linalg.norm(off[:, 3:6], axis=1)),
            _rms(np.linalg.norm(off[:, :2], axis=1)),
            _rms(off[:, 2]),
            float(np.linalg.norm(off[-1, :2])),
        )


def _angles_deg(states: FloatArray) -> FloatArray:
    return np.array(
        [
            [math.degrees(angle) for angle in euler_from_quaternion(Quaternion(*state[6:10].tolist()))]
            for state in states
        ]
    )
