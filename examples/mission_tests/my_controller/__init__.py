"""A PD attitude controller with acceleration feedforward, as a plug-in of flightstack."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.control.attitude_controller import AttitudeController, AttitudeInputs
from flightstack.core.compiled import compiled
from flightstack.core.contract import Vector3
from flightstack.params.toml_file import Table
from flightstack.params.vehicle import Vehicle


class Memory(NamedTuple):
    """The law has no memory; a NamedTuple needs one field."""

    unused: float


class Params(NamedTuple):
    """Gains and inertias of roll, pitch and yaw."""

    angle_xy: float
    rate_xy: float
    angle_z: float
    rate_z: float
    ix_kg_m2: float
    iy_kg_m2: float
    iz_kg_m2: float


@compiled
def step(memory: Memory, inputs: AttitudeInputs, params: Params, dt_s: float) -> tuple[Memory, Vector3]:
    """Return the torque of a second-order response to the error of attitude and rates."""
    error, rates = inputs.error_rad, inputs.rates_frd_rad_s
    wanted, ahead = inputs.reference.rates_frd_rad_s, inputs.reference.acceleration_frd_rad_s2
    roll = params.angle_xy * error.x + params.rate_xy * (wanted.x - rates.x) + ahead.x
    pitch = params.angle_xy * error.y + params.rate_xy * (wanted.y - rates.y) + ahead.y
    yaw = params.angle_z * error.z + params.rate_z * (wanted.z - rates.z) + ahead.z
    return memory, Vector3(params.ix_kg_m2 * roll, params.iy_kg_m2 * pitch, params.iz_kg_m2 * yaw)


def read_params(vehicle: Vehicle, gains: Table) -> Params:
    """Read ``[attitude_pd]``: natural frequencies [rad/s] of roll and pitch, and of yaw; the damping is critical."""
    tilt_rad_s, yaw_rad_s = gains.numbers("frequency_rad_s", 2, 0.1, 100.0, (14.0, 5.0))
    gains.finish()
    return Params(tilt_rad_s**2, 2.0 * tilt_rad_s, yaw_rad_s**2, 2.0 * yaw_rad_s, *vehicle.inertia_kg_m2)


CONTROLLER = AttitudeController("pd", step, Memory, Params, (0.0,), read_params)
