"""A vehicle that follows the setpoint of guidance exactly, without control loops and plant."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from flightstack.core.enums import Mode
from flightstack.guidance.land_detector import LandMemory
from flightstack.guidance.mission import PLAN_ITEM
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.params import guidance_params
from flightstack.params.behaviour import Behaviour

WEIGHT_N = 10.0
NAN = math.nan


class PerfectVehicle:
    """Follows the setpoint exactly. The ground is at z = 0."""

    def __init__(self, outer_hz: float = 50.0, **params: float) -> None:
        behaviour = Behaviour()
        for name, value in params.items():
            behaviour = behaviour.updated(name, value)
        self.navigator = Navigator(guidance_params(behaviour, WEIGHT_N), outer_hz)
        self.dt_s = 1.0 / outer_hz
        self.time_s = 0.0
        self.state = np.zeros(13)
        self.state[6] = 1.0
        self.reached: list[int] = []
        self.path: list[np.ndarray] = []
        self.yaws: list[float] = []
        self._turned_rad = 0.0
        self.navigator.reset_on_ground(self.state)

    @property
    def position(self) -> np.ndarray:
        return self.state[:3].copy()

    @property
    def yaw(self) -> float:
        return 2.0 * math.atan2(self.state[9], self.state[6])

    @property
    def turned(self) -> float:
        """Heading counted since the start, without wrapping."""
        return self._turned_rad

    def plan(self, *rows: tuple[float, ...], jumps: dict[int, float] | None = None) -> None:
        """Load items: command, parameters 1 to 4, north, east, down. Omitted values are NaN."""
        table = np.full((len(rows), 8), NAN)
        for index, row in enumerate(rows):
            table[index, : len(row)] = row
        repeats = np.zeros(len(rows))
        for index, count in (jumps or {}).items():
            repeats[index] = count
        self.navigator.set_plan(table.view(PLAN_ITEM)[:, 0], repeats)

    def enter(self, mode: Mode, altitude_m: float = 0.0) -> None:
        self.mode = mode
        self.navigator.enter(mode, altitude_m)

    def airborne_at(self, north: float, east: float, down: float) -> None:
        """Place the vehicle in the air, at rest and not landed."""
        self.state[:3] = north, east, down
        self.navigator.reset_on_ground(self.state)
        self.navigator.goal.land[:] = LandMemory(0.0, 0.0, 0.0, down)

    def tick(self) -> None:
        setpoint = self.navigator.setpoint
        on_ground = self.state[2] >= 0.0 and setpoint[2] >= 0.0
        pushes = 0.0 if self.navigator.touches_ground else 0.3 * WEIGHT_N
        thrust = pushes if on_ground else WEIGHT_N
        self.navigator.step(self.mode, self.state, np.array([1.0, 0.0, 0.0, 0.0, thrust]), thrust)
        before = self.yaw
        self.state[:6] = setpoint[:6]
        if self.state[2] > 0.0:
            self.state[2:6] = 0.0
        half = 0.5 * setpoint[9]
        self.state[6], self.state[9] = math.cos(half), math.sin(half)
        self._turned_rad += math.remainder(self.yaw - before, 2.0 * math.pi)
        self.time_s += self.dt_s
        self.reached += self.navigator.reached_items()
        self.path.append(self.position)
        self.yaws.append(self.yaw)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.dt_s)):
            self.tick()

    def until(self, condition: Callable[[], bool], limit_s: float = 200.0) -> float:
        """Run until ``condition`` is true; return the elapsed time [s]."""
        began_s = self.time_s
        while not condition():
            assert self.time_s - began_s < limit_s, (self.navigator.progress, self.position)
            self.tick()
        return self.time_s - began_s

    def until_reached(self, count: int) -> float:
        return self.until(lambda: len(self.reached) >= count)

    def until_finished(self) -> float:
        progress = self.navigator
        return self.until(lambda: progress.progress.finished or progress.progress.wants_return)
