"""Position and altitude control: the outer loop, from a position setpoint to attitude and thrust."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.control.control_law import ControlLaw
from flightstack.core.compiled import compiled
from flightstack.core.contract import AttitudeTarget, PositionSetpoint, Quaternion, VehicleState
from flightstack.core.portable_math import sin_cos, tan
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle


class PositionMemory(NamedTuple):
    """Integral of the position error, as acceleration [m/s²], NED."""

    x: float
    y: float
    z: float


class PositionParams(NamedTuple):
    """Gains in acceleration per error (1/s², 1/s³, 1/s) and limits."""

    kp_xy: float
    ki_xy: float
    kd_xy: float
    kp_z: float
    ki_z: float
    kd_z: float
    mass_kg: float
    gravity_m_s2: float
    min_thrust_n: float
    max_thrust_n: float
    max_tilt_rad: float
    max_integral_m_s2: float


POSITION_TUNABLES = (
    Tunable("kp_xy", "POS_XY_P", 0.0, 1e3, "1/s^2", "Horizontal acceleration per position error"),
    Tunable("ki_xy", "POS_XY_I", 0.0, 1e3, "1/s^3", "Horizontal acceleration per integral of the position error"),
    Tunable("kd_xy", "POS_XY_D", 0.0, 1e3, "1/s", "Horizontal acceleration per velocity error"),
    Tunable("kp_z", "POS_Z_P", 0.0, 1e3, "1/s^2", "Vertical acceleration per altitude error"),
    Tunable("ki_z", "POS_Z_I", 0.0, 1e3, "1/s^3", "Vertical acceleration per integral of the altitude error"),
    Tunable("kd_z", "POS_Z_D", 0.0, 1e3, "1/s", "Vertical acceleration per climb rate error"),
    Tunable("max_integral_m_s2", "POS_I_MAX", 0.0, 20.0, "m/s^2", "Largest acceleration by an integral, per axis"),
    Tunable(
        "max_thrust_n", "POS_THR_MAX", 0.0, 1e3, "N", "Largest thrust that the position loop asks for",
        at_least="POS_THR_MIN",
    ),
    Tunable("min_thrust_n", "POS_THR_MIN", 0.0, 1e3, "N", "Least thrust that the position loop asks for"),
)  # fmt: skip
"""Tunable fields of ``PositionParams``; the largest tilt is MPC_TILTMAX_AIR, in degrees."""


@compiled
def _horizontal_demand(
    memory: PositionMemory, state: VehicleState, setpoint: PositionSetpoint, params: PositionParams
) -> tuple[float, float]:
    p, v = state.position_ned_m, state.velocity_ned_m_s
    p_d, v_d, a_d = setpoint.position_ned_m, setpoint.velocity_ned_m_s, setpoint.acceleration_ned_m_s2
    north = a_d.x + params.kp_xy * (p_d.x - p.x) + params.kd_xy * (v_d.x - v.x) + memory.x
    east = a_d.y + params.kp_xy * (p_d.y - p.y) + params.kd_xy * (v_d.y - v.y) + memory.y
    return north, east


@compiled
def _lift_demand(
    memory: PositionMemory, state: VehicleState, setpoint: PositionSetpoint, params: PositionParams
) -> float:
    """Return the upward specific force [m/s²]."""
    error_z = setpoint.position_ned_m.z - state.position_ned_m.z
    down = (
        setpoint.acceleration_ned_m_s2.z
        + params.kp_z * error_z
        + params.kd_z * (setpoint.velocity_ned_m_s.z - state.velocity_ned_m_s.z)
        + memory.z
    )
    return params.gravity_m_s2 - down


@compiled
def _bounded(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


@compiled
def position_pid_step(
    memory: PositionMemory,
    state: VehicleState,
    setpoint: PositionSetpoint,
    params: PositionParams,
    dt_s: float,
    thrust_saturation: float = 0.0,
) -> tuple[PositionMemory, AttitudeTarget]:
    """Return the attitude and the thrust that track the setpoint.

    PID on position in NED with feed-forward; the desired specific force f = a − g is converted to roll and
    pitch by inverting eq. 7 (NED signs corrected): θ = atan2(−f_x', −f_z), φ = atan2(f_y', √(f_x'² + f_z²)),
    f' in the frame rotated by the yaw setpoint. Thrust is compensated for the present tilt. Integrators hold while
    tilt or thrust is at its limit, or while the mixer is saturated in thrust (``thrust_saturation``: the last
    tick achieved more (−1) or less (+1) than demanded).
    """
    north, east = _horizontal_demand(memory, state, setpoint, params)
    error_z = setpoint.position_ned_m.z - state.position_ned_m.z
    lift = _lift_demand(memory, state, setpoint, params)
    most, least = params.max_thrust_n / params.mass_kg, params.min_thrust_n / params.mass_kg
    # the vertical integrator holds only in the direction of saturation, here or in the mixer
    at_top = lift >= most or thrust_saturation > 0.0
    at_bottom = lift <= least or thrust_saturation < 0.0
    vertical_free = not (at_top and error_z < 0.0) and not (at_bottom and error_z > 0.0)
    lift = min(max(lift, least), most)
    tilt_force = tan(params.max_tilt_rad) * max(lift, 0.5 * params.gravity_m_s2)
    demand = math.sqrt(north * north + east * east)
    horizontal_free = demand <= tilt_force
    if not horizontal_free:
        north, east = north * tilt_force / demand, east * tilt_force / demand
    target = _target_for(north, east, lift, setpoint.yaw_rad, state, params)
    limit, gain_xy = params.max_integral_m_s2, params.ki_xy * dt_s if horizontal_free else 0.0
    error = setpoint.position_ned_m
    memory = PositionMemory(
        _bounded(memory.x + gain_xy * (error.x - state.position_ned_m.x), limit),
        _bounded(memory.y + gain_xy * (error.y - state.position_ned_m.y), limit),
        _bounded(memory.z + (params.ki_z * dt_s * error_z if vertical_free else 0.0), limit),
    )
    return memory, target


@compiled
def _attitude_along(
    forward: float, right: float, upward: float, half_yaw_sine: float, half_yaw_cosine: float
) -> Quaternion:
    """Return the attitude with this yaw whose thrust axis is along (forward, right, upward), ``upward`` positive.

    With θ = atan2(−forward, upward) and φ = atan2(right, level), level = √(forward² + upward²), the tangents of the
    half angles are −forward / (level + upward) and right / (whole + level), without cancellation. One common scale
    converts them to sines and cosines.
    """
    level_square = forward * forward + upward * upward
    level, whole = math.sqrt(level_square), math.sqrt(right * right + level_square)
    along, across = level + upward, whole + level
    scale = 0.5 / (math.sqrt(level * along) * math.sqrt(whole * across))
    scaled_across, scaled_right = across * scale, right * scale
    cos_cos, cos_sin = scaled_across * along, -forward * scaled_across  # of half roll, half pitch
    sin_cos_, sin_sin = scaled_right * along, -forward * scaled_right
    return Quaternion(
        cos_cos * half_yaw_cosine + sin_sin * half_yaw_sine,
        sin_cos_ * half_yaw_cosine - cos_sin * half_yaw_sine,
        cos_sin * half_yaw_cosine + sin_cos_ * half_yaw_sine,
        cos_cos * half_yaw_sine - sin_sin * half_yaw_cosine,
    )


@compiled
def _target_for(
    north: float, east: float, lift: float, yaw_rad: float, state: VehicleState, params: PositionParams
) -> AttitudeTarget:
    # below half the weight, the thrust direction of a falling vehicle is ill-conditioned: bound it
    upward = max(lift, 0.5 * params.gravity_m_s2)
    half_sine, half_cosine = sin_cos(0.5 * yaw_rad)
    cos_yaw, sin_yaw = half_cosine * half_cosine - half_sine * half_sine, 2.0 * half_sine * half_cosine
    forward, right = cos_yaw * north + sin_yaw * east, cos_yaw * east - sin_yaw * north
    q = state.attitude
    cos_tilt = 1.0 - 2.0 * (q.x * q.x + q.y * q.y)
    thrust = params.mass_kg * lift / max(cos_tilt, 0.5)
    thrust = min(max(thrust, params.min_thrust_n), params.max_thrust_n)
    return AttitudeTarget(_attitude_along(forward, right, upward, half_sine, half_cosine), thrust)


def read_position_params(vehicle: Vehicle, gains: Table, max_tilt_rad: float) -> PositionParams:
    """Read ``[position]`` and ``[altitude]``.

    Horizontal gains are accelerations per error (1/s², 1/s³, 1/s). ``[altitude] convention = "paper"`` means ΣΩ² per
    metre, converted to acceleration by b/m; ``"acceleration"`` uses the same units as the horizontal gains.
    """
    position, altitude = gains.table("position"), gains.table("altitude")
    scale = 1.0
    if altitude.choice("convention", ("acceleration", "paper")) == "paper":
        scale = vehicle.rotors[0].thrust_coefficient_n_s2 / vehicle.mass_kg
    highest = 1e7
    params = PositionParams(
        kp_xy=position.number("kp", 0.0, 1e3),
        ki_xy=position.number("ki", 0.0, 1e3),
        kd_xy=position.number("kd", 0.0, 1e3),
        kp_z=altitude.number("kp", 0.0, highest) * scale,
        ki_z=altitude.number("ki", 0.0, highest) * scale,
        kd_z=altitude.number("kd", 0.0, highest) * scale,
        mass_kg=vehicle.mass_kg,
        gravity_m_s2=GRAVITY_M_S2,
        min_thrust_n=0.08 * vehicle.weight_n,
        max_thrust_n=10.0 * vehicle.weight_n if vehicle.ideal_rotors else 0.95 * vehicle.max_thrust_n,
        max_tilt_rad=max_tilt_rad,
        max_integral_m_s2=position.number("max_integral_m_s2", 0.0, 20.0),
    )
    position.finish()
    altitude.finish()
    return params


POSITION_PID = ControlLaw(
    "pid",
    position_pid_step,
    PositionMemory,
    PositionParams,
    (0.0, 0.0, 0.0),
    lambda vehicle, gains: read_position_params(vehicle, gains, 0.0),
    POSITION_TUNABLES,
)
"""Reads the whole gains file; the largest tilt is set afterwards, from MPC_TILTMAX_AIR."""
