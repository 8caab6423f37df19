"""The assembly of a vehicle: its parts, tuned to the mass properties of the vehicle file.

Mass, centre of gravity and inertia come from shapes and densities alone. Sizes of the default parts, and densities of
parts that a vehicle file marks with ``tune``, are adjusted until the whole has the file's mass and inertia, its centre
of gravity in the origin and no products of inertia; the densities of the propellers until each rotor has its inertia.
The remaining errors are in ``Assembly.errors``; the vehicle flies with them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.params.vehicle import Rotor, Vehicle
from sim_bridge.multibody.default_parts import LIMITS, Adjustments, default_parts
from sim_bridge.multibody.mass import MassProperties, about_point
from sim_bridge.multibody.placing import PlacedPart, of_all, of_body, place
from sim_bridge.multibody.solver import solve
from sim_bridge.plant.dimensions import arm_m

TOLERANCE = 1e-3
"""Relative error above which ``export-mjcf`` warns."""

_DENSITY_LIMIT = math.log(3.0)
_LEAST_ROTOR_SHARE = 1e-6
"""Smallest inertia of a rotor, over that of the vehicle: MuJoCo accepts no body without inertia."""

_RESERVED = frozenset({"ground", "pad"})  # names of the model and the scene
_WEIGHTS = np.array([30.0] * 4 + [1.0] * 6)
"""Mass and centre of gravity come first if not all can be met: without them the vehicle does not hover."""

_LEAST_KG, _LEAST_KG_M2 = 1e-9, 1e-14
_NAMES = (
    "mass", "centre of gravity x", "centre of gravity y", "centre of gravity z",
    "Ix", "Iy", "Iz", "Ixy", "Ixz", "Iyz",
)  # fmt: skip


class Assembly(NamedTuple):
    """A tuned assembly."""

    parts: tuple[PlacedPart, ...]
    whole: MassProperties  # about the centre of gravity, in the axes FRD of the frame
    errors: dict[str, float]
    """Relative errors: of mass and moments of inertia, of the centre of gravity over the arm length, of the products
    of inertia over the largest moment."""

    @property
    def largest_error(self) -> float:
        """The largest of ``errors``."""
        return max(self.errors.values())

    def summary(self) -> str:
        """Return one sentence on how well the assembly meets the vehicle file."""
        name = max(self.errors, key=lambda key: self.errors[key])
        return f"{len(self.parts)} parts meet the vehicle file within {self.errors[name]:.2g} ({name})"


@lru_cache(maxsize=32)
def assemble(vehicle: Vehicle) -> Assembly:
    """Return the tuned assembly of a vehicle; the same vehicle gives the same bits. Raises ConfigError for a mesh."""
    given = _given_parts(vehicle)
    names = {placed.part.name for placed in given}
    tuned = [index for index, placed in enumerate(given) if placed.part.tune]
    count = len(Adjustments._fields) if vehicle.default_parts else 0

    def build(x: FloatArray) -> list[PlacedPart]:
        values = x.tolist()
        parts = list(given)
        for index, logarithm in zip(tuned, values[count:], strict=True):
            parts[index] = _denser(parts[index], math.exp(logarithm))
        if vehicle.default_parts:
            others = default_parts(vehicle, Adjustments(*values[:count]))
            parts += [placed for placed in others if placed.part.name not in names]
        return _with_rotor_inertia(vehicle, parts)

    def residual(x: FloatArray) -> FloatArray:
        return _WEIGHTS * _errors(vehicle, of_all(vehicle, build(x)))

    limits = [np.array([*bounds[:count], *[_DENSITY_LIMIT] * len(tuned)]) for bounds in LIMITS]
    parts = build(solve(residual, limits) if len(limits[0]) else limits[0])
    frame = of_body(parts, 0)
    if frame.mass_kg < _LEAST_KG or np.linalg.eigvalsh(frame.inertia_kg_m2)[0] < _LEAST_KG_M2:
        raise ConfigError(vehicle.name, "part", "the frame has no mass: add parts to it")
    return Assembly(tuple(parts), of_all(vehicle, parts), _named_errors(vehicle, parts))


def _given_parts(vehicle: Vehicle) -> list[PlacedPart]:
    """Return the parts of the vehicle file; raise ConfigError for a name that is not unique."""
    given = [placed for part in vehicle.parts for placed in place(vehicle, part)]
    names = [placed.part.name for placed in given]
    for name in names:
        if name in _RESERVED:
            raise ConfigError(vehicle.name, "part", f"{name!r} is a reserved name; rename the part")
        if names.count(name) > 1:
            raise ConfigError(vehicle.name, "part", f"{name!r} is the name of two parts; copies are numbered")
    return given


def _denser(placed: PlacedPart, factor: float) -> PlacedPart:
    return placed._replace(part=replace(placed.part, density_kg_m3=factor * placed.part.density_kg_m3))


def _with_rotor_inertia(vehicle: Vehicle, parts: list[PlacedPart]) -> list[PlacedPart]:
    """Set the density of each rotor's parts from its inertia; a rotor without parts gets a disc."""
    ready = [placed for placed in parts if placed.body == 0]
    for number, rotor in enumerate(vehicle.rotors, start=1):
        own = [placed for placed in parts if placed.body == number] or [
            placed for placed in default_parts(vehicle, Adjustments()) if placed.body == number
        ]
        factor = _rotor_inertia(vehicle, rotor) / float(of_body(own, number).inertia_kg_m2[2, 2])
        ready += [_denser(placed, factor) for placed in own]
    return ready


