"""Guidance: from the mode to the setpoint of the outer loop, in one compiled kernel per outer tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flightstack.arrays import store_position_setpoint, vehicle_state
from flightstack.compiled import as_tuple, compiled, store
from flightstack.contract import SETPOINT_SIZE, FloatArray, VehicleState
from flightstack.geometry import euler_from_quaternion
from flightstack.guidance.land_detector import LandMemory, land_detector_step
from flightstack.guidance.mission import (
    COMMAND,
    CONDITION_YAW,
    LOG_SIZE,
    M_CURRENT,
    M_FINISHED,
    M_LOG,
    M_LOG_COUNT,
    M_REACHED,
    M_SPEED,
    M_WANTS_RETURN,
    M_X,
    M_Y,
    M_YAW,
    M_YAW_IS_SET,
    M_Z,
    MISSION_MEMORY_SIZE,
    NAV_DELAY,
    PLAN_COLUMNS,
    landing_speed,
    mission_goal,
    mission_start,
    mission_step,
)
from flightstack.guidance.mission import LAND as LAND_ITEM
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.trajectory import (
    BRAKING,
    Goal,
    Trajectory,
    TrajectoryLimits,
    setpoint_of,
    trajectory_step,
)
from flightstack.modes import Mode

TAKEOFF, MISSION, RETURN, LAND = int(Mode.TAKEOFF), int(Mode.MISSION), int(Mode.RETURN), int(Mode.LAND)

TRAJECTORY_SIZE = 11
T_YAW = 9
GUIDANCE_PARAMS_SIZE = len(GuidanceParams._fields)
LAND_MEMORY_SIZE = 3
# the target of every mode but the mission: position, heading, and the phase of a return
A_X, A_Y, A_Z, A_YAW, A_PHASE, A_START_X, A_START_Y = range(7)
AIM_SIZE = 7
CLIMBING, CRUISING, DESCENDING = 0.0, 1.0, 2.0
THRUST_AT = 4  # of the attitude target's array form


@compiled
def _advance_return(aim: FloatArray, state: VehicleState, params: GuidanceParams) -> None:
    """Return: climb, go home, descend."""
    p = state.position_ned_m
    if aim[A_PHASE] == CLIMBING and abs(p.z - aim[A_Z]) <= params.altitude_acceptance_m:
        aim[A_PHASE] = CRUISING
        aim[A_X], aim[A_Y] = 0.0, 0.0
    elif aim[A_PHASE] == CRUISING and p.x * p.x + p.y * p.y <= params.acceptance_radius_m**2:
        aim[A_PHASE] = DESCENDING


@compiled
def _mode_goal(mode: int, aim: FloatArray, state: VehicleState, params: GuidanceParams) -> Goal:
    z, climb, descent = aim[A_Z], params.climb_speed_m_s, params.descent_speed_m_s
    if mode == TAKEOFF:
        climb = params.takeoff_speed_m_s
    elif mode == LAND or (mode == RETURN and aim[A_PHASE] == DESCENDING):
        z = params.far_below_m
        descent = landing_speed(state.position_ned_m.z, params)
    return Goal(
        aim[A_X], aim[A_Y], z, aim[A_YAW], params.cruise_speed_m_s, climb, descent, params.yaw_rate_rad_s, 0.0
    )


@compiled
def guidance_kernel(
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
        goal = mission_goal(mission, plan, aim[A_START_X], aim[A_START_Y], state.position_ned_m.z, params)
    else:
        if mode == RETURN:
            _advance_return(aim, state, params)
        goal = _mode_goal(mode, aim, state, params)
    limits = TrajectoryLimits(params.acceleration_m_s2, params.vertical_acceleration_m_s2, params.jerk_m_s3)
    reference = trajectory_step(Trajectory(*as_tuple(trajectory, TRAJECTORY_SIZE)), goal, limits, dt_s)
    store(trajectory, reference)
    store_position_setpoint(setpoint, setpoint_of(reference))
    descending = reference.vz > 0.1
    memory = LandMemory(*as_tuple(land, LAND_MEMORY_SIZE))
    store(
        land, land_detector_step(memory, state, attitude_target[THRUST_AT], params.weight_n, descending, dt_s)
    )


class MissionProgress(NamedTuple):
    """What the rest of the stack needs to know of the mission."""

    current: int
    reached: int
    finished: bool
    wants_return: bool


class Navigator:
    """Holds the memories of guidance and enters modes. No I/O, no clock."""

    def __init__(self, params: GuidanceParams, outer_hz: float) -> None:
        self._params_array = np.array(params, dtype=np.float64)
        self.params = params
        self._dt_s = 1.0 / outer_hz
        self.setpoint = np.zeros(SETPOINT_SIZE)
        self._trajectory = np.zeros(TRAJECTORY_SIZE)
        self._mission = np.zeros(MISSION_MEMORY_SIZE)
        self._reported = 0
        self._aim = np.zeros(AIM_SIZE)
        self._land = np.array(LandMemory(1.0, 0.0, 0.0))
        self._plan = np.zeros((0, PLAN_COLUMNS))
        self._jumps_left = np.zeros(0)
        self.set_plan(self._plan, self._jumps_left)

    @property
    def landed(self) -> bool:
        """Whether the vehicle stands on the ground."""
        return bool(self._land[0] > 0.0)

    @property
    def progress(self) -> MissionProgress:
        """Progress of the mission."""
        m = self._mission
        return MissionProgress(
            int(m[M_CURRENT]), int(m[M_REACHED]), bool(m[M_FINISHED]), bool(m[M_WANTS_RETURN])
        )

    @property
    def mission_flies(self) -> bool:
        """Whether the current item needs the vehicle in the air; a standing one waits for the others."""
        current = int(self._mission[M_CURRENT])
        if self._mission[M_FINISHED] > 0.0 or current >= len(self._plan):
            return False
        return self._plan[current, COMMAND] not in (LAND_ITEM, NAV_DELAY, CONDITION_YAW)

    def reached_items(self) -> list[int]:
        """Return the items reached since the last call, in order."""
        count = int(self._mission[M_LOG_COUNT])
        fresh = range(max(self._reported, count - LOG_SIZE), count)
        self._reported = count
        return [int(self._mission[M_LOG + index % LOG_SIZE]) for index in fresh]

    def set_plan(self, plan: FloatArray, jumps: FloatArray) -> None:
        """Take a new plan, to be flown from its first item; ``jumps`` are the repeats of its DO_JUMPs."""
        self._plan = np.ascontiguousarray(plan)
        self._jumps = np.ascontiguousarray(jumps)
        self.restart_plan()

    def restart_plan(self) -> None:
        """Make the first item the current one and restore the repeats of the jumps."""
        self._jumps_left = self._jumps.copy()
        self.set_current(0)

    def set_current(self, index: int) -> None:
        """Make ``index`` the mission's current item."""
        t = self._trajectory
        mission_start(self._mission, float(index), t[0], t[1], t[2], t[T_YAW], self.params)
        self._aim[A_START_X], self._aim[A_START_Y] = t[0], t[1]

    def rest_at(self, state: FloatArray) -> None:
        """Put the reference at the vehicle's position, at rest: before it leaves the ground."""
        self._trajectory[:] = 0.0
        self._trajectory[:3] = state[:3]
        self._trajectory[T_YAW] = euler_from_quaternion(vehicle_state(state).attitude).z
        self._land[:] = (1.0, 0.0, state[2])
        store_position_setpoint(self.setpoint, setpoint_of(Trajectory(*self._trajectory.tolist())))

    def enter(self, mode: Mode, takeoff_altitude_m: float = 0.0) -> None:
        """Aim for ``mode`` from where the reference is now."""
        t, aim, p = self._trajectory, self._aim, self.params
        aim[A_X], aim[A_Y], aim[A_Z], aim[A_YAW] = t[0], t[1], t[2], t[T_YAW]
        if mode == Mode.TAKEOFF:
            aim[A_Z] = -takeoff_altitude_m
        elif mode == Mode.HOLD:  # where the reference comes to rest
            speed = float(np.hypot(t[3], t[4]))
            ahead_s = speed / (2.0 * BRAKING * p.acceleration_m_s2)
            aim[A_X], aim[A_Y] = t[0] + t[3] * ahead_s, t[1] + t[4] * ahead_s
            aim[A_Z] = t[2] + t[5] * abs(t[5]) / (2.0 * BRAKING * p.vertical_acceleration_m_s2)
        elif mode == Mode.RETURN:
            aim[A_PHASE] = CLIMBING
            if np.hypot(t[0], t[1]) > p.return_min_distance_m:
                aim[A_Z] = min(t[2], -p.return_altitude_m)
        elif mode == Mode.MISSION:
            self._enter_mission()

    def _enter_mission(self) -> None:
        """Begin the current item anew from here, at the speed and with the heading set by those before it.

        A finished mission begins with its first item.
        """
        m = self._mission
        if m[M_FINISHED] > 0.0:
            self.restart_plan()
            return
        reached, speed, yaw_is_set, yaw = m[M_REACHED], m[M_SPEED], m[M_YAW_IS_SET], m[M_YAW]
        self.set_current(int(m[M_CURRENT]))
        m[M_REACHED], m[M_SPEED], m[M_YAW_IS_SET] = reached, speed, yaw_is_set
        if yaw_is_set > 0.0:
            m[M_YAW] = yaw

    def hold_at_last_item(self) -> None:
        """Hold where the mission that has just ended was going to; a takeoff's goal needs no such step."""
        m = self._mission
        self._aim[A_X], self._aim[A_Y], self._aim[A_Z], self._aim[A_YAW] = m[M_X], m[M_Y], m[M_Z], m[M_YAW]

    def step(self, mode: Mode, state: FloatArray, attitude_target: FloatArray) -> None:
        """Advance by one outer tick and write ``setpoint``."""
        guidance_kernel(
            int(mode), state, self._trajectory, self._mission, self._plan, self._jumps_left, self._aim,
            self._land, attitude_target, self._params_array, self._dt_s, self.setpoint,
        )  # fmt: skip
