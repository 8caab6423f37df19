"""Backstepping attitude control, the paper's nonlinear inner loop (section II.B.2, corrected)."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.control.control_law import AttitudeController, AttitudeInputs
from flightstack.core.compiled import compiled
from flightstack.core.contract import Vector3
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import Vehicle


class BacksteppingMemory(NamedTuple):
    """Placeholder: the law has no state, and a memory type needs at least one field."""

    unused: float


class BacksteppingParams(NamedTuple):
    """c1 … c6 [1/s] of the paper's Table III, feed-forward of ẋ_d and ẍ_d (0 to 1), and inertias."""

    c1: float
    c2: float
    c3: float
    c4: float
    c5: float
    c6: float
    rate_feedforward: float
    acceleration_feedforward: float
    ix_kg_m2: float
    iy_kg_m2: float
    iz_kg_m2: float
    rotor_inertia_kg_m2: float


BACKSTEPPING_TUNABLES = (
    Tunable("c1", "BS_ROLL_C1", 0.0, 1e4, "1/s", "c1 of the law: decay of the angle error, roll"),
    Tunable("c2", "BS_ROLL_C2", 0.0, 1e4, "1/s", "c2 of the law: decay of the rate error, roll"),
    Tunable("c3", "BS_PITCH_C3", 0.0, 1e4, "1/s", "c3 of the law: decay of the angle error, pitch"),
    Tunable("c4", "BS_PITCH_C4", 0.0, 1e4, "1/s", "c4 of the law: decay of the rate error, pitch"),
    Tunable("c5", "BS_YAW_C5", 0.0, 1e4, "1/s", "c5 of the law: decay of the angle error, yaw"),
    Tunable("c6", "BS_YAW_C6", 0.0, 1e4, "1/s", "c6 of the law: decay of the rate error, yaw"),
    Tunable("rate_feedforward", "BS_RATE_FF", 0.0, 1.0, "", "Share of the reference rate fed ahead"),
    Tunable("acceleration_feedforward", "BS_ACC_FF", 0.0, 1.0, "", "Share of the reference acceleration fed ahead"),
)  # fmt: skip


@compiled
def _axis(
    error: float, rate: float, rate_d: float, acceleration_d: float, c_outer: float, c_inner: float
) -> float:
    """Return the angular acceleration [rad/s²] of one axis, without the terms that cancel coupling.

    ε1 = x_d − x, ε2 = ẋ − ẋ_d − c1 ε1, and ε1 − c2 ε2 − c1 (c1 ε1 + ε2) + ẍ_d.
    """
    e1 = error
    e2 = rate - rate_d - c_outer * e1
    return e1 - c_inner * e2 - c_outer * (c_outer * e1 + e2) + acceleration_d


@compiled
def attitude_backstepping_step(
    memory: BacksteppingMemory, inputs: AttitudeInputs, params: BacksteppingParams, dt_s: float
) -> tuple[BacksteppingMemory, Vector3]:
    """Return the torque [N m, FRD]: the law of each axis, with inertial coupling and gyroscopic torque cancelled."""
    error, rates, reference = inputs.error_rad, inputs.rates_frd_rad_s, inputs.reference
    ff, fa = params.rate_feedforward, params.acceleration_feedforward
    rates_d, acceleration_d = reference.rates_frd_rad_s, reference.acceleration_frd_rad_s2
    roll = _axis(error.x, rates.x, ff * rates_d.x, fa * acceleration_d.x, params.c1, params.c2)
    pitch = _axis(error.y, rates.y, ff * rates_d.y, fa * acceleration_d.y, params.c3, params.c4)
    yaw = _axis(error.z, rates.z, ff * rates_d.z, fa * acceleration_d.z, params.c5, params.c6)
    ix, iy, iz = params.ix_kg_m2, params.iy_kg_m2, params.iz_kg_m2
    p, q, r = rates.x, rates.y, rates.z
    momentum = params.rotor_inertia_kg_m2 * inputs.relative_rotor_speed_rad_s  # J_r Ω_r
    torque = Vector3(
        ix * roll - (iy - iz) * q * r - momentum * q,
        iy * pitch - (iz - ix) * p * r + momentum * p,
        iz * yaw - (ix - iy) * p * q,
    )
    return memory, torque


def read_backstepping_params(vehicle: Vehicle, gains: Table) -> BacksteppingParams:
    """Read ``[attitude_backstepping]``: c = [c1 … c6] and the feed-forward gains."""
    c = gains.numbers("c", 6, 0.0, 1e4)
    feedforward = (
        gains.number("rate_feedforward", 0.0, 1.0),
        gains.number("acceleration_feedforward", 0.0, 1.0),
    )
    gains.finish()
    inertias = *vehicle.inertia_kg_m2, vehicle.mean_rotor_inertia_kg_m2
    return BacksteppingParams._make((*c, *feedforward, *inertias))


CONTROLLER = AttitudeController(
    "backstepping",
    attitude_backstepping_step,
    BacksteppingMemory,
    BacksteppingParams,
    (0.0,),
    read_backstepping_params,
    BACKSTEPPING_TUNABLES,
)
