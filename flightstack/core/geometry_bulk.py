"""Attitude conversions over many rows with NumPy, for logs and reports.

The loops use ``flightstack.core.geometry``; a test checks that both agree.
"""

from __future__ import annotations

import numpy as np

from flightstack.core.contract import FloatArray


def heading_from_quaternions(q: FloatArray) -> FloatArray:
    """Yaw [rad] in (−π, π] of unit quaternions, shape (n, 4), scalar first, body FRD to world NED."""
    w, x, y, z = q[:, 0], q[:, 1], q[:, 2], q[:, 3]
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def euler_from_quaternions(q: FloatArray) -> FloatArray:
    """Roll, pitch, yaw [rad] (3-2-1) of unit quaternions, shape (n, 4) to (n, 3)."""
    w, x, y, z = q[:, 0], q[:, 1], q[:, 2], q[:, 3]
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return np.column_stack((roll, pitch, heading_from_quaternions(q)))


def quaternions_from_euler(euler_rad: FloatArray) -> FloatArray:
    """Unit quaternions of roll, pitch, yaw (3-2-1), shape (n, 3) to (n, 4)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(euler_rad.T / 2.0), np.sin(euler_rad.T / 2.0)
    return np.column_stack((
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ))  # fmt: skip
