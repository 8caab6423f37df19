"""Initial state: tilt from the specific force, yaw from the magnetometer, biases zero; and resets to measurements."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, Vector3
from flightstack.core.geometry import quaternion_from_euler, rotate, wrap_pi
from flightstack.core.portable_math import atan2, sin_cos
from flightstack.estimation.error_state import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_BIAS,
    BODY_FIELD,
    EARTH_FIELD,
    ERROR_STATES,
    GNSS_BIAS,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    WIND,
    Covariance,
    read_nominal,
    read_vector,
    turned,
    write_vector,
)
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.fusion import fuse_field
from flightstack.estimation.kalman import Filter, reset_variance

_ALIGNMENT_S, _WAIT_FOR_MAG_S = 0.4, 2.0
_UNKNOWN_YAW_RAD, _ANY_YAW_RAD = 1.0, 1.8
"""Deviation of the yaw that a magnetic field is to give, and without a magnetometer."""


class Alignment(NamedTuple):
    """Sums of the samples of a vehicle that stands."""

    force: Annotated[FloatArray, 3]
    field: Annotated[FloatArray, 3]
    forces: float
    """Number of samples of the specific force."""
    fields: float
    """Number of samples of the magnetic field."""
    elapsed_s: float


AlignmentRecord: TypeAlias = Annotated[Record, Alignment]


@compiled
def add_force(sums: AlignmentRecord, force: Vector3, dt_s: float) -> bool:
    """Add a sample of the specific force; return True if all are enough."""
    sums["force"][0] += force.x
    sums["force"][1] += force.y
    sums["force"][2] += force.z
    sums["forces"] += 1.0
    sums["elapsed_s"] += dt_s
    elapsed_s: float = sums["elapsed_s"]
    return elapsed_s >= _ALIGNMENT_S and (sums["fields"] > 0.0 or elapsed_s >= _WAIT_FOR_MAG_S)


@compiled
def add_field(sums: AlignmentRecord, field: Vector3) -> None:
    """Add a sample of the magnetic field."""
    sums["field"][0] += field.x
    sums["field"][1] += field.y
    sums["field"][2] += field.z
    sums["fields"] += 1.0


@compiled
def level_attitude(force: Vector3, yaw_rad: float) -> Quaternion:
    """Return the attitude of a vehicle that stands, from its specific force."""
    roll = atan2(-force.y, -force.z)
    pitch = atan2(force.x, math.sqrt(force.y * force.y + force.z * force.z))
    return quaternion_from_euler(roll, pitch, yaw_rad)


@compiled
def set_initial_variances(f: Filter, params: EstimatorParams, speed_m_s: float, tilt_rad: float) -> None:
    """Set the covariance to that of an aligned filter without correlations."""
    p = f.covariance
    reset_variance(p, 0, ERROR_STATES, 1e-8)
    reset_variance(p, ATTITUDE, 2, tilt_rad * tilt_rad)
    reset_variance(p, ATTITUDE + 2, 1, _ANY_YAW_RAD * _ANY_YAW_RAD)
    reset_variance(p, VELOCITY, 3, speed_m_s * speed_m_s)
    reset_variance(p, POSITION, 3, 1e-4)
    reset_variance(p, GYRO_BIAS, 3, params.gyro_bias_rad_s * params.gyro_bias_rad_s)
    reset_variance(p, ACCEL_BIAS, 3, params.accel_bias_m_s2 * params.accel_bias_m_s2)
    reset_variance(p, WIND, 2, params.wind_m_s * params.wind_m_s)
    reset_variance(p, BARO_BIAS, 1, 1e4)
    reset_variance(p, GNSS_BIAS, 3, 1e-8)


@compiled
def align(
    f: Filter, sums: AlignmentRecord, earth: Vector3, declination_rad: float, params: EstimatorParams
) -> None:
    """Set attitude, field and covariance from the sums of a vehicle that stands.

    ``earth`` is the Earth's field [gauss, NED] at the place; zero if unknown: then the measured field is taken, turned
    to the declination, or to zero if that is NaN.
    """
    force = read_vector(sums["force"], 0)
    off = abs(
        math.sqrt(force.x * force.x + force.y * force.y + force.z * force.z) / sums["forces"]
        - params.gravity_m_s2
    )
    moves = off > 1.0
    for i in range(f.nominal.size):
        f.nominal[i] = 0.0
    set_initial_variances(f, params, 5.0 if moves else 0.1, 0.3 if moves else params.tilt_rad)
    _set_attitude(f, level_attitude(force, 0.0))
    count = sums["fields"]
    if count > 0.0:
        total = read_vector(sums["field"], 0)
        field = Vector3(total.x / count, total.y / count, total.z / count)
        align_yaw(f, field, earth, declination_rad, params)


@compiled
def _set_attitude(f: Filter, q: Quaternion) -> None:
    f.nominal[0], f.nominal[1], f.nominal[2], f.nominal[3] = q.w, q.x, q.y, q.z


@compiled
def align_yaw(
    f: Filter, field: Vector3, earth: Vector3, declination_rad: float, params: EstimatorParams
) -> float:
    """Turn the attitude to the yaw of the measured field, and fuse the field; return the turn [rad]."""
    turn_rad = turn_to_field(f, field, earth, declination_rad, params)
    fuse_field(f, field, params)
    return turn_rad


@compiled
def turn_to_field(
    f: Filter, field: Vector3, earth: Vector3, declination_rad: float, params: EstimatorParams
) -> float:
    """Turn the attitude to the yaw of the measured field, and set the states of the field; return the turn [rad]."""
    n = read_nominal(f.nominal)
    level = rotate(n.attitude, field)
    turn = wrap_pi(_north(earth, declination_rad) - atan2(level.y, level.x))
    _set_attitude(f, turned(n.attitude, Vector3(0.0, 0.0, turn)))
    reset_variance(f.covariance, ATTITUDE + 2, 1, _UNKNOWN_YAW_RAD * _UNKNOWN_YAW_RAD)
    set_field(f, level, earth, declination_rad, params)
    return turn


@compiled
def _north(earth: Vector3, declination_rad: float) -> float:
    """Return the direction [rad] of the Earth's field."""
    if earth.x != 0.0 or earth.y != 0.0:
        return atan2(earth.y, earth.x)
    return declination_rad if math.isfinite(declination_rad) else 0.0


