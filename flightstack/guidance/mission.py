"""Fly a plan item by item, over tables of numbers, so that a whole flight can be compiled.

The plan is an array, a row for each item: command, parameters 1–4, north, east, down [m] from home; NaN where
the item leaves a value open. Progress is an array too (``M_…`` below), advanced in place. ``jumps_left``
holds for each DO_JUMP how often it still jumps (negative: for ever).
"""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, VehicleState
from flightstack.core.geometry import euler_from_quaternion, wrap_pi
from flightstack.core.portable_math import atan2
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.trajectory import Goal

# columns of the plan
COMMAND, PARAM1, PARAM2, PARAM3, PARAM4, NORTH, EAST, DOWN = range(8)
PLAN_COLUMNS = 8

WAYPOINT = 16
LOITER_TIME = 19
RETURN_TO_LAUNCH = 20
LAND = 21
TAKEOFF = 22
NAV_DELAY = 93
CONDITION_YAW = 115
DO_JUMP = 177
DO_CHANGE_SPEED = 178

# progress: the current item and its phase, the last item reached (−1: none), and the goal in force
M_PHASE, M_TIMER, M_CURRENT, M_REACHED, M_FINISHED, M_WANTS_RETURN = range(6)
M_PROGRESS = slice(M_CURRENT, M_WANTS_RETURN + 1)
M_X, M_Y, M_Z, M_YAW, M_YAW_IS_SET, M_YAW_IS_COUNTED, M_YAW_RATE, M_SPEED = range(6, 14)
# where a vehicle on the ground rises to before it sets out for an item that is no takeoff
M_RISE_X, M_RISE_Y, M_RISE_Z = range(14, 17)
# items reached since the start, the newest ``LOG_SIZE`` of them: several may be reached in one tick
M_LOG_COUNT, M_LOG = 17, 18
LOG_SIZE = 64
MISSION_MEMORY_SIZE = M_LOG + LOG_SIZE

BEGIN, TRAVEL, STAY, RISE = 0.0, 1.0, 2.0, 3.0
"""Phases of an item: about to begin; on the way; there (waiting out its time, or descending); leaving the ground."""


@compiled
def mission_start(
    m: FloatArray, current: float, x: float, y: float, z: float, yaw_rad: float, params: GuidanceParams
) -> None:
    """Set ``m`` to a mission about to begin item ``current`` with the reference at x, y, z [m NED]."""
    m[:M_LOG_COUNT] = 0.0
    m[M_CURRENT], m[M_PHASE], m[M_REACHED] = current, BEGIN, -1.0
    m[M_X], m[M_Y], m[M_Z], m[M_YAW] = x, y, z, yaw_rad
    m[M_YAW_RATE], m[M_SPEED] = params.yaw_rate_rad_s, params.cruise_speed_m_s


@compiled
def _note_reached(m: FloatArray) -> None:
    m[M_REACHED] = m[M_CURRENT]
    m[M_LOG + int(m[M_LOG_COUNT]) % LOG_SIZE] = m[M_CURRENT]
    m[M_LOG_COUNT] += 1.0


@compiled
def _advance(m: FloatArray, to: float) -> None:
    _note_reached(m)
    m[M_CURRENT] = to
    m[M_PHASE] = BEGIN
    m[M_TIMER] = 0.0


@compiled
def _leg_heading(m: FloatArray, x: float, y: float, state: VehicleState, params: GuidanceParams) -> float:
    """Heading of a leg for which the plan gives none."""
    present: float = m[M_YAW]
    if m[M_YAW_IS_SET] > 0.0 or params.yaw_mode >= 0.5:
        return present
    dx, dy = x - state.position_ned_m.x, y - state.position_ned_m.y
    if dx * dx + dy * dy < 1.0:  # too near for a direction
        return present
    return atan2(dy, dx)


@compiled
def _begin_condition_yaw(
    m: FloatArray, item: FloatArray, reference_yaw_rad: float, params: GuidanceParams
) -> None:
    """CONDITION_YAW: angle [deg], rate [deg/s], direction (−1, 0 shortest, 1), relative (1) or absolute.

    With a direction the turn is counted from the reference's heading: exactly, and by more than half a
    circle if need be. Without one the heading alone counts.
    """
    angle, direction = math.radians(item[PARAM1]), item[PARAM3]
    turn = angle if item[PARAM4] > 0.5 else wrap_pi(angle - reference_yaw_rad)
    if direction != 0.0 and not math.isnan(direction):
        if item[PARAM4] > 0.5:
            turn = direction * turn
        elif direction * turn < -1e-6:  # the other way round; a heading that is there already stays
            turn += direction * 2.0 * math.pi
        m[M_YAW], m[M_YAW_IS_COUNTED] = reference_yaw_rad + turn, 1.0
    else:
        m[M_YAW], m[M_YAW_IS_COUNTED] = wrap_pi(reference_yaw_rad + turn), 0.0
    m[M_YAW_IS_SET] = 1.0
    m[M_YAW_RATE] = params.yaw_rate_rad_s
    if item[PARAM2] > 0.0:
        m[M_YAW_RATE] = min(params.yaw_rate_rad_s, math.radians(item[PARAM2]))
    m[M_PHASE] = TRAVEL


