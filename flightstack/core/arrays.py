"""Conversions between the types of ``contract`` and their array form, for compiled code."""

from __future__ import annotations

import math
from typing import Any

from flightstack.core.array_items import store
from flightstack.core.compiled import compiled
from flightstack.core.contract import (
    AttitudeTarget,
    FloatArray,
    LoopRow,
    PositionSetpoint,
    Quaternion,
    Vector3,
    VehicleState,
    Wrench,
)

_WRENCH, _ACHIEVED, _STATUS = LoopRow.WRENCH.start, LoopRow.WRENCH_ACHIEVED.start, LoopRow.STATUS


@compiled
def all_finite(values: FloatArray | tuple[float, ...]) -> bool:
    """Return True if all values of an array or a flat tuple are finite."""
    for value in values:  # noqa: SIM110  # compiled code has no generators
        if not math.isfinite(value):
            return False
    return True


@compiled
def copy_all(source: Any, target: Any) -> None:
    """Copy an array of one dimension to the start of another."""
    for i in range(len(source)):
        target[i] = source[i]


@compiled
def vehicle_state(x: FloatArray) -> VehicleState:
    """Read a ``VehicleState`` from its array form, shape (13,)."""
    return VehicleState(
        Vector3(x[0], x[1], x[2]),
        Vector3(x[3], x[4], x[5]),
        Quaternion(x[6], x[7], x[8], x[9]),
        Vector3(x[10], x[11], x[12]),
    )


@compiled
def position_setpoint(x: FloatArray) -> PositionSetpoint:
    """Read a ``PositionSetpoint`` from its array form, shape (11,)."""
    return PositionSetpoint(
        Vector3(x[0], x[1], x[2]),
        Vector3(x[3], x[4], x[5]),
        Vector3(x[6], x[7], x[8]),
        x[9],
        x[10],
    )


@compiled
def store_position_setpoint(out: FloatArray, setpoint: PositionSetpoint) -> None:
    """Write a ``PositionSetpoint`` in its array form to ``out``, shape (11,)."""
    p, v, a = setpoint.position_ned_m, setpoint.velocity_ned_m_s, setpoint.acceleration_ned_m_s2
    out[0], out[1], out[2] = p.x, p.y, p.z
    out[3], out[4], out[5] = v.x, v.y, v.z
    out[6], out[7], out[8] = a.x, a.y, a.z
    out[9], out[10] = setpoint.yaw_rad, setpoint.yaw_rate_rad_s


@compiled
def attitude_target(x: FloatArray) -> AttitudeTarget:
    """Read an ``AttitudeTarget`` from its array form, shape (5,)."""
    return AttitudeTarget(Quaternion(x[0], x[1], x[2], x[3]), x[4])


@compiled
def store_attitude_target(out: FloatArray, target: AttitudeTarget) -> None:
    """Write an ``AttitudeTarget`` in its array form to ``out``, shape (5,)."""
    q = target.attitude
    out[0], out[1], out[2], out[3], out[4] = q.w, q.x, q.y, q.z, target.thrust_n


@compiled
def commanded_wrench(row: FloatArray) -> Wrench:
    """Read the wrench that the loops commanded from a row, shape (48,); see ``LoopRow``."""
    return Wrench(row[_WRENCH], Vector3(row[_WRENCH + 1], row[_WRENCH + 2], row[_WRENCH + 3]))


@compiled
def achieved_wrench(row: FloatArray) -> Wrench:
    """Read the wrench that the mixer achieved from a row, shape (48,)."""
    return Wrench(row[_ACHIEVED], Vector3(row[_ACHIEVED + 1], row[_ACHIEVED + 2], row[_ACHIEVED + 3]))


@compiled
def store_wrenches(row: FloatArray, commanded: Wrench, achieved: Wrench) -> None:
    """Write both wrenches to a row, shape (48,)."""
    row[_WRENCH], row[_ACHIEVED] = commanded.thrust_n, achieved.thrust_n
    store(row[_WRENCH + 1 :], commanded.torque_frd_n_m)
    store(row[_ACHIEVED + 1 :], achieved.torque_frd_n_m)


@compiled
def store_status(row: FloatArray, status: int) -> None:
    """Write the status bits of ``LoopStatus`` to a row, shape (48,)."""
    row[_STATUS] = status


@compiled
def store_outer_row(
    out: FloatArray, state: FloatArray, setpoint: FloatArray, target: FloatArray, flags: int
) -> None:
    """Write state (13,), setpoint (11,), attitude target (5,) and flags in this order to ``out`` (30,)."""
    at = 0
    for part in (state, setpoint, target):
        for value in part:
            out[at] = value
            at += 1
    out[at] = flags
