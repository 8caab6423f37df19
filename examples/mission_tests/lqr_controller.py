"""An LQR attitude controller for flightstack."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.control.control_law import AttitudeController, AttitudeInputs
from flightstack.core.compiled import compiled
from flightstack.core.contract import Vector3
from flightstack.params.toml_file import Table
from flightstack.params.vehicle import Vehicle


class Memory(NamedTuple):
    """The law has no memory; a NamedTuple needs one field."""

    unused: float


class Params(NamedTuple):
    """Feedback gains [1/s², 1/s] and inertias of roll, pitch and yaw."""

    angle_roll: float
    angle_pitch: float
    angle_yaw: float
    rate_roll: float
    rate_pitch: float
    rate_yaw: float
    ix_kg_m2: float
    iy_kg_m2: float
    iz_kg_m2: float


@compiled
def step(memory: Memory, inputs: AttitudeInputs, params: Params, dt_s: float) -> tuple[Memory, Vector3]:
    """Compute state feedback around the reference, with its acceleration fed forward."""
    error, rates = inputs.error_rad, inputs.rates_frd_rad_s
    wanted, ahead = inputs.reference.rates_frd_rad_s, inputs.reference.acceleration_frd_rad_s2
    roll = params.angle_roll * error.x + params.rate_roll * (wanted.x - rates.x) + ahead.x
    pitch = params.angle_pitch * error.y + params.rate_pitch * (wanted.y - rates.y) + ahead.y
    yaw = params.angle_yaw * error.z + params.rate_yaw * (wanted.z - rates.z) + ahead.z
    return memory, Vector3(params.ix_kg_m2 * roll, params.iy_kg_m2 * pitch, params.iz_kg_m2 * yaw)


def lqr_gains(angle_rad: float, rate_rad_s: float, acceleration_rad_s2: float) -> tuple[float, float]:
    """Return the gains of one axis, a double integrator, from the largest acceptable values.

    Bryson's rule: Q = diag(1/angle², 1/rate²), R = 1/acceleration²; the Riccati equation has this solution.
    """
    angle_gain = acceleration_rad_s2 / angle_rad
    return angle_gain, math.sqrt((acceleration_rad_s2 / rate_rad_s) ** 2 + 2.0 * angle_gain)


def read_params(vehicle: Vehicle, gains: Table) -> Params:
    """Read ``[attitude_lqr]``. Every key has a default, so that any gains file is accepted."""
    angle = gains.numbers("largest_angle_rad", 3, 1e-3, 3.0, (0.2, 0.2, 0.2))
    rate = gains.numbers("largest_rate_rad_s", 3, 1e-2, 100.0, (2.5, 2.5, 1.0))
    acceleration = gains.numbers("largest_acceleration_rad_s2", 3, 1e-1, 1e4, (40.0, 40.0, 5.0))
    gains.finish()
    pairs = [lqr_gains(*axis) for axis in zip(angle, rate, acceleration, strict=True)]
    angle_gains, rate_gains = zip(*pairs, strict=True)
    return Params(*angle_gains, *rate_gains, *vehicle.inertia_kg_m2)


CONTROLLER = AttitudeController("lqr", step, Memory, Params, (0.0,), read_params)
