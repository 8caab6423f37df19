"""Mission execution item by item, on arrays so that it can be compiled.

The plan is an array of ``PLAN_ITEM``, NaN for values that the item does not set. Progress is a record of ``MISSION``,
advanced in place. ``jumps_left`` holds the remaining repeats of each DO_JUMP (negative: unlimited).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, RecordArray, VehicleState
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.geometry import euler_from_quaternion, wrap_pi
from flightstack.core.portable_math import atan2
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.trajectory import Goal, Trajectory
from flightstack.plan import MissionItem
from flightstack.plan.commands import Command

# numbers for the kernels: compiled code knows no enumeration
WAYPOINT, LOITER_TIME, RETURN_TO_LAUNCH = (
    int(Command.NAV_WAYPOINT), int(Command.NAV_LOITER_TIME), int(Command.NAV_RETURN_TO_LAUNCH)
)  # fmt: skip
LAND, TAKEOFF, NAV_DELAY = int(Command.NAV_LAND), int(Command.NAV_TAKEOFF), int(Command.NAV_DELAY)
CONDITION_YAW, DO_JUMP = int(Command.CONDITION_YAW), int(Command.DO_JUMP)
DO_CHANGE_SPEED = int(Command.DO_CHANGE_SPEED)

LOG_SIZE = 64
BEGIN, TRAVEL, STAY, RISE = range(4)
"""Phases of an item: not begun; travelling; at the position (waiting or descending); climbing from the ground."""

PLAN_ITEM = np.dtype(
    [
        ("command", "f8"),
        ("param1", "f8"),
        ("param2", "f8"),
        ("param3", "f8"),
        ("param4", "f8"),
        ("north", "f8"),  # m from the origin of the local frame
        ("east", "f8"),
        ("down", "f8"),
    ]
)

MISSION = np.dtype(
    [
        ("current", "i8"),  # item
        ("reached", "i8"),  # the last item reached; −1: none
        ("finished", "?"),
        ("wants_return", "?"),
        ("phase", "i8"),
        ("timer", "f8"),  # s
        # present goal
        ("x", "f8"),  # m NED
        ("y", "f8"),
        ("z", "f8"),
        ("yaw", "f8"),  # rad
        ("yaw_is_set", "?"),
        ("yaw_is_counted", "?"),
        ("yaw_rate", "f8"),  # rad/s
        ("speed", "f8"),  # m/s
        # goal of the initial climb from the ground, for an item that is not a takeoff
        ("rise_x", "f8"),
        ("rise_y", "f8"),
        ("rise_z", "f8"),
        # items reached since the start, the newest ``LOG_SIZE`` of them: several may be reached in one tick
        ("log_count", "i8"),
        ("log", "i8", LOG_SIZE),
    ],
    align=True,
)


def mission_start(m: Record, current: int, reference: Trajectory, params: GuidanceParams) -> None:
    """Initialise ``m`` to begin item ``current`` at the reference."""
    m["current"], m["reached"], m["finished"], m["wants_return"] = current, -1, False, False
    m["phase"], m["timer"] = BEGIN, 0.0
    m["x"], m["y"], m["z"], m["yaw"] = reference.x, reference.y, reference.z, reference.yaw_rad
    m["yaw_is_set"], m["yaw_is_counted"] = False, False
    m["yaw_rate"], m["speed"] = params.yaw_rate_rad_s, params.cruise_speed_m_s


class MissionProgress(NamedTuple):
    """Progress of the mission."""

    current: int
    reached: int
    finished: bool
    wants_return: bool


@compiled
def _note_reached(m: Record) -> None:
    m["reached"] = m["current"]
    m["log"][m["log_count"] % LOG_SIZE] = m["current"]
    m["log_count"] += 1


@compiled
def _advance(m: Record, to: int) -> None:
    _note_reached(m)
    m["current"] = to
    m["phase"] = BEGIN
    m["timer"] = 0.0


@compiled
def _leg_heading(m: Record, x: float, y: float, state: VehicleState, params: GuidanceParams) -> float:
    """Return the heading of a leg without a heading in the plan."""
    present: float = m["yaw"]
    if m["yaw_is_set"] or params.yaw_mode >= 0.5:
        return present
    dx, dy = x - state.position_ned_m.x, y - state.position_ned_m.y
    if dx * dx + dy * dy < 1.0:  # too near for a direction
        return present
    return atan2(dy, dx)


@compiled
def _begin_condition_yaw(m: Record, item: Record, reference_yaw_rad: float, params: GuidanceParams) -> None:
    """Begin CONDITION_YAW: angle [deg], rate [deg/s], direction (−1, 0 shortest, 1), relative (1) or absolute.

    With a direction, the turn is counted from the reference's heading and may exceed half a circle. Without one, the
    vehicle takes the shorter turn to the heading.
    """
    angle, direction = math.radians(item["param1"]), item["param3"]
    turn = angle if item["param4"] > 0.5 else wrap_pi(angle - reference_yaw_rad)
    if direction != 0.0 and not math.isnan(direction):
        if item["param4"] > 0.5:
            turn = direction * turn
        elif direction * turn < -1e-6:  # the other way round; a heading that is there already stays
            turn += direction * 2.0 * math.pi
        m["yaw"], m["yaw_is_counted"] = reference_yaw_rad + turn, True
    else:
        m["yaw"], m["yaw_is_counted"] = wrap_pi(reference_yaw_rad + turn), False
    m["yaw_is_set"] = True
    m["yaw_rate"] = params.yaw_rate_rad_s
    if item["param2"] > 0.0:
        m["yaw_rate"] = min(params.yaw_rate_rad_s, math.radians(item["param2"]))
    m["phase"] = TRAVEL


@compiled
def _begin_position_item(
    m: Record, item: Record, state: VehicleState, landed: bool, params: GuidanceParams
) -> None:
    """Set the item's goal. From the ground the vehicle climbs first, at least to MIS_TAKEOFF_ALT, as in PX4."""
    command = item["command"]
    m["rise_x"], m["rise_y"] = m["x"], m["y"]
    x = m["x"] if math.isnan(item["north"]) else item["north"]
    y = m["y"] if math.isnan(item["east"]) else item["east"]
    if command != LAND and not math.isnan(
        item["down"]
    ):  # LAND: fly there at the present height, then descend
        m["z"] = item["down"]
    if command != LOITER_TIME and not math.isnan(item["param4"]):  # LOITER_TIME has no heading
        m["yaw"], m["yaw_is_set"] = wrap_pi(math.radians(item["param4"])), True
    elif command != TAKEOFF:
        m["yaw"] = _leg_heading(m, x, y, state, params)
    m["yaw_is_counted"] = False
    m["x"], m["y"] = x, y
    m["yaw_rate"] = params.yaw_rate_rad_s
    rise_z = max(state.position_ned_m.z - params.takeoff_altitude_m, params.ceiling_down_m)
    m["rise_z"] = min(m["z"], rise_z)
    m["phase"] = RISE if landed and command not in (TAKEOFF, LAND) else TRAVEL