@compiled
def _begin_position_item(
    m: FloatArray, item: FloatArray, state: VehicleState, landed: bool, params: GuidanceParams
) -> None:
    """Aim for the item. From the ground the vehicle rises first, as PX4's does: at least to MIS_TAKEOFF_ALT."""
    command = item[COMMAND]
    m[M_RISE_X], m[M_RISE_Y] = m[M_X], m[M_Y]
    x = m[M_X] if math.isnan(item[NORTH]) else item[NORTH]
    y = m[M_Y] if math.isnan(item[EAST]) else item[EAST]
    if command != LAND and not math.isnan(item[DOWN]):  # LAND: fly there at the present height, then descend
        m[M_Z] = item[DOWN]
    if command != LOITER_TIME and not math.isnan(item[PARAM4]):  # LOITER_TIME has no heading
        m[M_YAW], m[M_YAW_IS_SET] = wrap_pi(math.radians(item[PARAM4])), 1.0
    elif command != TAKEOFF:
        m[M_YAW] = _leg_heading(m, x, y, state, params)
    m[M_YAW_IS_COUNTED] = 0.0
    m[M_X], m[M_Y] = x, y
    m[M_YAW_RATE] = params.yaw_rate_rad_s
    rise_z = max(state.position_ned_m.z - params.takeoff_altitude_m, params.ceiling_down_m)
    m[M_RISE_Z] = min(m[M_Z], rise_z)
    m[M_PHASE] = RISE if landed and command not in (TAKEOFF, LAND) else TRAVEL


@compiled
def _change_speed(m: FloatArray, item: FloatArray, params: GuidanceParams) -> None:
    if item[PARAM2] > 0.0:
        m[M_SPEED] = min(item[PARAM2], params.max_speed_m_s)
    elif item[PARAM2] == -2.0:  # back to the default; −1 is "no change"
        m[M_SPEED] = params.cruise_speed_m_s


@compiled
def _begin(
    m: FloatArray,
    plan: FloatArray,
    jumps_left: FloatArray,
    state: VehicleState,
    reference_yaw_rad: float,
    landed: bool,
    params: GuidanceParams,
) -> None:
    """Carry out items that take no time until one that does, and begin that one."""
    for _ in range(2 * plan.shape[0] + 2):  # a plan was checked to have no endless loop of jumps
        index = int(m[M_CURRENT])
        if index >= plan.shape[0]:
            break
        item = plan[index]
        command = item[COMMAND]
        if command == DO_CHANGE_SPEED:
            _change_speed(m, item, params)
            _advance(m, index + 1.0)
        elif command == DO_JUMP:
            jumps = jumps_left[index] != 0.0
            if jumps:
                jumps_left[index] -= 1.0
            _advance(m, item[PARAM1] if jumps else index + 1.0)
        elif command == RETURN_TO_LAUNCH:
            _note_reached(m)
            m[M_WANTS_RETURN] = 1.0
            break
        elif command == CONDITION_YAW:
            _begin_condition_yaw(m, item, reference_yaw_rad, params)
            return
        elif command == NAV_DELAY:
            m[M_PHASE] = STAY
            return
        else:
            _begin_position_item(m, item, state, landed, params)
            return
    m[M_FINISHED] = 1.0


@compiled
def _heading_error(m: FloatArray, state: VehicleState) -> float:
    return abs(wrap_pi(m[M_YAW] - euler_from_quaternion(state.attitude).z))


@compiled
def _is_within(m: FloatArray, state: VehicleState, radius_m: float) -> bool:
    dx, dy = m[M_X] - state.position_ned_m.x, m[M_Y] - state.position_ned_m.y
    within: bool = dx * dx + dy * dy <= radius_m * radius_m
    return within


@compiled
def _is_at_height(m: FloatArray, state: VehicleState, params: GuidanceParams) -> bool:
    there: bool = abs(m[M_Z] - state.position_ned_m.z) <= params.altitude_acceptance_m
    return there


@compiled
def _is_reached(m: FloatArray, item: FloatArray, state: VehicleState, params: GuidanceParams) -> bool:
    """Tell whether the vehicle is at the item's position, and at its heading if the item gives one."""
    is_waypoint = item[COMMAND] == WAYPOINT
    radius = item[PARAM2] if is_waypoint and item[PARAM2] > 0.0 else params.acceptance_radius_m
    if not (_is_within(m, state, radius) and _is_at_height(m, state, params)):
        return False
    needs_heading = is_waypoint and not math.isnan(item[PARAM4])
    return not needs_heading or _heading_error(m, state) <= params.yaw_acceptance_rad


