"""The target of every mode but the mission, as an array, and the goal it makes for the reference."""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, VehicleState
from flightstack.core.modes import Mode
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.trajectory import Goal

TAKEOFF, RETURN, LAND = int(Mode.TAKEOFF), int(Mode.RETURN), int(Mode.LAND)

# position, heading and speed (0: the cruise speed); the phase of a return and the place it ends at; where a mission's
# item began
A_X, A_Y, A_Z, A_YAW, A_SPEED, A_PHASE, A_HOME_X, A_HOME_Y, A_HOME_Z, A_START_X, A_START_Y = range(11)
AIM_SIZE = 11
CLIMBING, CRUISING, DESCENDING = 0.0, 1.0, 2.0
"""Phases of a return."""


@compiled
def advance_return(aim: FloatArray, state: VehicleState, params: GuidanceParams) -> None:
    """Return: climb, go to the place of the return, descend."""
    p = state.position_ned_m
    dx, dy = aim[A_HOME_X] - p.x, aim[A_HOME_Y] - p.y
    if aim[A_PHASE] == CLIMBING and abs(p.z - aim[A_Z]) <= params.altitude_acceptance_m:
        aim[A_PHASE] = CRUISING
        aim[A_X], aim[A_Y] = aim[A_HOME_X], aim[A_HOME_Y]
    elif (
        aim[A_PHASE] == CRUISING
        and dx * dx + dy * dy <= params.acceptance_radius_m * params.acceptance_radius_m
    ):
        aim[A_PHASE] = DESCENDING


@compiled
def aim_goal(mode: int, aim: FloatArray, params: GuidanceParams) -> Goal:
    """Return where ``mode`` sends the reference."""
    z, climb, descent = aim[A_Z], params.climb_speed_m_s, params.descent_speed_m_s
    speed = aim[A_SPEED] if aim[A_SPEED] > 0.0 else params.cruise_speed_m_s
    if mode == TAKEOFF:
        climb = params.takeoff_speed_m_s
    elif mode == LAND or (mode == RETURN and aim[A_PHASE] == DESCENDING):
        z = params.far_below_m
    return Goal(aim[A_X], aim[A_Y], z, aim[A_YAW], speed, climb, descent, params.yaw_rate_rad_s, 0.0)
