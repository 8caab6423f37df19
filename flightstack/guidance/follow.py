"""Move the reference along streamed setpoints of position, velocity and acceleration, within limits.

A position alone is approached like a waypoint (``trajectory``). With a velocity or an acceleration, the position is a
point of the sender's trajectory, and the reference tracks it closely. Without a position, the reference integrates
the velocity or acceleration.
"""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.core.contract import Vector3
from flightstack.core.geometry import wrap_pi
from flightstack.guidance.trajectory import (
    POLE_RAD_S,
    Goal,
    Trajectory,
    TrajectoryLimits,
    approach_horizontally,
    approach_speed,
    approach_vertically,
    clipped,
)

# Faster than the waypoint approach: an acceleration without feed-forward causes an error of 1/12 s² times itself.
FOLLOW_POLE_RAD_S = 6.0
LEASH_M = 3.0
"""Largest distance between vehicle and a reference without a position setpoint, so that the vehicle can follow."""
YAW_LEASH_RAD = 0.8


@compiled
def _pole(acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """Return the pole of position tracking, bounded by the jerk limit."""
    return max(POLE_RAD_S, min(FOLLOW_POLE_RAD_S, jerk_m_s3 / acceleration_m_s2))


@compiled
def _or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0


@compiled
def _is_given(v: Vector3) -> bool:
    return math.isfinite(v.x) and math.isfinite(v.y)


@compiled
def follow_horizontally(
    t: Trajectory,
    position: Vector3,
    velocity: Vector3,
    acceleration: Vector3,
    speed_m_s: float,
    limits: TrajectoryLimits,
    dt_s: float,
) -> tuple[float, float, float, float, float, float]:
    """Return the reference's next x, y, vx, vy, ax, ay; NaN in a setpoint means "not given"."""
    has_position, has_velocity = _is_given(position), _is_given(velocity)
    has_acceleration = _is_given(acceleration)
    limit = limits.acceleration_m_s2
    pole = POLE_RAD_S
    wx, wy = (velocity.x, velocity.y) if has_velocity else (0.0, 0.0)
    fx, fy = (acceleration.x, acceleration.y) if has_acceleration else (0.0, 0.0)
    if has_position:
        dx, dy = position.x - t.x, position.y - t.y
        if not (has_velocity or has_acceleration):
            goal = Goal(position.x, position.y, 0.0, 0.0, speed_m_s, 0.0, 0.0, 0.0, 0.0)
            return approach_horizontally(t, goal, limits, dt_s)
        pole = _pole(limit, limits.jerk_m_s3)
        distance = math.sqrt(dx * dx + dy * dy)
        scale = approach_speed(distance, speed_m_s, limit, pole / 3.0) / distance if distance > 1e-9 else 0.0
        wx, wy = wx + dx * scale, wy + dy * scale
    elif has_acceleration and not has_velocity:
        wx, wy = t.vx, t.vy
    # feed the acceleration forward as a velocity increment, so that the top speed bounds it too
    wx, wy = clipped(wx + fx / pole, wy + fy / pole, speed_m_s)
    ax, ay = clipped(pole * (wx - t.vx), pole * (wy - t.vy), limit)
    jx, jy = clipped(3.0 * pole * (ax - t.ax), 3.0 * pole * (ay - t.ay), limits.jerk_m_s3)
    ax, ay = t.ax + jx * dt_s, t.ay + jy * dt_s
    vx, vy = t.vx + ax * dt_s, t.vy + ay * dt_s
    return t.x + vx * dt_s, t.y + vy * dt_s, vx, vy, ax, ay


@compiled
def follow_vertically(
    t: Trajectory,
    position_m: float,
    velocity_m_s: float,
    acceleration_m_s2: float,
    climb_m_s: float,
    descent_m_s: float,
    limits: TrajectoryLimits,
    dt_s: float,
) -> tuple[float, float, float]:
    """Return the reference's next z, vz, az; NaN means "not given"."""
    has_velocity, has_acceleration = math.isfinite(velocity_m_s), math.isfinite(acceleration_m_s2)
    limit = limits.vertical_acceleration_m_s2
    pole = POLE_RAD_S
    wanted, feed = _or_zero(velocity_m_s), _or_zero(acceleration_m_s2)
    if math.isfinite(position_m):
        if not (has_velocity or has_acceleration):
            goal = Goal(0.0, 0.0, position_m, 0.0, 0.0, climb_m_s, descent_m_s, 0.0, 0.0)
            return approach_vertically(t, goal, limits, dt_s)
        pole = _pole(limit, limits.jerk_m_s3)
        dz = position_m - t.z
        top = descent_m_s if dz > 0.0 else climb_m_s
        wanted += math.copysign(approach_speed(abs(dz), top, limit, pole / 3.0), dz)
    elif has_acceleration and not has_velocity:
        wanted = t.vz
    wanted = min(max(wanted + feed / pole, -climb_m_s), descent_m_s)
    az = min(max(pole * (wanted - t.vz), -limit), limit)
    jerk = min(max(3.0 * pole * (az - t.az), -limits.jerk_m_s3), limits.jerk_m_s3)
    az = t.az + jerk * dt_s
    vz = t.vz + az * dt_s
    return t.z + vz * dt_s, vz, az


@compiled
def follow_heading(
    t: Trajectory, yaw_rad: float, yaw_rate_rad_s: float, top_rad_s: float, present_rad: float, dt_s: float
) -> tuple[float, float]:
    """Return the reference's next heading and its rate.

    A heading is approached by the shorter turn, with a given rate as feed-forward. A rate alone turns the reference,
    which leads the vehicle's ``present_rad`` by at most ``YAW_LEASH_RAD``. Without either, the rotation stops.
    """
    wanted = _or_zero(yaw_rate_rad_s)
    has_heading = math.isfinite(yaw_rad)
    if has_heading:
        wanted += 2.0 * wrap_pi(yaw_rad - t.yaw_rad)
    wanted = min(max(wanted, -top_rad_s), top_rad_s)
    rate = t.yaw_rate_rad_s + min(max(6.0 * (wanted - t.yaw_rate_rad_s), -6.0), 6.0) * dt_s
    yaw = wrap_pi(t.yaw_rad + rate * dt_s)
    if not has_heading:
        lead = wrap_pi(yaw - present_rad)
        yaw = wrap_pi(present_rad + min(max(lead, -YAW_LEASH_RAD), YAW_LEASH_RAD))
    return yaw, rate


@compiled
def leashed(value_m: float, present_m: float) -> float:
    """Bound a coordinate of a reference without a position setpoint to ``LEASH_M`` from the vehicle."""
    return min(max(value_m, present_m - LEASH_M), present_m + LEASH_M)
