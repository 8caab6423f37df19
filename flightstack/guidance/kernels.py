"""Compiled guidance: one kernel for modes with goals, one for modes with streamed setpoints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from flightstack.core.array_items import as_tuple, store
from flightstack.core.arrays import (
    all_finite,
    attitude_target,
    position_setpoint,
    store_attitude_target,
    store_position_setpoint,
    vehicle_state,
)
from flightstack.core.compiled import compiled
from flightstack.core.contract import (
    AttitudeTarget,
    FloatArray,
    PositionSetpoint,
    Quaternion,
    Record,
    RecordArray,
    Vector3,
    VehicleState,
)
from flightstack.core.enums import Mode
from flightstack.core.geometry import blend, euler_from_quaternion, rotate
from flightstack.core.portable_math import sin_cos
from flightstack.guidance.follow import follow_horizontally
from flightstack.guidance.land_detector import DESCENT_M_S, LandMemory, land_detector_step, lift_share
from flightstack.guidance.manual import manual_step
from flightstack.guidance.mission import mission_goal, mission_step, with_landing_descent
from flightstack.guidance.mode_target import LAND, RETURN, advance_return, target_goal
from flightstack.guidance.offboard import attitude_step, point_step
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.setpoints import ATTITUDE, NOT_GIVEN
from flightstack.guidance.trajectory import Goal, Trajectory, TrajectoryLimits, setpoint_of, trajectory_step
from flightstack.params.vehicle import GRAVITY_M_S2

DESCEND, DESCEND_LEVEL = 64, 65
"""Numbers of the mode LAND without a position: the vehicle brakes, or without a velocity stays level and drifts."""
_NUMBERS = {mode: int(mode) for mode in Mode}
_WITHOUT_POSITION = _NUMBERS | {Mode.LAND: DESCEND, Mode.POSITION: int(Mode.ALTITUDE)}
_WITHOUT_VELOCITY = _WITHOUT_POSITION | {Mode.LAND: DESCEND_LEVEL}
MISSION, OFFBOARD, POSITION = int(Mode.MISSION), int(Mode.OFFBOARD), int(Mode.POSITION)

_STOP = Vector3(0.0, 0.0, 0.0)
TRAJECTORY_SIZE = 11
GUIDANCE_PARAMS_SIZE = len(GuidanceParams._fields)
LAND_MEMORY_SIZE = 4
LEAD_M = 0.5
"""Largest distance of the reference below a vehicle that does not sink."""
PRESS_1_S, PRESSED_LIFT = 7.0, 0.45
"""Downward acceleration setpoint of such a vehicle per missing sink rate, until the lift is this share of the weight.
It reduces the thrust independently of the gains: a vehicle in the air then sinks."""


class GoalArrays(NamedTuple):
    """Arguments of ``goal_kernel`` that are guidance's own: its state, plan and parameters."""

    trajectory: FloatArray
    """The reference."""
    mission: RecordArray
    plan: RecordArray
    jumps_left: FloatArray
    mode_target: RecordArray
    """Goal of the other modes."""
    land: FloatArray
    """Memory of the land detector."""
    params: FloatArray
    dt_s: float


def mode_numbers(position: bool, velocity: bool) -> Mapping[Mode, int]:
    """Return the numbers of the modes for the kernels, with or without a known position and velocity."""
    return _NUMBERS if position else _WITHOUT_POSITION if velocity else _WITHOUT_VELOCITY


@compiled
def _limits(params: GuidanceParams) -> TrajectoryLimits:
    return TrajectoryLimits(params.acceleration_m_s2, params.vertical_acceleration_m_s2, params.jerk_m_s3)


@compiled
def _limit_sink_lead(last: Trajectory, reference: Trajectory, state: VehicleState) -> Trajectory:
    """Return the reference, limited to ``LEAD_M`` below a vehicle that does not sink with it."""
    t = reference
    lowest_m = max(last.z, state.position_ned_m.z + LEAD_M)
    if t.z <= lowest_m or state.velocity_ned_m_s.z >= 0.5 * t.vz:
        return t
    return Trajectory(t.x, t.y, lowest_m, t.vx, t.vy, t.vz, t.ax, t.ay, t.az, t.yaw_rad, t.yaw_rate_rad_s)


