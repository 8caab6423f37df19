"""Target of all modes but the mission, as a record, and the resulting goal of the reference."""

from __future__ import annotations

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import Record, VehicleState
from flightstack.core.enums import Mode
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.trajectory import Goal

TAKEOFF, RETURN, LAND = int(Mode.TAKEOFF), int(Mode.RETURN), int(Mode.LAND)

MODE_TARGET = np.dtype(
    [
        ("x", "f8"),  # m NED
        ("y", "f8"),
        ("z", "f8"),
        ("yaw", "f8"),  # rad
        ("speed", "f8"),  # m/s; 0: the cruise speed
        ("phase", "i8"),  # of a return
        ("home_x", "f8"),  # destination of a return, m NED
        ("home_y", "f8"),
        ("home_z", "f8"),
        ("start_x", "f8"),  # start of a mission item, m NED
        ("start_y", "f8"),
    ]
)
CLIMBING, CRUISING, DESCENDING = range(3)
"""Phases of a return."""


@compiled
def advance_return(target: Record, state: VehicleState, params: GuidanceParams) -> None:
    """Advance the phases of a return: climb, cruise to the destination, descend."""
    p = state.position_ned_m
    dx, dy = target["home_x"] - p.x, target["home_y"] - p.y
    if target["phase"] == CLIMBING and abs(p.z - target["z"]) <= params.altitude_acceptance_m:
        target["phase"] = CRUISING
        target["x"], target["y"] = target["home_x"], target["home_y"]
    elif (
        target["phase"] == CRUISING
        and dx * dx + dy * dy <= params.acceptance_radius_m * params.acceptance_radius_m
    ):
        target["phase"] = DESCENDING


@compiled
def lands(mode: int, target: Record) -> bool:
    """Return True if the vehicle descends to land."""
    return bool(mode == LAND or (mode == RETURN and target["phase"] == DESCENDING))


@compiled
def target_goal(mode: int, target: Record, params: GuidanceParams) -> Goal:
    """Return the goal of ``mode``."""
    z, climb, descent = target["z"], params.climb_speed_m_s, params.descent_speed_m_s
    speed = target["speed"] if target["speed"] > 0.0 else params.cruise_speed_m_s
    if mode == TAKEOFF:
        climb = params.takeoff_speed_m_s
    elif lands(mode, target):
        z = params.far_below_m
    return Goal(target["x"], target["y"], z, target["yaw"], speed, climb, descent, params.yaw_rate_rad_s, 0.0)