def _rotor_inertia(vehicle: Vehicle, rotor: Rotor) -> float:
    return max(rotor.inertia_kg_m2, _LEAST_ROTOR_SHARE * vehicle.inertia_kg_m2[2])


def _errors(vehicle: Vehicle, whole: MassProperties) -> FloatArray:
    """Return the signed relative errors in the order of ``_NAMES``."""
    inertia = whole.inertia_kg_m2 + about_point(whole.mass_kg, whole.centre_m)
    wanted = np.array(vehicle.inertia_kg_m2)
    return np.concatenate(
        [
            [whole.mass_kg / vehicle.mass_kg - 1.0],
            whole.centre_m / arm_m(vehicle),
            np.diag(inertia) / wanted - 1.0,
            inertia[[0, 0, 1], [1, 2, 2]] / wanted.max(),
        ]
    )


def _named_errors(vehicle: Vehicle, parts: list[PlacedPart]) -> dict[str, float]:
    values = np.abs(_errors(vehicle, of_all(vehicle, parts))).tolist()
    errors = dict(zip(_NAMES, values, strict=True))
    for number, rotor in enumerate(vehicle.rotors, start=1):
        own = float(of_body(parts, number).inertia_kg_m2[2, 2])
        wanted = _rotor_inertia(vehicle, rotor)
        errors[f"inertia of rotor {number}"] = abs(own / wanted - 1.0)
    return errors


def tuned_masses(vehicle: Vehicle, assembly: Assembly) -> dict[str, float]:
    """Return by part the mass over its untuned mass, that of the default part or of the vehicle file."""
    given = [placed for part in vehicle.parts for placed in place(vehicle, part)]
    untuned = {placed.part.name: placed for placed in [*default_parts(vehicle, Adjustments()), *given]}
    return {
        placed.part.name: placed.properties().mass_kg / untuned[placed.part.name].properties().mass_kg
        for placed in assembly.parts
    }


def mass_table(vehicle: Vehicle, assembly: Assembly) -> str:
    """Return a table of the parts with material, density and mass, and of the whole beside the vehicle file."""
    lines = [*_part_rows(vehicle, assembly), "", *_whole_rows(vehicle, assembly)]
    products = max(assembly.errors[name] for name in ("Ixy", "Ixz", "Iyz"))
    lines.append(f"products of inertia are below {products:.1e} of the largest moment")
    lines.append("the densities of the propellers are set by the inertia J of each rotor")
    return "\n".join(lines)


def _part_rows(vehicle: Vehicle, assembly: Assembly) -> list[str]:
    rows = [
        f"{'part':<16}{'shape':<10}{'material':<13}{'kg/m³':>8}{'g':>10}{'× default':>11}"
        f"{'x':>10}{'y':>10}{'z, m FRD':>10}"
    ]
    factors = tuned_masses(vehicle, assembly)
    for placed in assembly.parts:
        part, own = placed.part, placed.properties()
        x, y, z = own.centre_m
        if placed.body:
            x, y, z = own.centre_m + np.array(vehicle.rotors[placed.body - 1].position_frd_m)
        rows.append(
            f"{part.name:<16}{part.shape:<10}{part.material:<13}{part.density_kg_m3:>8.0f}"
            f"{own.mass_kg * 1e3:>10.2f}{factors[part.name]:>11.2f}{x:>10.4f}{y:>10.4f}{z:>10.4f}"
        )
    return rows


def _whole_rows(vehicle: Vehicle, assembly: Assembly) -> list[str]:
    whole, errors = assembly.whole, assembly.errors
    moments = np.diag(whole.inertia_kg_m2)
    rows = [("mass, kg", whole.mass_kg, vehicle.mass_kg, "mass")]
    rows += [
        (f"{name}, kg m²", float(value), wanted, name)
        for name, value, wanted in zip(("Ix", "Iy", "Iz"), moments, vehicle.inertia_kg_m2, strict=True)
    ]
    rows += [
        (f"centre of gravity {axis}, m", float(value), 0.0, f"centre of gravity {axis}")
        for axis, value in zip("xyz", whole.centre_m, strict=True)
    ]
    for number, rotor in enumerate(vehicle.rotors, start=1):
        about_axis = float(of_body(assembly.parts, number).inertia_kg_m2[2, 2])
        name = f"inertia of rotor {number}"
        rows.append((f"rotor {number} J, kg m²", about_axis, rotor.inertia_kg_m2, name))
    return [f"{'':<24}{'assembly':>16}{'vehicle file':>16}{'error':>10}"] + [
        f"{title:<24}{value:>16.8g}{wanted:>16.8g}{errors[name]:>10.1e}"
        for title, value, wanted, name in rows
    ]
