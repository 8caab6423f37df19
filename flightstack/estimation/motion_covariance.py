"""Covariances of pose, velocity and acceleration, from that of the error state.

The error of attitude is given as a rotation about the body axes, as in PX4; for small tilt its parts are the errors of
roll, pitch and yaw.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flightstack.core.contract import FloatArray, Quaternion, Record, Vector3
from flightstack.estimation.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from flightstack.estimation.kalman import symmetric

_USED = ACCEL_BIAS + 3
_UPPER: dict[int, Any] = {size: np.triu_indices(size) for size in (6, 9)}


def _part(at: int) -> slice:
    return slice(at, at + 3)


def _cross(v: Vector3) -> FloatArray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _rotation(q: Quaternion) -> FloatArray:
    w, x, y, z = q
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def upper_triangle(matrix: FloatArray) -> list[float]:
    """Return the upper triangle of a 6x6 or 9x9 matrix by rows, as covariances of MAVLink."""
    values: list[float] = matrix[_UPPER[len(matrix)]].tolist()
    return values


def _transformed(memory: Record, jacobian: FloatArray) -> FloatArray:
    with np.errstate(all="ignore"):  # a diverged filter has infinite covariances
        result: FloatArray = jacobian @ symmetric(memory["covariance"][:_USED, :_USED]) @ jacobian.T
    return result


def pose_covariance(memory: Record, attitude: Quaternion) -> FloatArray:
    """Return the covariance, shape (6, 6), of the position NED [m] and the attitude about the body axes [rad]."""
    jacobian = np.zeros((6, _USED))
    jacobian[:3, _part(POSITION)] = np.eye(3)
    jacobian[3:, _part(ATTITUDE)] = _rotation(attitude).T
    return _transformed(memory, jacobian)


def twist_covariance(memory: Record, attitude: Quaternion, velocity_ned_m_s: Vector3) -> FloatArray:
    """Return the covariance, shape (6, 6), of the velocity in body axes [m/s] and of the rates [rad/s].

    The velocity in body axes is uncertain by the attitude too. The rates are uncertain by the gyro's bias.
    """
    into_body = _rotation(attitude).T
    jacobian = np.zeros((6, _USED))
    jacobian[:3, _part(VELOCITY)] = into_body
    with np.errstate(all="ignore"):
        jacobian[:3, _part(ATTITUDE)] = into_body @ _cross(velocity_ned_m_s)
    jacobian[3:, _part(GYRO_BIAS)] = -np.eye(3)
    return _transformed(memory, jacobian)


def motion_covariance(memory: Record, attitude: Quaternion, force_frd_m_s2: Vector3) -> FloatArray:
    """Return the covariance, shape (9, 9), of position, velocity and acceleration, all NED.

    ``force_frd_m_s2`` is the specific force without its bias. The acceleration is uncertain by the attitude, which
    turns the force, and by the accelerometer's bias.
    """
    to_world, jacobian = _rotation(attitude), np.zeros((9, _USED))
    jacobian[:3, _part(POSITION)] = jacobian[3:6, _part(VELOCITY)] = np.eye(3)
    with np.errstate(all="ignore"):
        force = to_world @ np.array(force_frd_m_s2)
    jacobian[6:, _part(ATTITUDE)] = -_cross(Vector3(*force.tolist()))
    jacobian[6:, _part(ACCEL_BIAS)] = -to_world
    return _transformed(memory, jacobian)