@compiled
def _without_position(
    last: Trajectory,
    reference: Trajectory,
    state: VehicleState,
    brakes: bool,
    limits: TrajectoryLimits,
    dt_s: float,
) -> Trajectory:
    """Return the reference at the vehicle's horizontal position; it ``brakes``, or demands no tilt."""
    t, p, v = reference, state.position_ned_m, state.velocity_ned_m_s
    vx, vy, ax, ay = v.x, v.y, 0.0, 0.0
    if brakes:
        _, _, vx, vy, ax, ay = follow_horizontally(last, NOT_GIVEN, _STOP, NOT_GIVEN, 0.0, limits, dt_s)
    return Trajectory(p.x, p.y, t.z, vx, vy, t.vz, ax, ay, t.az, t.yaw_rad, t.yaw_rate_rad_s)


@compiled
def _press_m_s2(reference: Trajectory, state: VehicleState, spare_m_s2: float) -> float:
    """Return the downward acceleration to add, at most ``spare_m_s2``, for a vehicle behind a sinking reference."""
    lack_m_s = reference.vz - state.velocity_ned_m_s.z
    if reference.vz < DESCENT_M_S or lack_m_s <= 0.0:
        return 0.0
    near = 2.0 * (reference.z - state.position_ned_m.z) / LEAD_M - 1.0
    return min(max(near, 0.0), 1.0) * min(PRESS_1_S * lack_m_s, max(spare_m_s2, 0.0))


@compiled
def _press(
    reference: Trajectory, state: VehicleState, attitude: Quaternion, lift: float, last_press: Vector3
) -> Vector3:
    """Return the acceleration to add [m/s² NED]. It reduces the thrust and keeps the tilt.

    ``attitude`` and ``lift`` are the last target, which includes ``last_press``. Without the horizontal part, the
    tilt that holds the position in wind would double as the thrust is reduced.
    """
    lift_m_s2 = lift * GRAVITY_M_S2
    unpressed_m_s2 = lift_m_s2 + last_press.z
    down_m_s2 = _press_m_s2(reference, state, unpressed_m_s2 - PRESSED_LIFT * GRAVITY_M_S2)
    if down_m_s2 == 0.0:
        return Vector3(0.0, 0.0, 0.0)
    axis = rotate(attitude, Vector3(0.0, 0.0, -1.0))
    along = max(lift_m_s2, 0.5 * GRAVITY_M_S2) / max(-axis.z, 0.5)
    share = down_m_s2 / max(unpressed_m_s2, 0.5 * GRAVITY_M_S2)
    return Vector3(
        -share * (axis.x * along - last_press.x), -share * (axis.y * along - last_press.y), down_m_s2
    )


@compiled
def _finish(
    last: Trajectory,
    reference: Trajectory,
    state: VehicleState,
    trajectory: FloatArray,
    land: FloatArray,
    last_target: FloatArray,
    rotor_thrust_n: float,
    params: GuidanceParams,
    descent_m_s: float,
    dt_s: float,
    setpoint: FloatArray,
) -> None:
    """Store reference and setpoint, and advance the land detector."""
    target = attitude_target(last_target)
    lift = lift_share(state, target.thrust_n, params.weight_n)
    last_a = position_setpoint(setpoint).acceleration_ned_m_s2
    last_press = Vector3(last_a.x - last.ax, last_a.y - last.ay, last_a.z - last.az)
    store(trajectory, reference)
    p, v, a, yaw_rad, yaw_rate_rad_s = setpoint_of(reference)
    press = _press(reference, state, target.attitude, lift, last_press)
    pressed = Vector3(a.x + press.x, a.y + press.y, a.z + press.z)
    store_position_setpoint(setpoint, PositionSetpoint(p, v, pressed, yaw_rad, yaw_rate_rad_s))
    memory = LandMemory(*as_tuple(land, LAND_MEMORY_SIZE))
    rotor_lift = lift_share(state, rotor_thrust_n, params.weight_n)
    store(land, land_detector_step(memory, state, lift, rotor_lift, descent_m_s, dt_s))


@compiled
def rest_kernel(
    state_array: FloatArray, trajectory: FloatArray, land: FloatArray, setpoint: FloatArray
) -> None:
    """Set reference and setpoint to the vehicle's position, at rest, landed; ignore a state that is not finite."""
    if not all_finite(state_array):
        return
    state = vehicle_state(state_array)
    p = state.position_ned_m
    yaw_rad = euler_from_quaternion(state.attitude).z
    rest = Trajectory(p.x, p.y, p.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, yaw_rad, 0.0)
    store(trajectory, rest)
    store(land, LandMemory(1.0, 0.0, 0.0, p.z))
    store_position_setpoint(setpoint, setpoint_of(rest))


