"""From mission items to the table that guidance flies."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightstack.contract import FloatArray
from flightstack.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.mission import DO_JUMP, PLAN_COLUMNS
from flightstack.plan import MissionItem


def plan_table(items: Sequence[MissionItem], home: GeoPoint) -> tuple[FloatArray, FloatArray]:
    """Return the plan, shape (n, 8), and the repeats of its jumps, shape (n,); see ``guidance.mission``."""
    frame = LocalFrame(home)
    plan = np.full((len(items), PLAN_COLUMNS), math.nan)
    jumps = np.zeros(len(items))
    for row, item in enumerate(items):
        plan[row, :5] = (item.command, *item.params)
        position = item.position_deg
        if position is not None:
            local = frame.to_ned(GeoPoint(position[0], position[1], home.altitude_m))
            plan[row, 5:7] = local.x, local.y
        if item.is_global and math.isfinite(item.z):
            above_home_m = item.z if item.altitude_is_relative else item.z - home.altitude_m
            plan[row, 7] = -above_home_m
        if item.command == DO_JUMP:
            jumps[row] = item.param2
    return plan, jumps