@compiled
def set_field(
    f: Filter, level: Vector3, earth: Vector3, declination_rad: float, params: EstimatorParams
) -> None:
    """Set the states of the field: the Earth's field, or ``level``, the measured one in level axes, turned to north."""
    known = earth.x != 0.0 or earth.y != 0.0
    horizontal = math.sqrt(level.x * level.x + level.y * level.y)
    sine, cosine = sin_cos(_north(earth, declination_rad))
    start = earth if known else Vector3(cosine * horizontal, sine * horizontal, level.z)
    write_vector(f.nominal, 16, start)
    write_vector(f.nominal, 19, Vector3(0.0, 0.0, 0.0))
    scale = params.field_scale if known else 1.0  # ``level`` is the measurement itself, which is fused next
    turn_rad = 0.0 if known or math.isfinite(declination_rad) else params.declination_rad
    _set_field_variances(f.covariance, start, scale, turn_rad, params)


@compiled
def _set_field_variances(
    p: Covariance, earth: Vector3, scale: float, turn_rad: float, params: EstimatorParams
) -> None:
    """Set the covariance of the field: along it by a share of it, across it by an error of its direction."""
    size, turn = scale * scale, turn_rad * turn_rad
    reset_variance(p, EARTH_FIELD, 3, params.earth_field_gauss * params.earth_field_gauss)
    p[EARTH_FIELD, EARTH_FIELD] += size * earth.x * earth.x + turn * earth.y * earth.y
    p[EARTH_FIELD, EARTH_FIELD + 1] = (size - turn) * earth.x * earth.y
    p[EARTH_FIELD + 1, EARTH_FIELD + 1] += size * earth.y * earth.y + turn * earth.x * earth.x
    p[EARTH_FIELD + 2, EARTH_FIELD + 2] += size * earth.z * earth.z
    reset_variance(p, BODY_FIELD, 3, params.body_field_gauss * params.body_field_gauss)
