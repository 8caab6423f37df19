"""Cost of the stages of a step on a target: figures and histogram. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, LoopStatus
from gcs_cli.pil.target_record import StatusArray

STAGES = ("outer", "inner", "mixer", "whole")
STAGE_TITLES = {"outer": "outer loop", "inner": "inner loop", "mixer": "mixer", "whole": "whole step"}
_BINS = 24
EMULATED_CLOCK_HZ = 168e6
"""Clock that the load of an emulated target is given for: that of an STM32F405, a common Cortex-M4F."""
_ABOUT_LOAD = {
    "cycles": "cycles of the board, at its own clock",
    "instructions": (
        "instructions of the emulated Cortex-M4F as one cycle each at 168 MHz (STM32F405): a lower bound, since "
        "division, branches, loads and flash wait states take more cycles"
    ),
    "ns": "time of this machine, which did other things as well",
}


class StageProfile(NamedTuple):
    """Cost of one stage, in the target's unit, over the steps in which it ran."""

    stage: str
    steps: int
    smallest: float
    mean: float
    p99: float
    """The smallest cost that 99 % of the steps do not exceed."""
    largest: float
    edges: tuple[float, ...]
    """Edges of the histogram's bins, ascending."""
    counts: tuple[int, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the object for ``pil.json``."""
        return {
            "count": self.steps,
            "min": self.smallest,
            "mean": round(self.mean, 3),
            "p99": self.p99,
            "max": self.largest,
            "histogram": {"edges": list(self.edges), "counts": list(self.counts)},
        }


def stage_profiles(costs: FloatArray) -> list[StageProfile]:
    """Return the profile of each stage that ran; ``costs`` is (steps, 4): outer, inner, mixer, whole.

    A stage that costs nothing did not run: the outer loop does so in most steps.
    """
    columns = costs.reshape(-1, len(STAGES)).T
    return [
        _profile(stage, column[column > 0])
        for stage, column in zip(STAGES, columns, strict=True)
        if np.any(column > 0)
    ]


_TORQUE = LoopStatus.ROLL_SATURATED | LoopStatus.PITCH_SATURATED | LoopStatus.YAW_SATURATED
_LIMITS = {
    "nothing limited": (_TORQUE | LoopStatus.THRUST_SATURATED, False),
    "torque limited": (_TORQUE, True),
    "thrust limited": (LoopStatus.THRUST_SATURATED, True),
    "input not finite": (LoopStatus.INPUT_NOT_FINITE, True),
    "output not finite": (LoopStatus.OUTPUT_NOT_FINITE, True),
}
"""Bits of ``LoopStatus`` by branch, and whether one of them is set in it."""


def branch_costs(costs: FloatArray, statuses: StatusArray) -> dict[str, dict[str, float]]:
    """Return ``count``, ``mean`` and ``max`` of the whole step's cost in each branch of the loops that was taken.

    ``costs`` is (steps, 4), as of ``stage_profiles``; ``statuses`` has FS_PIL_REPORT.status of each step.
    """
    is_outer = costs[:, STAGES.index("outer")] > 0
    taken = {"outer loop due": is_outer, "inner loop alone": ~is_outer}
    taken |= {name: ((statuses & bits) != 0) == is_set for name, (bits, is_set) in _LIMITS.items()}
    whole = costs[:, STAGES.index("whole")]
    return {
        name: {
            "count": int(rows.sum()),
            "mean": round(float(whole[rows].mean()), 3),
            "max": float(whole[rows].max()),
        }
        for name, rows in taken.items()
        if rows.any()
    }


class Load(NamedTuple):
    """Processor time of a step in percent of its period."""

    clock_hz: float
    period_s: float
    mean: float
    p99: float
    largest: float
    about: str

    def as_json(self) -> dict[str, Any]:
        """Return the object for ``pil.json``."""
        return {
            "clock_hz": self.clock_hz,
            "period_us": round(self.period_s * 1e6, 3),
            "mean_percent": round(self.mean, 4),
            "p99_percent": round(self.p99, 4),
            "max_percent": round(self.largest, 4),
            "about": self.about,
        }


def cpu_load(
    profiles: Sequence[StageProfile], unit: str, clock_hz: float, inner_hz: float | None
) -> Load | None:
    """Return the load of the whole step, or None if its cost or period is unknown.

    Instructions of an emulated target count as one cycle each, of ``EMULATED_CLOCK_HZ``.
    """
    whole = next((profile for profile in profiles if profile.stage == "whole"), None)
    hz = {"cycles": clock_hz, "instructions": EMULATED_CLOCK_HZ, "ns": 1e9}.get(unit, 0.0)
    if whole is None or not hz or inner_hz is None:
        return None
    percent = 100.0 * inner_hz / hz
    return Load(
        hz,
        1.0 / inner_hz,
        percent * whole.mean,
        percent * whole.p99,
        percent * whole.largest,
        _ABOUT_LOAD[unit],
    )


def _profile(stage: str, costs: FloatArray) -> StageProfile:
    low, high = float(costs.min()), float(costs.max())
    edges = _edges(low, high)
    counts, _ = np.histogram(costs, edges)
    rank = math.ceil(0.99 * len(costs)) - 1
    return StageProfile(
        stage,
        len(costs),
        low,
        float(costs.mean()),
        float(np.sort(costs)[rank]),
        high,
        tuple(edges),
        tuple(counts.tolist()),
    )


def _edges(low: float, high: float) -> list[float]:
    """Return bin edges a whole number of units apart that cover all costs from low to high."""
    width = max(1, math.ceil((high - low + 1.0) / _BINS))
    bins = max(1, math.ceil((high - low + 1.0) / width))
    return [low - 0.5 + width * index for index in range(bins + 1)]
