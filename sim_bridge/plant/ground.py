"""The contact points of a vehicle and springs that look rigid and stay stable at the plant's step."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import MAX_ROTORS, FloatArray
from flightstack.core.linear_algebra import dot, largest_eigenvalue
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle
from sim_bridge.plant.layout import MAX_POINTS

_FREQUENCY_RAD_S = 150.0  # of the vertical bounce: a vehicle at rest sinks in by g/ω² = 0.44 mm
DAMPING_RATIO = 0.7
_LARGEST_RATE_STEP = 1.2  # fastest decay rate times step; RK4 is stable up to 2.78
_ROTOR_CLEARANCE_M = 0.02  # the rotors lie at least so far above the feet


class Ground(NamedTuple):
    """Contact of one vehicle; the springs are per whole vehicle, each point has its share."""

    points: FloatArray  # (n, 4): position FRD [m], share
    stiffness_n_m: float
    damping_n_s_m: float
    rest_depth_m: float
    foot_z_m: float


def _points(vehicle: Vehicle) -> FloatArray:
    """One foot under each rotor, then the rotors themselves, on which a tumbled vehicle lies.

    Each foot carries what its rotor carries in hover. So all springs sink in equally: it rests level.
    """
    rotors = vehicle.rotors
    at = np.array([rotor.position_frd_m for rotor in rotors])
    squares = zip(rotors, vehicle.hover_speeds_squared(), strict=True)
    load = np.array([rotor.thrust_coefficient_n_s2 * squared for rotor, squared in squares])
    points = np.zeros((2 * len(rotors), 4))
    points[:, :2] = np.tile(at[:, :2], (2, 1))
    foot_z = max(vehicle.leg_height_m, float(at[:, 2].max()))
    points[: len(rotors), 2] = foot_z
    points[len(rotors) :, 2] = np.minimum(at[:, 2], foot_z - _ROTOR_CLEARANCE_M)
    points[:, 3] = np.tile(load / math.fsum(load), 2)
    return points


def _fastest_over_bounce(vehicle: Vehicle, points: FloatArray) -> float:
    """Square of the highest eigenfrequency of the vehicle on all its springs over that of the bounce."""
    stiffness = np.zeros((6, 6))
    for x, y, z, share in points.tolist():
        # velocity of the point from (v, ω)
        jacobian = ((1.0, 0.0, 0.0, 0.0, z, -y), (0.0, 1.0, 0.0, -z, 0.0, x), (0.0, 0.0, 1.0, y, -x, 0.0))
        columns = list(zip(*jacobian, strict=True))
        stiffness += share * np.array([[dot(a, b) for b in columns] for a in columns])
    scale = 1.0 / np.sqrt(np.array([1.0] * 3 + [i / vehicle.mass_kg for i in vehicle.inertia_kg_m2]))
    return largest_eigenvalue(stiffness * (scale[:, None] * scale))


def ground_contact(vehicle: Vehicle, step_s: float, single_point: bool) -> Ground:
    """Design the contact for a plant with fixed step ``step_s``; ``single_point`` puts it into the origin."""
    if single_point:
        points = np.array([[0.0, 0.0, 0.0, 1.0]])
        ratio = 1.0
    else:
        points = _points(vehicle)
        assert len(points) <= MAX_POINTS == 2 * MAX_ROTORS
        ratio = _fastest_over_bounce(vehicle, points[: len(vehicle.rotors)])
    # the damping matrix is 2ζ/ω times the stiffness matrix: the fastest mode decays at 2ζω·ratio
    frequency = min(_FREQUENCY_RAD_S, _LARGEST_RATE_STEP / (2.0 * DAMPING_RATIO * ratio * step_s))
    return Ground(
        points,
        vehicle.mass_kg * (frequency * frequency),
        2.0 * DAMPING_RATIO * frequency * vehicle.mass_kg,
        GRAVITY_M_S2 / (frequency * frequency),
        float(points[0, 2]),
    )
