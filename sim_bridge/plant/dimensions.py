"""Dimensions of a vehicle that follow from its rotors and legs."""

from __future__ import annotations

from flightstack.core.portable_math import distance
from flightstack.params.vehicle import Vehicle

_SPACING_SHARE = 0.44  # propeller radius over the distance of neighbouring rotors


def propeller_radius_m(vehicle: Vehicle) -> float:
    """Return the radius of propellers that do not overlap."""
    at = [rotor.position_frd_m[:2] for rotor in vehicle.rotors]
    between = [distance(a[0] - b[0], a[1] - b[1]) for index, a in enumerate(at) for b in at[:index]]
    gaps = [gap for gap in between if gap > 1e-3]
    return _SPACING_SHARE * min([*gaps, 1.2 * arm_m(vehicle)])


def arm_m(vehicle: Vehicle) -> float:
    """Return the mean distance of the rotors from the vertical axis."""
    return sum(distance(*rotor.position_frd_m[:2]) for rotor in vehicle.rotors) / len(vehicle.rotors)


def foot_z_m(vehicle: Vehicle) -> float:
    """Return the height of the ground, FRD, under a vehicle that stands at its origin, as in the rigid plant."""
    return max(vehicle.leg_height_m, *(rotor.position_frd_m[2] for rotor in vehicle.rotors))
