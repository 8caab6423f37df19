"""Mass, centre of gravity and inertia of solids in closed form.

SI units; inertia matrices are about the centre of gravity, in the axes of their frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.params.vehicle_parts import Part
from sim_bridge.multibody.mesh_file import read_mesh


class MassProperties(NamedTuple):
    """Mass properties of one part or of several parts."""

    mass_kg: float
    centre_m: FloatArray  # (3,)
    inertia_kg_m2: FloatArray  # (3, 3)


def solid(part: Part) -> MassProperties:
    """Return the properties of a part in its own axes, about the origin of its pose."""
    if part.file is not None:
        volume, centre, inertia = mesh_solid(part.file, part.scale)
    else:
        volume, diagonal = _SOLIDS[part.shape](*part.size_m)
        centre, inertia = np.zeros(3), np.diag(diagonal)
    return MassProperties(part.density_kg_m3 * volume, centre, part.density_kg_m3 * inertia)


def transformed(own: MassProperties, rotation: FloatArray, position_m: FloatArray) -> MassProperties:
    """Return the properties in the frame of the pose; ``rotation`` has shape (3, 3)."""
    centre = position_m + rotation @ own.centre_m
    return MassProperties(own.mass_kg, centre, rotation @ own.inertia_kg_m2 @ rotation.T)


def combined(parts: Iterable[MassProperties]) -> MassProperties:
    """Return the properties of several parts, given in one frame, as one body."""
    known = list(parts)
    if not known:
        return MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))
    masses = np.array([part.mass_kg for part in known])
    centres = np.array([part.centre_m for part in known])
    inertia: FloatArray = np.array([part.inertia_kg_m2 for part in known]).sum(axis=0)
    mass = float(masses.sum())
    centre = masses @ centres / mass
    away = centres - centre
    weighted = masses[:, None] * away
    inertia = inertia + (np.vdot(weighted, away) * np.eye(3) - weighted.T @ away)
    return MassProperties(mass, centre, inertia)


def about_point(mass_kg: float, away_m: FloatArray) -> FloatArray:
    """Return Steiner's term: the inertia of a point mass at a distance ``away_m``, shape (3, 3)."""
    share: FloatArray = mass_kg * (away_m @ away_m * np.eye(3) - np.outer(away_m, away_m))
    return share


def _box(x: float, y: float, z: float) -> tuple[float, tuple[float, float, float]]:
    volume = x * y * z
    xx, yy, zz = x * x, y * y, z * z
    return volume, (volume / 12.0 * (yy + zz), volume / 12.0 * (zz + xx), volume / 12.0 * (xx + yy))


def _cylinder(radius: float, length: float) -> tuple[float, tuple[float, float, float]]:
    volume = math.pi * radius**2 * length
    across = volume * (radius**2 / 4.0 + length**2 / 12.0)
    return volume, (across, across, volume * radius**2 / 2.0)


def _sphere(radius: float) -> tuple[float, tuple[float, float, float]]:
    volume = 4.0 / 3.0 * math.pi * radius**3
    return volume, (0.4 * volume * radius**2,) * 3


def _capsule(radius: float, length: float) -> tuple[float, tuple[float, float, float]]:
    shaft, (across, _, along) = _cylinder(radius, length)
    ends, (round_ends, _, _) = _sphere(radius)
    # the centre of gravity of a half sphere is 3/8 of the radius from its base
    across += round_ends + ends * (length**2 / 4.0 + 3.0 / 8.0 * radius * length)
    return shaft + ends, (across, across, along + round_ends)


_SOLIDS: dict[str, Callable[..., tuple[float, tuple[float, float, float]]]] = {
    "box": _box,
    "cylinder": _cylinder,
    "sphere": _sphere,
    "capsule": _capsule,
}


@lru_cache(maxsize=64)
def mesh_solid(file: Path, scale: float) -> tuple[float, FloatArray, FloatArray]:
    """Return volume, centre of gravity and inertia at density 1 of the solid within a closed mesh.

    Each triangle spans a tetrahedron with the origin; the signed sums are those of the solid (Eberly, Polyhedral
    Mass Properties). Raises ConfigError if the mesh encloses no volume.
    """
    corners = read_mesh(file) * scale
    volumes = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volume = float(volumes.sum())
    sums = corners.sum(axis=1)
    first = np.einsum("n,ni->i", volumes, sums) / 4.0
    second = np.einsum("n,nci,ncj->ij", volumes, corners, corners)
    second += np.einsum("n,ni,nj->ij", volumes, sums, sums)
    second /= 20.0
    centre = first / volume
    covariance = second - volume * np.outer(centre, centre)
    return volume, centre, np.trace(covariance) * np.eye(3) - covariance
