"""Contact with flat ground: the contact points of a vehicle, their springs, and the forces in compiled code.

Normal force: spring and damper. The damping grows with the depth up to ``ramp``, so that the force is continuous at
touchdown; it never pulls. Friction: a spring and damper to an anchor on the ground, limited to μ·N (Coulomb). At the
limit the anchor slips, once per step. A vehicle at rest therefore stays in place under any force below the limit,
without the creep of a friction law that is regularised in velocity alone (Cundall and Strack, Géotechnique 29, 1979).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import MAX_ROTORS, FloatArray, Vector3
from flightstack.core.linear_algebra import dot, largest_eigenvalue
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle
from sim_bridge.plant.layout import MAX_POINTS

FRICTION = 0.7
DAMPING_RATIO = 0.7
_FREQUENCY_RAD_S = 150.0  # of the vertical bounce: a vehicle at rest sinks in by g/ω² = 0.44 mm
_LARGEST_RATE_STEP = 1.2  # fastest decay rate times step; RK4 is stable up to 2.78
_ROTOR_CLEARANCE_M = 0.02  # smallest height of the rotors above the feet


class ContactModel(NamedTuple):
    """Contact of one vehicle. Stiffness and damping are for the whole vehicle; each point has its share."""

    points_frd_m: FloatArray  # (n, 3)
    shares: FloatArray  # (n,)
    stiffness_n_m: float
    damping_n_s_m: float
    rest_depth_m: float
    foot_z_m: float


def contact_model(vehicle: Vehicle, step_s: float, single_point: bool) -> ContactModel:
    """Design a contact that looks rigid and is stable at the fixed step ``step_s``.

    ``single_point`` puts one contact point into the origin.
    """
    if single_point:
        points, shares, ratio = np.zeros((1, 3)), np.ones(1), 1.0
    else:
        points, shares = _contact_points(vehicle)
        assert len(points) <= MAX_POINTS == 2 * MAX_ROTORS
        feet = len(vehicle.rotors)
        ratio = _highest_mode(vehicle, points[:feet], shares[:feet])
    # the damping matrix is 2ζ/ω times the stiffness matrix: the fastest mode decays at 2ζω·ratio
    frequency = min(_FREQUENCY_RAD_S, _LARGEST_RATE_STEP / (2.0 * DAMPING_RATIO * ratio * step_s))
    return ContactModel(
        points,
        shares,
        vehicle.mass_kg * (frequency * frequency),
        2.0 * DAMPING_RATIO * frequency * vehicle.mass_kg,
        GRAVITY_M_S2 / (frequency * frequency),
        float(points[0, 2]),
    )


def _contact_points(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Return positions and shares: one foot under each rotor, then the rotors, which carry a tumbled vehicle.

    The share of a foot is that of its rotor's thrust in hover, so that all springs sink in equally: the vehicle
    rests level.
    """
    rotors = vehicle.rotors
    at = np.array([rotor.position_frd_m for rotor in rotors])
    squares = zip(rotors, vehicle.hover_speeds_squared(), strict=True)
    load = np.array([rotor.thrust_coefficient_n_s2 * squared for rotor, squared in squares])
    points = np.zeros((2 * len(rotors), 3))
    points[:, :2] = np.tile(at[:, :2], (2, 1))
    foot_z = max(vehicle.leg_height_m, float(at[:, 2].max()))
    points[: len(rotors), 2] = foot_z
    points[len(rotors) :, 2] = np.minimum(at[:, 2], foot_z - _ROTOR_CLEARANCE_M)
    return points, np.tile(load / math.fsum(load), 2)


def _highest_mode(vehicle: Vehicle, points: FloatArray, shares: FloatArray) -> float:
    """Return (highest eigenfrequency of the vehicle on all its springs / frequency of the bounce)²."""
    stiffness = np.zeros((6, 6))
    for (x, y, z), share in zip(points.tolist(), shares.tolist(), strict=True):
        # velocity of the point from (v, ω)
        jacobian = ((1.0, 0.0, 0.0, 0.0, z, -y), (0.0, 1.0, 0.0, -z, 0.0, x), (0.0, 0.0, 1.0, y, -x, 0.0))
        columns = list(zip(*jacobian, strict=True))
        stiffness += share * np.array([[dot(a, b) for b in columns] for a in columns])
    scale = 1.0 / np.sqrt(np.array([1.0] * 3 + [i / vehicle.mass_kg for i in vehicle.inertia_kg_m2]))
    return largest_eigenvalue(stiffness * (scale[:, None] * scale))


@compiled
def normal_force(depth_m: float, sink_m_s: float, stiffness: float, damping: float, ramp_m: float) -> float:
    """Return the upward force [N] on a point ``depth_m`` below the ground that sinks at ``sink_m_s``."""
    if depth_m <= 0.0:
        return 0.0
    return max(0.0, stiffness * depth_m + damping * min(1.0, depth_m / ramp_m) * sink_m_s)


@compiled
def limited(value: float, limit: float) -> float:
    """Clip to ±limit."""
    return min(max(value, -limit), limit)


@compiled
def contact_force(
    position: Vector3,
    velocity: Vector3,
    anchor: FloatArray,
    normal_n: float,
    stiffness: float,
    damping: float,
) -> Vector3:
    """Return the force NED [N] on a point pressed with ``normal_n``; position [m] and velocity [m/s] NED."""
    fx = -stiffness * (position.x - anchor[0]) - damping * velocity.x
    fy = -stiffness * (position.y - anchor[1]) - damping * velocity.y
    size = math.sqrt(fx * fx + fy * fy)
    limit = FRICTION * normal_n
    if size > limit:
        fx, fy = fx * limit / size, fy * limit / size
    return Vector3(fx, fy, -normal_n)


@compiled
def move_anchor(anchor: FloatArray, x: float, y: float, normal_n: float, stiffness: float) -> None:
    """Slip the anchor until its spring is within the friction limit; without load the anchor follows the point."""
    dx, dy = x - anchor[0], y - anchor[1]
    stretch = math.sqrt(dx * dx + dy * dy)
    largest = FRICTION * normal_n / stiffness
    if stretch > largest:
        keep = largest / stretch
        anchor[0], anchor[1] = x - dx * keep, y - dy * keep
