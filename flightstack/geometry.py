"""Quaternions, Euler angles and vectors in compiled code: the only copy in the project.

Quaternions are Hamilton, scalar first, body FRD to world NED. Euler angles are yaw, pitch, roll (3-2-1).
"""

from __future__ import annotations

import math

from flightstack.compiled import compiled
from flightstack.contract import Quaternion, Vector3


@compiled
def cross(a: Vector3, b: Vector3) -> Vector3:
    """Vector product a × b."""
    return Vector3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@compiled
def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product a ⊗ b: first the rotation b, then a."""
    return Quaternion(
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
    )


@compiled
def conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse rotation of a unit quaternion."""
    return Quaternion(q.w, -q.x, -q.y, -q.z)


@compiled
def normalised(q: Quaternion) -> Quaternion:
    """Scale ``q`` to unit length; the identity when its length is zero."""
    norm = math.sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z)
    if norm == 0.0:
        return Quaternion(1.0, 0.0, 0.0, 0.0)
    scale = 1.0 / norm
    return Quaternion(q.w * scale, q.x * scale, q.y * scale, q.z * scale)


@compiled
def rotate(q: Quaternion, v: Vector3) -> Vector3:
    """Rotate a body vector to the world frame."""
    # v + 2 w (u × v) + 2 u × (u × v), with q = (w, u)
    u = Vector3(q.x, q.y, q.z)
    t = cross(u, v)
    tt = cross(u, t)
    return Vector3(
        v.x + 2.0 * (q.w * t.x + tt.x), v.y + 2.0 * (q.w * t.y + tt.y), v.z + 2.0 * (q.w * t.z + tt.z)
    )


@compiled
def blend(a: Quaternion, b: Quaternion, fraction: float) -> Quaternion:
    """Attitude at ``fraction`` of the short way from ``a`` to ``b``, for small angles between them."""
    near = a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z
    to = fraction if near >= 0.0 else -fraction
    left = 1.0 - fraction
    return normalised(
        Quaternion(left * a.w + to * b.w, left * a.x + to * b.x, left * a.y + to * b.y, left * a.z + to * b.z)
    )


@compiled
def rotation_vector(q: Quaternion) -> Vector3:
    """Logarithm of a unit quaternion: axis times angle [rad], the angle in [0, π].

    On a single axis it is the angle itself, which the paper's Euler errors are too.
    """
    sign = 1.0 if q.w >= 0.0 else -1.0
    norm = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z)
    # the series' first term where the quotient would lose digits
    scale = 2.0 * sign if norm < 1e-9 else 2.0 * math.atan2(norm, sign * q.w) / norm * sign
    return Vector3(q.x * scale, q.y * scale, q.z * scale)


@compiled
def rotation_over(rates: Vector3, dt_s: float) -> Quaternion:
    """Rotation that constant body rates make in ``dt_s``; with 1, the exponential of a rotation vector."""
    norm = math.sqrt(rates.x * rates.x + rates.y * rates.y + rates.z * rates.z)
    half = 0.5 * norm * dt_s
    scale = 0.5 * dt_s if half < 1e-9 else math.sin(half) / norm
    return Quaternion(math.cos(half), rates.x * scale, rates.y * scale, rates.z * scale)


@compiled
def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Quaternion of yaw, then pitch, then roll (3-2-1)."""
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return Quaternion(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@compiled
def euler_from_quaternion(q: Quaternion) -> Vector3:
    """Roll, pitch, yaw [rad] of a unit quaternion; roll and yaw in (−π, π], pitch in [−π/2, π/2]."""
    sin_pitch = 2.0 * (q.w * q.y - q.z * q.x)
    sin_pitch = min(1.0, max(-1.0, sin_pitch))
    return Vector3(
        math.atan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x * q.x + q.y * q.y)),
        math.asin(sin_pitch),
        math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z)),
    )


@compiled
def wrap_pi(angle_rad: float) -> float:
    """Wrap an angle to [−π, π)."""
    return angle_rad - 2.0 * math.pi * math.floor((angle_rad + math.pi) / (2.0 * math.pi))
