"""From mission items to the table that guidance flies."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.mission import DO_JUMP, PLAN_COLUMNS
from flightstack.plan import MissionItem


def plan_table(
    items: Sequence[MissionItem], frame: LocalFrame, home_altitude_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return the plan, shape (n, 8), and the repeats of its jumps, shape (n,); see ``guidance.mission``.

    Positions are in the local ``frame``; relative altitudes count from home, at ``home_altitude_m`` above the sea.
    """
    origin_altitude_m = frame.origin.altitude_m
    plan = np.full((len(items), PLAN_COLUMNS), math.nan)
    jumps = np.zeros(len(items))
    for row, item in enumerate(items):
        plan[row, :5] = (item.command, *item.params)
        position = item.position_deg
        if position is not None:
            local = frame.to_ned(GeoPoint(position[0], position[1], origin_altitude_m))
            plan[row, 5:7] = local.x, local.y
        if item.is_global and math.isfinite(item.z):
            base_m = home_altitude_m - origin_altitude_m if item.altitude_is_relative else -origin_altitude_m
            plan[row, 7] = -(item.z + base_m)
        if item.command == DO_JUMP:
            jumps[row] = item.param2
    return plan, jumps
