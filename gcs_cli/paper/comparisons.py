"""The comparison of the controllers in XY, from the ``cases`` of results.json, so that anyone can do the same. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gcs_cli.paper.cases import (
    CONDITIONS,
    CONTENDERS,
    PATHS,
    RIGID,
    SMALL_ANGLE,
    key,
)

Cases = Mapping[str, Mapping[str, Any]]


def xy(cases: Cases) -> dict[str, Any]:
    """Return the table of the comparison in XY: trajectory, plant, condition, contender, then figures.

    A contender's figures are None where it crashed; what of the matrix was not flown is left out.
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
    """Return what the comparison takes from one case; None where it crashed."""
    if case["ended"] is not None:
        return None
    path, x, y = case["path"], case["metrics"]["x"], case["metrics"]["y"]
    overshoots = [axis["overshoot_percent"] for axis in (x, y) if axis["overshoot_percent"] is not None]
    return {
        "rms_m": path["rms_error_m"],
        "max_m": path["max_error_m"],
        "path_rms_m": path["path_rms_m"],
        "path_max_m": path["path_max_m"],
        "beyond_m": path["beyond_m"],
        "overshoot_percent": max(overshoots) if overshoots else None,
        "steady_m": (x["steady_state_error"] ** 2 + y["steady_state_error"] ** 2) ** 0.5,
    }
