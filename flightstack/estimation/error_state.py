"""States of the filter: the nominal state, and the layout of its error state.

An attitude error is a rotation vector δθ in the world frame: true attitude = exp(δθ) ⊗ attitude. Every other error is
true minus nominal.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import conjugate, normalised, quaternion_product, rotation_over, wrap_pi
from flightstack.core.portable_math import atan2

ERROR_STATES = 27
NOMINAL_SIZE = 28

ErrorVector: TypeAlias = Annotated[FloatArray, ERROR_STATES]
Covariance: TypeAlias = Annotated[FloatArray, ERROR_STATES, ERROR_STATES]

ATTITUDE, VELOCITY, POSITION, GYRO_BIAS, ACCEL_BIAS, EARTH_FIELD, BODY_FIELD = 0, 3, 6, 9, 12, 15, 18
WIND, BARO_BIAS, GNSS_BIAS = 21, 23, 24
"""First index of each part of the error state."""

PARTS = (
    ("attitude error", "rad, NED", ATTITUDE, 3),
    ("velocity", "m/s, NED", VELOCITY, 3),
    ("position", "m, NED", POSITION, 3),
    ("gyro bias", "rad/s, FRD", GYRO_BIAS, 3),
    ("accelerometer bias", "m/s², FRD", ACCEL_BIAS, 3),
    ("Earth's magnetic field", "gauss, NED", EARTH_FIELD, 3),
    ("body's magnetic field", "gauss, FRD", BODY_FIELD, 3),
    ("wind", "m/s, NE", WIND, 2),
    ("barometer bias", "m", BARO_BIAS, 1),
    ("GNSS position bias", "m, NED", GNSS_BIAS, 3),
)
"""Name, unit and frame, first index and size of each part, for tables and logs."""


class Nominal(NamedTuple):
    """Nominal state of the filter; position relative to the origin of the local frame."""

    attitude: Quaternion
    velocity_ned_m_s: Vector3
    position_ned_m: Vector3
    gyro_bias_rad_s: Vector3
    accel_bias_m_s2: Vector3
    earth_field_ned_gauss: Vector3
    body_field_frd_gauss: Vector3
    wind_north_m_s: float
    wind_east_m_s: float
    baro_bias_m: float
    gnss_bias_ned_m: Vector3


@compiled
def read_vector(x: FloatArray, at: int) -> Vector3:
    """Read three floats from index ``at``."""
    return Vector3(x[at], x[at + 1], x[at + 2])


@compiled
def write_vector(x: FloatArray, at: int, v: Vector3) -> None:
    """Write three floats to index ``at``."""
    x[at], x[at + 1], x[at + 2] = v.x, v.y, v.z


@compiled
def sum_of(a: Vector3, b: Vector3) -> Vector3:
    """Vector sum."""
    return Vector3(a.x + b.x, a.y + b.y, a.z + b.z)


@compiled
def scaled(a: Vector3, factor: float) -> Vector3:
    """Return ``a`` times ``factor``."""
    return Vector3(a.x * factor, a.y * factor, a.z * factor)


@compiled
def read_nominal(x: FloatArray) -> Nominal:
    """Read a ``Nominal`` from its array form, shape (28,)."""
    return Nominal(
        Quaternion(x[0], x[1], x[2], x[3]),
        read_vector(x, 4),
        read_vector(x, 7),
        read_vector(x, 10),
        read_vector(x, 13),
        read_vector(x, 16),
        read_vector(x, 19),
        x[22],
        x[23],
        x[24],
        read_vector(x, 25),
    )


@compiled
def write_nominal(x: FloatArray, n: Nominal) -> None:
    """Write a ``Nominal`` in its array form, shape (28,)."""
    x[0], x[1], x[2], x[3] = n.attitude.w, n.attitude.x, n.attitude.y, n.attitude.z
    write_vector(x, 4, n.velocity_ned_m_s)
    write_vector(x, 7, n.position_ned_m)
    write_vector(x, 10, n.gyro_bias_rad_s)
    write_vector(x, 13, n.accel_bias_m_s2)
    write_vector(x, 16, n.earth_field_ned_gauss)
    write_vector(x, 19, n.body_field_frd_gauss)
    x[22], x[23], x[24] = n.wind_north_m_s, n.wind_east_m_s, n.baro_bias_m
    write_vector(x, 25, n.gnss_bias_ned_m)


@compiled
def turned(q: Quaternion, world_rotation: Vector3) -> Quaternion:
    """Rotate an attitude by a rotation vector [rad] in the world frame."""
    return normalised(quaternion_product(rotation_over(world_rotation, 1.0), q))


@compiled
def turn_between(before: Quaternion, after: Quaternion) -> float:
    """Return the angle [rad] about the vertical from one attitude to another."""
    turn = quaternion_product(after, conjugate(before))
    return wrap_pi(2.0 * atan2(turn.z, turn.w))


@compiled
def correct(x: FloatArray, error: ErrorVector, share: float) -> None:
    """Add ``share`` of an error state, shape (27,), to the array form of the nominal state, shape (28,)."""
    turn = scaled(read_vector(error, ATTITUDE), share)
    q = turned(Quaternion(x[0], x[1], x[2], x[3]), turn)
    x[0], x[1], x[2], x[3] = q.w, q.x, q.y, q.z
    for i in range(VELOCITY, ERROR_STATES):
        x[i + 1] += share * error[i]
