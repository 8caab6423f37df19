"""From mission items to the table that guidance flies."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.mission import DO_JUMP, PLAN_ITEM
from flightstack.plan import MissionItem


def plan_table(
    items: Sequence[MissionItem], frame: LocalFrame, home_altitude_m: float
) -> tuple[RecordArray, FloatArray]:
    """Return the plan, n of ``PLAN_ITEM``, and the repeats of its jumps, shape (n,); see ``guidance.mission``.

    Positions are in the local ``frame``; relative altitudes count from home, at ``home_altitude_m`` above the sea.
    """
    origin_altitude_m = frame.origin.altitude_m
    plan: RecordArray = np.empty(len(items), PLAN_ITEM)
    jumps = np.zeros(len(items))
    for row, item in enumerate(items):
        north_m = east_m = down_m = math.nan
        position = item.position_deg
        if position is not None:
            local = frame.to_ned(GeoPoint(position[0], position[1], origin_altitude_m))
            north_m, east_m = local.x, local.y
        if item.is_global and math.isfinite(item.z):
            base_m = home_altitude_m - origin_altitude_m if item.altitude_is_relative else -origin_altitude_m
            down_m = -(item.z + base_m)
        plan[row] = (item.command, *item.params, north_m, east_m, down_m)
        if item.command == DO_JUMP:
            jumps[row] = item.param2
    return plan, jumps
