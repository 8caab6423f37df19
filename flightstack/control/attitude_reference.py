"""Attitude reference: the filtered and differentiated attitude target that attitude controllers track."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import AttitudeReference, Quaternion, Vector3
from flightstack.core.geometry import (
    conjugate,
    normalised,
    quaternion_product,
    rotate,
    rotation_over,
    rotation_vector,
)
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable


class ReferenceMemory(NamedTuple):
    """State of the filter: attitude and body rates of the reference."""

    w: float
    x: float
    y: float
    z: float
    p_rad_s: float
    q_rad_s: float
    r_rad_s: float


class ReferenceParams(NamedTuple):
    """Second-order filter: natural frequency (0: no filter), damping ratio and limits."""

    bandwidth_rad_s: float
    damping: float
    max_rate_rad_s: float
    max_acceleration_rad_s2: float


REFERENCE_TUNABLES = (
    Tunable("bandwidth_rad_s", "ATT_REF_BW", 0.0, 1e3, "rad/s", "Bandwidth of the target filter; 0 for none"),
    Tunable("damping", "ATT_REF_DAMP", 0.1, 5.0, "", "Damping of the target filter"),
    Tunable("max_rate_rad_s", "ATT_REF_RATE", 0.1, 100.0, "rad/s", "Largest rate of the reference"),
    Tunable("max_acceleration_rad_s2", "ATT_REF_ACC", 0.1, 1e5, "rad/s^2", "Largest acceleration of the reference"),
)  # fmt: skip


@compiled
def _clipped(v: Vector3, limit: float) -> Vector3:
    norm = math.sqrt(v.x * v.x + v.y * v.y + v.z * v.z)
    if norm <= limit:
        return v
    scale = limit / norm
    return Vector3(v.x * scale, v.y * scale, v.z * scale)


@compiled
def _advanced_rates(memory: ReferenceMemory, error: Vector3, params: ReferenceParams, dt_s: float) -> Vector3:
    """Return the body rates after ``dt_s`` [rad/s], with the limits of acceleration and rate."""
    stiffness = params.bandwidth_rad_s * params.bandwidth_rad_s
    friction = 2.0 * params.damping * params.bandwidth_rad_s
    acceleration = _clipped(
        Vector3(
            stiffness * error.x - friction * memory.p_rad_s,
            stiffness * error.y - friction * memory.q_rad_s,
            stiffness * error.z - friction * memory.r_rad_s,
        ),
        params.max_acceleration_rad_s2,
    )
    return _clipped(
        Vector3(
            memory.p_rad_s + acceleration.x * dt_s,
            memory.q_rad_s + acceleration.y * dt_s,
            memory.r_rad_s + acceleration.z * dt_s,
        ),
        params.max_rate_rad_s,
    )


@compiled
def attitude_reference_step(
    memory: ReferenceMemory, target: Quaternion, params: ReferenceParams, dt_s: float
) -> tuple[ReferenceMemory, AttitudeReference]:
    """Advance the reference by ``dt_s`` towards ``target``.

    The outer loop's target changes in steps, which would saturate the rotors of a stiff attitude loop. The filter
    provides the rate and acceleration for feed-forward and backstepping (ẋ_d, ẍ_d). It is a second-order system on
    the rotation group: error by the quaternion logarithm, exact integration of the rotation over a step.
    """
    if params.bandwidth_rad_s <= 0.0:
        zero = Vector3(0.0, 0.0, 0.0)
        passed = ReferenceMemory(target.w, target.x, target.y, target.z, 0.0, 0.0, 0.0)
        return passed, AttitudeReference(target, zero, zero)
    attitude = Quaternion(memory.w, memory.x, memory.y, memory.z)
    error = rotation_vector(quaternion_product(conjugate(attitude), target))
    rates = _advanced_rates(memory, error, params, dt_s)
    acceleration = Vector3(  # after the limits
        (rates.x - memory.p_rad_s) / dt_s,
        (rates.y - memory.q_rad_s) / dt_s,
        (rates.z - memory.r_rad_s) / dt_s,
    )
    attitude = normalised(quaternion_product(attitude, rotation_over(rates, dt_s)))
    advanced = ReferenceMemory(attitude.w, attitude.x, attitude.y, attitude.z, rates.x, rates.y, rates.z)
    return advanced, AttitudeReference(attitude, rates, acceleration)


@compiled
def in_body_frame(reference: AttitudeReference, attitude: Quaternion) -> AttitudeReference:
    """Rotate the reference's rates and acceleration from its own body frame to the vehicle's."""
    turn = quaternion_product(conjugate(attitude), reference.attitude)
    return AttitudeReference(
        reference.attitude,
        rotate(turn, reference.rates_frd_rad_s),
        rotate(turn, reference.acceleration_frd_rad_s2),
    )


def read_reference_params(gains: Table) -> ReferenceParams:
    """Read ``[attitude_reference]``."""
    table = gains.table("attitude_reference")
    params = ReferenceParams(
        table.number("bandwidth_rad_s", 0.0, 1e3),
        table.number("damping", 0.1, 5.0),
        table.number("max_rate_rad_s", 0.1, 100.0),
        table.number("max_acceleration_rad_s2", 0.1, 1e5),
    )
    table.finish()
    return params
