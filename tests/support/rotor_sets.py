"""Vehicles with any rotor set, without a vehicle file."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hypothesis import strategies as st

from flightstack.params.vehicle import Rotor, Vehicle


def multirotor(
    positions: Sequence[tuple[float, float]],
    spins: Sequence[int],
    *,
    mass_kg: float = 1.0,
    thrust_to_weight: float = 2.0,
    min_speed_rad_s: float = 50.0,
    inertia_kg_m2: tuple[float, float, float] = (0.01, 0.012, 0.02),
) -> Vehicle:
    """Return a vehicle with rotors at ``positions`` (FRD x, y [m])."""
    b, d = 1e-5, 2e-7
    top = math.sqrt(thrust_to_weight * mass_kg * 9.81 / (len(positions) * b))
    rotors = tuple(
        Rotor((x, y, 0.0), spin, b, d, 1e-5, 0.01, min_speed_rad_s, top)
        for (x, y), spin in zip(positions, spins, strict=True)
    )
    return Vehicle("test", "", mass_kg, inertia_kg_m2, (0.0, 0.0, 0.0), 0.1, rotors)


def ring(count: int, radius_m: float = 0.25, first_deg: float = 0.0) -> Vehicle:
    """Return a vehicle with ``count`` rotors evenly on a circle, spins alternating."""
    angles = [math.radians(first_deg + 360.0 * index / count) for index in range(count)]
    positions = [(radius_m * math.cos(angle), radius_m * math.sin(angle)) for angle in angles]
    return multirotor(positions, [1 if index % 2 == 0 else -1 for index in range(count)])


@st.composite
def irregular_vehicles(draw: st.DrawFn) -> Vehicle:
    """Return a ring with irregular angles and radii: rotor thrusts differ in hover."""
    count = draw(st.sampled_from([4, 6, 8]))
    positions = []
    for index in range(count):
        angle = 2.0 * math.pi * index / count + draw(st.floats(-0.15, 0.15))
        radius = draw(st.floats(0.2, 0.3))
        positions.append((radius * math.cos(angle), radius * math.sin(angle)))
    return multirotor(positions, [1 if index % 2 == 0 else -1 for index in range(count)])
