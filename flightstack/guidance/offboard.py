"""Offboard guidance: streamed trajectory points, or attitudes and body rates with thrust."""

from __future__ import annotations

import math

from flightstack.core.arrays import attitude_target, store_attitude_target
from flightstack.core.compiled import compiled
from flightstack.core.contract import AttitudeTarget, FloatArray, Quaternion, Record, Vector3, VehicleState
from flightstack.core.geometry import (
    conjugate,
    euler_from_quaternion,
    normalised,
    quaternion_product,
    rotate,
    rotation_over,
    rotation_vector,
)
from flightstack.guidance.follow import follow_heading, follow_horizontally, follow_vertically, leashed
from flightstack.guidance.land_detector import CLIMB_M
from flightstack.guidance.params import GuidanceParams
from flightstack.guidance.setpoints import ATTITUDE, POINT
from flightstack.guidance.trajectory import Trajectory, TrajectoryLimits, approach_speed, clipped
from flightstack.params.vehicle import GRAVITY_M_S2

EXTRAPOLATION_S = 0.25
"""Time for which a moving point is extrapolated until the next one, so that a stream of 4 Hz is smooth."""
SPEED_LAG_S = 0.5
"""Delay of reference and vehicle in a descent that slows down, caused by limits of acceleration and jerk."""
RATE_LEAD_RAD = 0.5
"""Largest angle between the vehicle and an attitude integrated from body rates, so that the vehicle can follow."""


def wants_to_rise(stream: Record, down_m: float, weight_n: float) -> bool:
    """Return True if the newest setpoint commands a takeoff of a vehicle landed at ``down_m``; not compiled."""
    s = stream
    if s["kind"] >= ATTITUDE:
        return bool(s["thrust"] > 0.5 * weight_n)
    if s["kind"] != POINT:
        return False
    z, vz, az = (float(s[name][2]) for name in ("position", "velocity", "acceleration"))
    if math.isfinite(z):
        return z < down_m - CLIMB_M
    return vz < 0.0 if math.isfinite(vz) else az < 0.0


@compiled
def _or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0


@compiled
def _vector(v: FloatArray) -> Vector3:
    return Vector3(v[0], v[1], v[2])


@compiled
def _moved(position: float, velocity: float, acceleration: float, age_s: float) -> float:
    return position + age_s * (_or_zero(velocity) + 0.5 * age_s * _or_zero(acceleration))


@compiled
def descent_above(height_m: float, params: GuidanceParams, limits: TrajectoryLimits) -> float:
    """Return the largest descent speed at a height from which the vehicle can still brake to the landing speed."""
    spare = approach_speed(max(height_m, 0.0), params.descent_speed_m_s, limits.vertical_acceleration_m_s2)
    return min(params.descent_speed_m_s, params.land_speed_m_s + spare)


@compiled
def point_step(
    t: Trajectory,
    stream: Record,
    state: VehicleState,
    params: GuidanceParams,
    limits: TrajectoryLimits,
    dt_s: float,
) -> Trajectory:
    """Move the reference by one outer tick along the newest point; without a point it brakes and holds."""
    p, v, a = _vector(stream["position"]), _vector(stream["velocity"]), _vector(stream["acceleration"])
    yaw_wanted, turn = stream["yaw"], stream["yaw_rate"]
    if stream["kind"] != POINT:
        none = math.nan
        p, v, a = Vector3(none, none, none), Vector3(0.0, 0.0, 0.0), Vector3(none, none, none)
        yaw_wanted, turn = none, none
    age_s = stream["age"]
    stream["age"] = min(age_s + dt_s, EXTRAPOLATION_S)
    p = Vector3(_moved(p.x, v.x, a.x, age_s), _moved(p.y, v.y, a.y, age_s), _moved(p.z, v.z, a.z, age_s))
    here = state.position_ned_m
    x, y, vx, vy, ax, ay = follow_horizontally(t, p, v, a, params.max_speed_m_s, limits, dt_s)
    height = params.ground_down_m - (here.z + SPEED_LAG_S * t.vz)
    descent = descent_above(height, params, limits)
    z, vz, az = follow_vertically(t, p.z, v.z, a.z, params.climb_speed_m_s, descent, limits, dt_s)
    if not (math.isfinite(p.x) and math.isfinite(p.y)):
        x, y = leashed(x, here.x), leashed(y, here.y)
    if not math.isfinite(p.z):
        z = leashed(z, here.z)
    present_yaw = euler_from_quaternion(state.attitude).z
    yaw, yaw_rate = follow_heading(t, yaw_wanted, turn, params.yaw_rate_rad_s, present_yaw, dt_s)
    return Trajectory(x, y, z, vx, vy, vz, ax, ay, az, yaw, yaw_rate)


@compiled
def _turned(target: Quaternion, rates: Vector3, present: Quaternion, dt_s: float) -> Quaternion:
    """Rotate the attitude target by body rates, at most ``RATE_LEAD_RAD`` from the present attitude."""
    turned = normalised(quaternion_product(target, rotation_over(rates, dt_s)))
    lead = rotation_vector(quaternion_product(conjugate(present), turned))
    angle = math.sqrt(lead.x * lead.x + lead.y * lead.y + lead.z * lead.z)
    if angle <= RATE_LEAD_RAD:
        return turned
    if not math.isfinite(angle):  # the target is not finite: restart at the present attitude
        return present
    scale = RATE_LEAD_RAD / angle
    bounded = Vector3(lead.x * scale, lead.y * scale, lead.z * scale)
    return normalised(quaternion_product(present, rotation_over(bounded, 1.0)))


@compiled
def attitude_step(
    stream: Record,
    last_target: FloatArray,
    state: VehicleState,
    params: GuidanceParams,
    limits: TrajectoryLimits,
    dt_s: float,
    target: FloatArray,
) -> Trajectory:
    """Write the attitude target (5,), from the loops' ``last_target`` (5,); return the reference.

    The reference has the vehicle's position and velocity and the acceleration of the target's thrust, so that the next
    mode starts from the present motion and attitude.
    """
    if stream["kind"] == ATTITUDE:
        wanted = stream["attitude"]
        q = Quaternion(wanted[0], wanted[1], wanted[2], wanted[3])
    else:
        q = _turned(attitude_target(last_target).attitude, _vector(stream["rates"]), state.attitude, dt_s)
    thrust_n = stream["thrust"]
    store_attitude_target(target, AttitudeTarget(q, thrust_n))
    lift = rotate(q, Vector3(0.0, 0.0, -GRAVITY_M_S2 * thrust_n / params.weight_n))
    ax, ay = clipped(lift.x, lift.y, limits.acceleration_m_s2)
    limit = limits.vertical_acceleration_m_s2
    az = min(max(lift.z + GRAVITY_M_S2, -limit), limit)
    p, v, yaw = state.position_ned_m, state.velocity_ned_m_s, euler_from_quaternion(q).z
    return Trajectory(p.x, p.y, p.z, v.x, v.y, v.z, ax, ay, az, yaw, 0.0)
