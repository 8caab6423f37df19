"""Guidance compiled: one kernel for the modes that fly to goals, one for those that follow a stream."""

from __future__ import annotations

import numpy as np

from flightstack.arrays import store_position_setpoint, vehicle_state
from flightstack.compiled import as_tuple, compiled, store
from flightstack.contract import FloatArray, VehicleState
from flightstack.guidance.aim import A_START_X, A_START_Y, RETURN, advance_return, aim_goal
from flightstack.guidance.land_detector import LandMemory, land_detector_step
from flightstack.guidance.manual import manual_step
from flightstack.guidance.mission import into_ground, mission_goal, mission_step
from flightstack.guidance.offboard import attitude_step, point_step
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.setpoints import ATTITUDE, S_KIND
from flightstack.guidance.trajectory import Trajectory, TrajectoryLimits, setpoint_of, trajectory_step
from flightstack.modes import Mode

MISSION, OFFBOARD, POSITION = int(Mode.MISSION), int(Mode.OFFBOARD), int(Mode.POSITION)

TRAJECTORY_SIZE = 11
T_YAW = 9
GUIDANCE_PARAMS_SIZE = len(GuidanceParams._fields)
LAND_MEMORY_SIZE = 3
THRUST_AT = 4  # of the attitude target's array form


@compiled
def _limits(params: GuidanceParams) -> TrajectoryLimits:
    return TrajectoryLimits(params.acceleration_m_s2, params.vertical_acceleration_m_s2, params.jerk_m_s3)


@compiled
def _finish(
    reference: Trajectory,
    descending: bool,
    state: VehicleState,
    trajectory: FloatArray,
    land: FloatArray,
    thrust_n: float,
    params: GuidanceParams,
    dt_s: float,
    setpoint: FloatArray,
) -> None:
    """Keep the reference, write the setpoint, and let the land detector see both."""
    store(trajectory, reference)
    store_position_setpoint(setpoint, setpoint_of(reference))
    memory = LandMemory(*as_tuple(land, LAND_MEMORY_SIZE))
    store(land, land_detector_step(memory, state, thrust_n, params.weight_n, descending, dt_s))


@compiled
def goal_kernel(
    mode: int,
    state_array: FloatArray,
    trajectory: FloatArray,
    mission: FloatArray,
    plan: FloatArray,
    jumps_left: FloatArray,
    aim: FloatArray,
    land: FloatArray,
    attitude_target: FloatArray,
    params_array: FloatArray,
    dt_s: float,
    setpoint: FloatArray,
) -> None:
    """Advance guidance by one outer tick; write the setpoint (11,) and update the memories in place.

    Nothing moves while the state is not finite: the loops then hold their output and set a status bit.
    """
    for value in state_array:
        if not np.isfinite(value):
            return
    state = vehicle_state(state_array)
    params = GuidanceParams(*as_tuple(params_array, GUIDANCE_PARAMS_SIZE))
    if mode == MISSION:
        mission_step(mission, plan, jumps_left, state, trajectory[T_YAW], land[0] > 0.0, params, dt_s)
        goal = mission_goal(mission, plan, aim[A_START_X], aim[A_START_Y], params)
    else:
        if mode == RETURN:
            advance_return(aim, state, params)
        goal = aim_goal(mode, aim, params)
    goal = into_ground(goal, state.position_ned_m.z, params)
    last = Trajectory(*as_tuple(trajectory, TRAJECTORY_SIZE))
    reference = trajectory_step(last, goal, _limits(params), dt_s)
    thrust_n = attitude_target[THRUST_AT]
    _finish(reference, reference.vz > 0.1, state, trajectory, land, thrust_n, params, dt_s, setpoint)


@compiled
def stream_kernel(
    mode: int,
    state_array: FloatArray,
    trajectory: FloatArray,
    stream: FloatArray,
    land: FloatArray,
    attitude_target: FloatArray,
    params_array: FloatArray,
    dt_s: float,
    setpoint: FloatArray,
    target: FloatArray,
) -> None:
    """As ``goal_kernel``, for OFFBOARD, POSITION and ALTITUDE; ``stream`` is what was received (``setpoints``).

    An offboard attitude or rate goes to ``target`` (5,), which the loops take in place of the outer loop's.
    """
    for value in state_array:
        if not np.isfinite(value):
            return
    state = vehicle_state(state_array)
    params = GuidanceParams(*as_tuple(params_array, GUIDANCE_PARAMS_SIZE))
    last, limits = Trajectory(*as_tuple(trajectory, TRAJECTORY_SIZE)), _limits(params)
    thrust_n = attitude_target[THRUST_AT]
    if mode != OFFBOARD:
        reference = manual_step(last, stream, state, mode == POSITION, params, limits, dt_s)
        descending = reference.vz > 0.1
    elif stream[S_KIND] >= ATTITUDE:
        reference = attitude_step(stream, attitude_target, state, params, limits, dt_s, target)
        descending = True  # little thrust, and yet no motion: on the ground
    else:
        reference = point_step(last, stream, state, params, limits, dt_s)
        descending = reference.vz > 0.1
    _finish(reference, descending, state, trajectory, land, thrust_n, params, dt_s, setpoint)
