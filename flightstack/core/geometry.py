"""Quaternions, Euler angles and vectors for compiled code.

Quaternions are Hamilton, scalar first, body FRD to world NED. Euler angles are yaw, pitch, roll (3-2-1).
Operations and their order are those of ``firmware/core/fs_geometry.h``.
"""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.portable_math import (
    LARGEST_SQUARE,
    arc_tangent_series,
    euler_angles,
    sin_cos,
    yaw_angle,
)

LEAST_LENGTH = 1e-30
"""Replaces zero as a divisor."""
SMALL_SQUARE = 0.01
"""Square of half the rotation angle [rad²] up to which Taylor series are used: 11 degrees."""


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
    """Attitude at ``fraction`` of the shortest rotation from ``a`` to ``b``, for small angles."""
    near = a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z
    to = fraction if near >= 0.0 else -fraction
    left = 1.0 - fraction
    return normalised(
        Quaternion(left * a.w + to * b.w, left * a.x + to * b.x, left * a.y + to * b.y, left * a.z + to * b.z)
    )


@compiled
def rotation_vector(q: Quaternion) -> Vector3:
    """Logarithm of a quaternion of any length: axis times angle [rad], angle in [0, π]; zero for the zero quaternion.

    For a single axis it equals the Euler angle, as in the paper's errors.
    """
    square, w_square = q.x * q.x + q.y * q.y + q.z * q.z, q.w * q.w
    if square < LARGEST_SQUARE * w_square:  # below 45 degrees: 2 atan(norm / w) / norm, without the norm
        inverse = 1.0 / q.w
        ratio_square = square * inverse * inverse
        scale = 2.0 * inverse
    else:  # the tangent of an eighth of the angle: tan(a/2) = sin a / (cos a + 1), twice
        half = abs(q.w) + math.sqrt(w_square + square)
        quarter = half + math.sqrt(half * half + square)
        inverse = 1.0 / max(quarter, LEAST_LENGTH)
        ratio_square = square * inverse * inverse
        scale = 8.0 * inverse if q.w >= 0.0 else -8.0 * inverse
    scale = scale + scale * arc_tangent_series(ratio_square)
    return Vector3(q.x * scale, q.y * scale, q.z * scale)


@compiled
def rotation_over(rates: Vector3, dt_s: float) -> Quaternion:
    """Rotation by constant body rates over ``dt_s``; with ``dt_s`` = 1 the exponential of a rotation vector."""
    rate_square = rates.x * rates.x + rates.y * rates.y + rates.z * rates.z
    half_dt = 0.5 * dt_s
    square = rate_square * (half_dt * half_dt)
    if square <= SMALL_SQUARE:  # Taylor's series of cosine and of sine by angle: no norm needed
        cosine = (square * (1.0 / 40320.0) - 1.0 / 720.0) * square + 1.0 / 24.0
        sine = ((square * (1.0 / 362880.0) - 1.0 / 5040.0) * square + 1.0 / 120.0) * square - 1.0 / 6.0
        w = 1.0 - (0.5 * square - square * (square * cosine))
        scale = half_dt + half_dt * (square * sine)
    else:
        norm = math.sqrt(rate_square)
        sine, w = sin_cos(norm * half_dt)
        scale = sine / norm
    return Quaternion(w, rates.x * scale, rates.y * scale, rates.z * scale)


@compiled
def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Quaternion of yaw, then pitch, then roll (3-2-1)."""
    (sr, cr), (sp, cp), (sy, cy) = sin_cos(0.5 * roll_rad), sin_cos(0.5 * pitch_rad), sin_cos(0.5 * yaw_rad)
    return Quaternion(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@compiled
def euler_from_quaternion(q: Quaternion) -> Vector3:
    """Roll, pitch, yaw [rad] of a unit quaternion; roll and yaw in (−π, π], pitch in [−π/2, π/2]."""
    return Vector3(*euler_angles(q.w, q.x, q.y, q.z))


@compiled
def heading(q: Quaternion) -> float:
    """Yaw [rad] of a unit quaternion, in (−π, π]."""
    return yaw_angle(q.w, q.x, q.y, q.z)


@compiled
def wrap_pi(angle_rad: float) -> float:
    """Wrap an angle to [−π, π)."""
    return angle_rad - 2.0 * math.pi * math.floor((angle_rad + math.pi) / (2.0 * math.pi))