@compiled
def _change_speed(m: Record, item: Record, params: GuidanceParams) -> None:
    if item["param2"] > 0.0:
        m["speed"] = min(item["param2"], params.max_speed_m_s)
    elif item["param2"] == -2.0:  # back to the default; −1 is "no change"
        m["speed"] = params.cruise_speed_m_s


@compiled
def _begin(
    m: Record,
    plan: RecordArray,
    jumps_left: FloatArray,
    state: VehicleState,
    reference_yaw_rad: float,
    landed: bool,
    params: GuidanceParams,
) -> None:
    """Execute items without duration up to the next item with a duration, and begin that item."""
    for _ in range(2 * plan.shape[0] + 2):  # the plan check excludes endless loops of jumps
        index = m["current"]
        if index >= plan.shape[0]:
            break
        item = plan[index]
        command = item["command"]
        if command == DO_CHANGE_SPEED:
            _change_speed(m, item, params)
            _advance(m, index + 1)
        elif command == DO_JUMP:
            jumps = jumps_left[index] != 0.0
            if jumps:
                jumps_left[index] -= 1.0
            _advance(m, int(item["param1"]) if jumps else index + 1)
        elif command == RETURN_TO_LAUNCH:
            _note_reached(m)
            m["wants_return"] = True
            break
        elif command == CONDITION_YAW:
            _begin_condition_yaw(m, item, reference_yaw_rad, params)
            return
        elif command == NAV_DELAY:
            m["phase"] = STAY
            return
        else:
            _begin_position_item(m, item, state, landed, params)
            return
    m["finished"] = True


@compiled
def _heading_error(m: Record, state: VehicleState) -> float:
    return abs(wrap_pi(m["yaw"] - euler_from_quaternion(state.attitude).z))


@compiled
def _is_within(m: Record, state: VehicleState, radius_m: float) -> bool:
    dx, dy = m["x"] - state.position_ned_m.x, m["y"] - state.position_ned_m.y
    within: bool = dx * dx + dy * dy <= radius_m * radius_m
    return within


@compiled
def _is_at_height(m: Record, state: VehicleState, params: GuidanceParams) -> bool:
    there: bool = abs(m["z"] - state.position_ned_m.z) <= params.altitude_acceptance_m
    return there


@compiled
def _is_reached(m: Record, item: Record, state: VehicleState, params: GuidanceParams) -> bool:
    """Return True if the vehicle is at the item's position, and at its heading if the item sets one."""
    is_waypoint = item["command"] == WAYPOINT
    radius = item["param2"] if is_waypoint and item["param2"] > 0.0 else params.acceptance_radius_m
    if not (_is_within(m, state, radius) and _is_at_height(m, state, params)):
        return False
    needs_heading = is_waypoint and not math.isnan(item["param4"])
    return not needs_heading or _heading_error(m, state) <= params.yaw_acceptance_rad


