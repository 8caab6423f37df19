"""The comparison of the controllers in XY, from the ``cases`` of results.json. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gcs_cli.experiments.paper.flights.cases import CONDITIONS, CONTENDERS, PATHS, RIGID, SMALL_ANGLE, key

Cases = Mapping[str, Mapping[str, Any]]


def xy(cases: Cases) -> dict[str, Any]:
    """Return the table of the comparison in XY: trajectory, plant, condition, contender, then figures.

    The figures are None for a crash or a loss of control; cases that were not flown are left out.
    """
    table: dict[str, Any] = {}
    for trajectory in PATHS:
        for plant in (SMALL_ANGLE, RIGID):
            for condition in CONDITIONS:
                row = {
                    contender.name: xy_figures(cases[name])
                    for contender in CONTENDERS
                    if (name := key(contender.name, trajectory, condition.name, plant)) in cases
                }
                if row:
                    table.setdefault(trajectory, {}).setdefault(plant, {})[condition.name] = row
    return table


def xy_figures(case: Mapping[str, Any]) -> dict[str, float | None] | None:
    """Return the compared figures of one case; None for a crash or a loss of control."""
    if case["ended"] is not None:
        return None
    path = case["path"]
    overshoots = list(overshoots_of(case).values())
    return {
        "rms_m": path["rms_error_m"],
        "max_m": path["max_error_m"],
        "path_rms_m": path["path_rms_m"],
        "path_max_m": path["path_max_m"],
        "beyond_m": path["beyond_m"],
        "overshoot_percent": max(overshoots, default=None),
        "overshoot_median_percent": float(np.median(overshoots)) if overshoots else None,
        "steady_m": steady_m(case),
    }


def steady_m(case: Mapping[str, Any]) -> float:
    """Return the steady-state error in XY [m]."""
    x, y = (float(case["metrics"][axis]["steady_state_error"]) for axis in ("x", "y"))
    return math.hypot(x, y)


def overshoots_of(case: Mapping[str, Any]) -> dict[tuple[str, float], float]:
    """Return the overshoot [%] of each move of x and y that began at rest, by its axis and time."""
    return {
        (axis, move["at_s"]): move["overshoot_percent"]
        for axis in ("x", "y")
        for move in case["metrics"][axis]["moves"]
        if move["overshoot_percent"] is not None
    }


class Overshoots(NamedTuple):
    """Overshoots over the same moves of several flights."""

    median_percent: list[float]
    """Of each flight."""
    worst_percent: list[float]
    moves: int


def shared_overshoots(cases: Sequence[Mapping[str, Any]]) -> Overshoots | None:
    """Compare flights by the moves of x and y that began at rest in all of them; None without such a move."""
    found = [overshoots_of(case) for case in cases]
    shared = set(found[0]).intersection(*found[1:]) if found else set()
    if not shared:
        return None
    rows = [[one[move] for move in sorted(shared)] for one in found]
    return Overshoots([float(np.median(row)) for row in rows], [max(row) for row in rows], len(shared))