@compiled
def levelling_kernel(last: FloatArray, thrust_n: float, fraction: float, target: FloatArray) -> None:
    """Write the attitude target, shape (5,), interpolated by ``fraction`` from ``last`` to level, with this thrust."""
    q = attitude_target(last).attitude
    sine, cosine = sin_cos(0.5 * euler_from_quaternion(q).z)
    store_attitude_target(
        target, AttitudeTarget(blend(q, Quaternion(cosine, 0.0, 0.0, sine), fraction), thrust_n)
    )


@compiled
def _goal(mode: int, mission: Record, plan: RecordArray, mode_target: Record, params: GuidanceParams) -> Goal:
    """Return the goal of the mission or of another mode."""
    if mode == MISSION:
        return mission_goal(mission, plan, mode_target["start_x"], mode_target["start_y"], params)
    return target_goal(LAND if mode >= DESCEND else mode, mode_target, params)


@compiled
def goal_kernel(
    mode: int,
    state_array: FloatArray,
    trajectory: FloatArray,
    mission: RecordArray,
    plan: RecordArray,
    jumps_left: FloatArray,
    mode_target: RecordArray,
    land: FloatArray,
    last_target: FloatArray,
    rotor_thrust_n: float,
    params_array: FloatArray,
    dt_s: float,
    setpoint: FloatArray,
) -> None:
    """Advance guidance by one outer tick; write the setpoint (11,) and update the memories in place.

    ``rotor_thrust_n`` is the thrust of the rotors by their speeds.
    A state that is not finite changes nothing: the loops hold their output and set a status bit.
    """
    if not all_finite(state_array):
        return
    state = vehicle_state(state_array)
    params = GuidanceParams(*as_tuple(params_array, GUIDANCE_PARAMS_SIZE))
    last = Trajectory(*as_tuple(trajectory, TRAJECTORY_SIZE))
    landed = LandMemory(*as_tuple(land, LAND_MEMORY_SIZE)).landed > 0.0
    m, a = mission[0], mode_target[0]
    if mode == MISSION:
        mission_step(m, plan, jumps_left, state, last.yaw_rad, landed, params, dt_s)
    elif mode == RETURN:
        advance_return(a, state, params)
    goal = with_landing_descent(_goal(mode, m, plan, a, params), state.position_ned_m.z, params)
    reference = _limit_sink_lead(last, trajectory_step(last, goal, _limits(params), dt_s), state)
    if mode >= DESCEND:
        reference = _without_position(last, reference, state, mode == DESCEND, _limits(params), dt_s)
    _finish(
        last, reference, state, trajectory, land, last_target, rotor_thrust_n, params, reference.vz, dt_s, setpoint
    )  # fmt: skip


@compiled
def stream_kernel(
    mode: int,
    state_array: FloatArray,
    trajectory: FloatArray,
    stream: RecordArray,
    land: FloatArray,
    last_target: FloatArray,
    rotor_thrust_n: float,
    params_array: FloatArray,
    dt_s: float,
    setpoint: FloatArray,
    target: FloatArray,
) -> None:
    """Like ``goal_kernel``, for OFFBOARD, POSITION and ALTITUDE; ``stream`` is the record of ``setpoints``.

    An offboard attitude or rate is written to ``target`` (5,), which the loops use instead of the outer loop's.
    """
    if not all_finite(state_array):
        return
    state = vehicle_state(state_array)
    params = GuidanceParams(*as_tuple(params_array, GUIDANCE_PARAMS_SIZE))
    last, limits = Trajectory(*as_tuple(trajectory, TRAJECTORY_SIZE)), _limits(params)
    s = stream[0]
    if mode == OFFBOARD and s["kind"] >= ATTITUDE:
        reference = attitude_step(s, last_target, state, params, limits, dt_s, target)
        descent_m_s = math.inf
    else:
        if mode == OFFBOARD:
            reference = point_step(last, s, state, params, limits, dt_s)
        else:
            reference = manual_step(last, s["sticks"], state, mode == POSITION, params, limits, dt_s)
        reference = _limit_sink_lead(last, reference, state)
        descent_m_s = reference.vz
    _finish(
        last, reference, state, trajectory, land, last_target, rotor_thrust_n, params, descent_m_s, dt_s, setpoint
    )  # fmt: skip
