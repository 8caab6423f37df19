"""Geofence monitor: areas, limits around home, and the breach that a user has overridden."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.contract import FloatArray
from flightstack.guidance.fence import NO_FENCE, Fence, FenceBreach, FenceEvaluator
from flightstack.guidance.trajectory import BRAKING
from flightstack.params.behaviour import Behaviour

BREACH_GROWS_M = 5.0
"""Distance farther out at which an overridden fence acts again."""


class FenceBreaches(NamedTuple):
    """Breaches since boot."""

    number: int = 0
    latest_us: int = 0
    """Vehicle time at which the latest one began."""
    flags: FenceBreach = FenceBreach(0)
    """Limits that the latest one broke last."""


class FenceMonitor(FenceEvaluator):
    """A fence evaluator that is reconfigured when areas, parameters or home change."""

    def __init__(self, behaviour: Behaviour) -> None:
        super().__init__()
        self._fence_areas = NO_FENCE
        self._behaviour = behaviour
        self._home_ned_m = (0.0, 0.0, 0.0)
        self._overridden_margin_m = math.inf
        self.breaches = FenceBreaches()
        self._set_up()

    def warm_up(self, state: FloatArray) -> None:
        """Compile the fence's step, or load it from the cache."""
        probe = FenceEvaluator()
        probe.configure(NO_FENCE, max_altitude_m=1.0)
        probe.step(state)

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Set new parameters."""
        self._behaviour = behaviour
        self._set_up()

    def set_fence(self, fence: Fence) -> None:
        """Set the areas of a checked geofence; ``NO_FENCE`` for none."""
        self._fence_areas = fence
        self._set_up()

    def set_home(self, home_ned_m: tuple[float, float, float]) -> None:
        """Set the home from which distance and altitude are measured."""
        self._home_ned_m = home_ned_m
        self._set_up()

    def _set_up(self) -> None:
        b = self._behaviour
        accelerations = (b.acceleration_m_s2, b.vertical_acceleration_m_s2)
        decelerations = (BRAKING * accelerations[0], BRAKING * accelerations[1]) if b.fence_predicts else None
        self.configure(
            self._fence_areas, b.fence_max_distance_m, b.fence_max_altitude_m, self._home_ned_m, decelerations
        )

    def update(self, state: FloatArray, time_us: int) -> bool:
        """Evaluate ``state`` (13,) once per outer tick and count breaches; return True if a limit is broken."""
        before = self._flags
        flags = self.step(state)
        if flags != before and flags:
            number, latest_us, _ = self.breaches
            if not before:
                number, latest_us = number + 1, time_us
            self.breaches = FenceBreaches(number, latest_us, FenceBreach(flags))
        return flags != 0

    def record_override(self) -> None:
        """Record the margin at which a user overrides the fence."""
        self._overridden_margin_m = self.margin_m

    @property
    def has_breach_grown(self) -> bool:
        """True if the vehicle has moved far enough outward since the override for the fence to act again."""
        return self.margin_m < self._overridden_margin_m - BREACH_GROWS_M