@compiled
def _is_turned(m: Record, state: VehicleState, reference_yaw_rad: float, params: GuidanceParams) -> bool:
    """Return True if a CONDITION_YAW is complete: the vehicle has the heading and the reference the counted turn."""
    if m["yaw_is_counted"] and abs(m["yaw"] - reference_yaw_rad) > params.yaw_acceptance_rad:
        return False
    return _heading_error(m, state) <= params.yaw_acceptance_rad


@compiled
def _travel(
    m: Record,
    item: Record,
    state: VehicleState,
    reference_yaw_rad: float,
    landed: bool,
    params: GuidanceParams,
) -> None:
    command = item["command"]
    following = m["current"] + 1
    if command == CONDITION_YAW:  # a landed vehicle cannot turn: continue, it turns after takeoff
        if landed or _is_turned(m, state, reference_yaw_rad, params):
            _advance(m, following)
    elif command == TAKEOFF:
        if _is_at_height(m, state, params):
            m["phase"] = STAY  # at altitude: continue to the item's position
    elif _is_reached(m, item, state, params):
        waits = item["param1"] > 0.0 and command in (WAYPOINT, LOITER_TIME)
        if waits or command == LAND:
            m["phase"] = STAY
        else:
            _advance(m, following)


@compiled
def _stay(
    m: Record, item: Record, state: VehicleState, landed: bool, params: GuidanceParams, dt_s: float
) -> None:
    command = item["command"]
    if command == LAND:
        done = landed
    elif command == TAKEOFF:
        done = _is_reached(m, item, state, params)
    else:
        m["timer"] += dt_s
        done = m["timer"] >= item["param1"] - 1e-9
    if done:
        _advance(m, m["current"] + 1)


@compiled
def mission_step(
    m: Record,
    plan: RecordArray,
    jumps_left: FloatArray,
    state: VehicleState,
    reference_yaw_rad: float,
    landed: bool,
    params: GuidanceParams,
    dt_s: float,
) -> None:
    """Advance the mission by one outer tick; ``reference_yaw_rad`` is the trajectory's present heading."""
    if m["finished"]:
        return
    if m["phase"] == RISE:
        if abs(m["rise_z"] - state.position_ned_m.z) <= params.altitude_acceptance_m:
            m["phase"] = TRAVEL
    elif m["phase"] == TRAVEL:
        _travel(m, plan[m["current"]], state, reference_yaw_rad, landed, params)
    elif m["phase"] == STAY:
        _stay(m, plan[m["current"]], state, landed, params, dt_s)
    if m["phase"] == BEGIN:
        _begin(m, plan, jumps_left, state, reference_yaw_rad, landed, params)


@compiled
def mission_lands(m: Record, plan: RecordArray) -> bool:
    """Return True if the vehicle descends to land at the current item."""
    index = m["current"]
    if m["finished"] or index >= plan.shape[0]:
        return False
    return bool(plan[index]["command"] == LAND and m["phase"] == STAY)


@compiled
def mission_goal(
    m: Record, plan: RecordArray, start_x: float, start_y: float, params: GuidanceParams
) -> Goal:
    """Return the goal of the present item, which began above ``start``."""
    x, y, z, climb = m["x"], m["y"], m["z"], params.climb_speed_m_s
    index = m["current"]
    if not m["finished"] and index < plan.shape[0]:
        command = plan[index]["command"]
        if command == TAKEOFF:
            climb = params.takeoff_speed_m_s
            if m["phase"] == TRAVEL:  # straight up first
                x, y = start_x, start_y
        elif m["phase"] == RISE:
            x, y, z = m["rise_x"], m["rise_y"], m["rise_z"]
            climb = params.takeoff_speed_m_s
        elif mission_lands(m, plan):
            z = params.far_below_m
    descent, counted = params.descent_speed_m_s, 1.0 if m["yaw_is_counted"] else 0.0
    return Goal(x, y, z, m["yaw"], m["speed"], climb, descent, m["yaw_rate"], counted)


@compiled
def with_landing_descent(goal: Goal, down_m: float, params: GuidanceParams) -> Goal:
    """Return ``goal`` with the landing speed at ``down_m`` if the goal is below the ground.

    The goal of a landing always is, and so may be a position whose terrain differs from home or plan.
    """
    g = goal
    descent = landing_speed(down_m, params) if g.z > params.ground_down_m else g.descent_m_s
    return Goal(
        g.x, g.y, g.z, g.yaw_rad, g.speed_m_s, g.climb_m_s, descent, g.yaw_rate_rad_s, g.yaw_is_counted
    )


@compiled
def landing_speed(down_m: float, params: GuidanceParams) -> float:
    """Return the descent speed of a landing at ``down_m``, slower near the ground."""
    height_m = params.ground_down_m - down_m
    return params.descent_speed_m_s if height_m > params.land_slow_altitude_m else params.land_speed_m_s


def plan_table(
    items: Sequence[MissionItem], frame: LocalFrame, home_altitude_m: float
) -> tuple[RecordArray, FloatArray]:
    """Return the plan, n of ``PLAN_ITEM``, and the repeats of its jumps, shape (n,).

    Positions are in the local ``frame``; relative altitudes refer to home, at ``home_altitude_m`` above mean sea level.
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