@compiled
def _is_turned(m: FloatArray, state: VehicleState, reference_yaw_rad: float, params: GuidanceParams) -> bool:
    """Tell whether a CONDITION_YAW is done: the vehicle looks there, and the reference has turned so far."""
    if m[M_YAW_IS_COUNTED] > 0.0 and abs(m[M_YAW] - reference_yaw_rad) > params.yaw_acceptance_rad:
        return False
    return _heading_error(m, state) <= params.yaw_acceptance_rad


@compiled
def _travel(
    m: FloatArray,
    item: FloatArray,
    state: VehicleState,
    reference_yaw_rad: float,
    landed: bool,
    params: GuidanceParams,
) -> None:
    command = item[COMMAND]
    following = m[M_CURRENT] + 1.0
    if command == CONDITION_YAW:  # a vehicle that stands cannot turn, and does so later
        if landed or _is_turned(m, state, reference_yaw_rad, params):
            _advance(m, following)
    elif command == TAKEOFF:
        if _is_at_height(m, state, params):
            m[M_PHASE] = STAY  # high enough: now over to the item's own position
    elif _is_reached(m, item, state, params):
        waits = item[PARAM1] > 0.0 and command in (WAYPOINT, LOITER_TIME)
        if waits or command == LAND:
            m[M_PHASE] = STAY
        else:
            _advance(m, following)


@compiled
def _stay(
    m: FloatArray, item: FloatArray, state: VehicleState, landed: bool, params: GuidanceParams, dt_s: float
) -> None:
    command = item[COMMAND]
    if command == LAND:
        done = landed
    elif command == TAKEOFF:
        done = _is_reached(m, item, state, params)
    else:
        m[M_TIMER] += dt_s
        done = m[M_TIMER] >= item[PARAM1] - 1e-9
    if done:
        _advance(m, m[M_CURRENT] + 1.0)


@compiled
def mission_step(
    m: FloatArray,
    plan: FloatArray,
    jumps_left: FloatArray,
    state: VehicleState,
    reference_yaw_rad: float,
    landed: bool,
    params: GuidanceParams,
    dt_s: float,
) -> None:
    """Advance the mission by one outer tick; ``reference_yaw_rad`` is the trajectory's present heading."""
    if m[M_FINISHED] > 0.0:
        return
    if m[M_PHASE] == RISE:
        if abs(m[M_RISE_Z] - state.position_ned_m.z) <= params.altitude_acceptance_m:
            m[M_PHASE] = TRAVEL
    elif m[M_PHASE] == TRAVEL:
        _travel(m, plan[int(m[M_CURRENT])], state, reference_yaw_rad, landed, params)
    elif m[M_PHASE] == STAY:
        _stay(m, plan[int(m[M_CURRENT])], state, landed, params, dt_s)
    if m[M_PHASE] == BEGIN:
        _begin(m, plan, jumps_left, state, reference_yaw_rad, landed, params)


@compiled
def mission_goal(
    m: FloatArray, plan: FloatArray, start_x: float, start_y: float, params: GuidanceParams
) -> Goal:
    """Return where the present item sends the vehicle; it began above ``start``."""
    x, y, z, climb = m[M_X], m[M_Y], m[M_Z], params.climb_speed_m_s
    index = int(m[M_CURRENT])
    if m[M_FINISHED] == 0.0 and index < plan.shape[0]:
        command = plan[index, COMMAND]
        if command == TAKEOFF:
            climb = params.takeoff_speed_m_s
            if m[M_PHASE] == TRAVEL:  # straight up first
                x, y = start_x, start_y
        elif m[M_PHASE] == RISE:
            x, y, z = m[M_RISE_X], m[M_RISE_Y], m[M_RISE_Z]
            climb = params.takeoff_speed_m_s
        elif command == LAND and m[M_PHASE] == STAY:
            z = params.far_below_m
    descent, counted = params.descent_speed_m_s, m[M_YAW_IS_COUNTED]
    return Goal(x, y, z, m[M_YAW], m[M_SPEED], climb, descent, m[M_YAW_RATE], counted)


@compiled
def into_ground(goal: Goal, down_m: float, params: GuidanceParams) -> Goal:
    """Return the goal with the descent of a landing if it is below the ground: the vehicle is now at ``down_m``.

    A landing's goal always is; so is a place whose ground is not where home or a plan says.
    """
    g = goal
    descent = landing_speed(down_m, params) if g.z > params.ground_down_m else g.descent_m_s
    return Goal(
        g.x, g.y, g.z, g.yaw_rad, g.speed_m_s, g.climb_m_s, descent, g.yaw_rate_rad_s, g.yaw_is_counted
    )


@compiled
def landing_speed(down_m: float, params: GuidanceParams) -> float:
    """Descent speed of a landing at ``down_m``: slower near the ground."""
    height_m = params.ground_down_m - down_m
    return params.descent_speed_m_s if height_m > params.land_slow_altitude_m else params.land_speed_m_s
