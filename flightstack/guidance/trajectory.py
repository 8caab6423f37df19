"""Reference model: a jerk-limited point that moves to a goal, with its velocity and acceleration.

The outer loop tracks position, velocity and acceleration of this point, so that the vehicle follows without lag or
overshoot, within the limits here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import PositionSetpoint, Vector3
from flightstack.core.geometry import wrap_pi


class Trajectory(NamedTuple):
    """State of the reference point, NED. In a turn with a direction ``yaw_rad`` may leave (−π, π]."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    ax: float
    ay: float
    az: float
    yaw_rad: float
    yaw_rate_rad_s: float


class Goal(NamedTuple):
    """Target position and heading, and speed limits.

    The heading is reached by the shorter turn, unless ``yaw_is_counted`` is 1: then ``yaw_rad`` is continuous with the
    reference's ``yaw_rad``, so that a turn has a direction and may exceed half a circle.
    """

    x: float
    y: float
    z: float
    yaw_rad: float
    speed_m_s: float
    climb_m_s: float
    descent_m_s: float
    yaw_rate_rad_s: float
    yaw_is_counted: float


class TrajectoryLimits(NamedTuple):
    """Limits of the reference; the jerk must be at least ``POLE_RAD_S`` times either acceleration."""

    acceleration_m_s2: float
    vertical_acceleration_m_s2: float
    jerk_m_s3: float


# Near the goal the reference is linear with a triple pole at −w: s³ + 3w s² + 3w² s + w³ = (s + w)³
POLE_RAD_S = 3.0
KP = POLE_RAD_S / 3.0
KV = POLE_RAD_S
KA = 3.0 * POLE_RAD_S
BRAKING = 0.5  # share of the acceleration used to plan braking; the rest covers the delay of the jerk limit


@compiled
def approach_speed(
    distance_m: float, top_m_s: float, acceleration_m_s2: float, gain_1_s: float = KP
) -> float:
    """Return the speed at ``distance_m`` from the goal: linear near it, then constant braking, at most ``top_m_s``."""
    braking = BRAKING * acceleration_m_s2
    linear_m = braking / (gain_1_s * gain_1_s)
    if distance_m <= linear_m:
        return min(top_m_s, gain_1_s * distance_m)
    return min(top_m_s, math.sqrt(2.0 * braking * (distance_m - 0.5 * linear_m)))


@compiled
def clipped(x: float, y: float, limit: float) -> tuple[float, float]:
    """Shorten a vector to at most ``limit``."""
    norm = math.sqrt(x * x + y * y)
    if norm <= limit:
        return x, y
    return x * limit / norm, y * limit / norm


@compiled
def approach_horizontally(
    t: Trajectory, goal: Goal, limits: TrajectoryLimits, dt_s: float
) -> tuple[float, float, float, float, float, float]:
    """Return the reference's next x, y, vx, vy, ax, ay on its way to ``goal``."""
    dx, dy = goal.x - t.x, goal.y - t.y
    distance = math.sqrt(dx * dx + dy * dy)
    speed = approach_speed(distance, goal.speed_m_s, limits.acceleration_m_s2)
    scale = speed / distance if distance > 1e-9 else 0.0
    ax, ay = clipped(KV * (dx * scale - t.vx), KV * (dy * scale - t.vy), limits.acceleration_m_s2)
    jx, jy = clipped(KA * (ax - t.ax), KA * (ay - t.ay), limits.jerk_m_s3)
    ax, ay = t.ax + jx * dt_s, t.ay + jy * dt_s
    vx, vy = t.vx + ax * dt_s, t.vy + ay * dt_s
    return t.x + vx * dt_s, t.y + vy * dt_s, vx, vy, ax, ay


@compiled
def approach_vertically(
    t: Trajectory, goal: Goal, limits: TrajectoryLimits, dt_s: float
) -> tuple[float, float, float]:
    """Return the reference's next z, vz, az on its way to ``goal``."""
    dz = goal.z - t.z
    top = goal.descent_m_s if dz > 0.0 else goal.climb_m_s
    limit = limits.vertical_acceleration_m_s2
    wanted = math.copysign(approach_speed(abs(dz), top, limit), dz)
    az = min(max(KV * (wanted - t.vz), -limit), limit)
    jerk = min(max(KA * (az - t.az), -limits.jerk_m_s3), limits.jerk_m_s3)
    az = t.az + jerk * dt_s
    vz = t.vz + az * dt_s
    return t.z + vz * dt_s, vz, az


@compiled
def _heading(t: Trajectory, goal: Goal, dt_s: float) -> tuple[float, float]:
    counted = goal.yaw_is_counted > 0.0
    error = goal.yaw_rad - t.yaw_rad
    if not counted:
        error = wrap_pi(error)
    wanted = min(max(2.0 * error, -goal.yaw_rate_rad_s), goal.yaw_rate_rad_s)
    rate = t.yaw_rate_rad_s + min(max(6.0 * (wanted - t.yaw_rate_rad_s), -6.0), 6.0) * dt_s
    yaw_rad = t.yaw_rad + rate * dt_s
    return yaw_rad if counted else wrap_pi(yaw_rad), rate


@compiled
def trajectory_step(t: Trajectory, goal: Goal, limits: TrajectoryLimits, dt_s: float) -> Trajectory:
    """Move the reference by ``dt_s`` towards ``goal``, where it comes to rest.

    A cascade with vector limits: position to velocity (square-root controller), velocity to acceleration, acceleration
    to jerk. Horizontal limits apply to the vector, so that a leg from rest is a straight line.
    """
    x, y, vx, vy, ax, ay = approach_horizontally(t, goal, limits, dt_s)
    z, vz, az = approach_vertically(t, goal, limits, dt_s)
    yaw, yaw_rate = _heading(t, goal, dt_s)
    return Trajectory(x, y, z, vx, vy, vz, ax, ay, az, yaw, yaw_rate)


@compiled
def setpoint_of(t: Trajectory) -> PositionSetpoint:
    """Return the outer loop's setpoint at the reference point."""
    return PositionSetpoint(
        Vector3(t.x, t.y, t.z),
        Vector3(t.vx, t.vy, t.vz),
        Vector3(t.ax, t.ay, t.az),
        wrap_pi(t.yaw_rad),
        t.yaw_rate_rad_s,
    )
