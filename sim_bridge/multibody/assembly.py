"""The assembly of a vehicle: its parts, tuned so that they weigh what the vehicle file says.

Mass, centre of gravity and inertia come from shapes and densities alone. Sizes of the usual parts, and densities of
those that a vehicle file lets go, are turned until the whole has the file's mass and inertia, its centre of gravity in
the origin and no products of inertia; the densities of the propellers until each rotor has its inertia. What cannot be
met is in ``Assembly.misses``, and it flies as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.params.vehicle import Rotor, Vehicle
from sim_bridge.multibody.mass import MassProperties, about_point
from sim_bridge.multibody.placing import PlacedPart, of_all, of_body, place
from sim_bridge.multibody.solver import meet
from sim_bridge.multibody.usual_parts import LIMITS, Knobs, arm_m, usual_parts

_DENSITY_LIMIT = math.log(3.0)
_LEAST_ROTOR_SHARE = 1e-6
"""Of the vehicle's inertia: a rotor cannot be without any, even where the file says so."""

_TAKEN = frozenset({"ground", "pad"})  # by the model and the scene
_WEIGHTS = np.array([30.0] * 4 + [1.0] * 6)
"""Where not all can be met, mass and centre of gravity come first: without them it does not even hover."""

_LEAST_KG, _LEAST_KG_M2 = 1e-9, 1e-14

TOLERANCE = 1e-3
"""Share beyond which the user is told."""


class Assembly(NamedTuple):
    """A tuned assembly."""

    parts: tuple[PlacedPart, ...]
    whole: MassProperties  # about the centre of gravity, in the axes FRD of the frame
    misses: dict[str, float]
    """By how much it misses, as shares: of mass and moments of inertia, of the arm length for the centre of gravity,
    of the largest moment for the products."""

    @property
    def worst_miss(self) -> float:
        """The largest of ``misses``."""
        return max(self.misses.values())

    def worst_line(self) -> str:
        """One sentence on how well it meets the vehicle file."""
        name = max(self.misses, key=lambda key: self.misses[key])
        return f"{len(self.parts)} parts meet the vehicle file within {self.misses[name]:.2g} ({name})"


@lru_cache(maxsize=32)
def assemble(vehicle: Vehicle) -> Assembly:
    """Return the tuned assembly of a vehicle; the same vehicle gives the same bits. Raises ConfigError for a mesh."""
    given = [placed for part in vehicle.parts for placed in place(vehicle, part)]
    names = {placed.part.name for placed in given}
    if len(names) < len(given) or names & _TAKEN:
        taken = next(placed.part.name for placed in given if _is_taken(placed.part.name, given))
        raise ConfigError(vehicle.name, "part", f"{taken!r} is the name of two things: copies are numbered")
    tuned = [index for index, placed in enumerate(given) if placed.part.tune]
    usual_knobs = len(Knobs._fields) if vehicle.default_parts else 0

    def build(x: FloatArray) -> list[PlacedPart]:
        values = x.tolist()
        parts = list(given)
        for index, knob in zip(tuned, values[usual_knobs:], strict=True):
            parts[index] = _denser(parts[index], math.exp(knob))
        if vehicle.default_parts:
            usual = usual_parts(vehicle, Knobs(*values[:usual_knobs]))
            parts += [placed for placed in usual if placed.part.name not in names]
        return _with_rotor_inertia(vehicle, parts)

    ladder = [np.array([*limits[:usual_knobs], *[_DENSITY_LIMIT] * len(tuned)]) for limits in LIMITS]
    knobs = meet(_miss_of(vehicle, build), ladder) if len(ladder[0]) else ladder[0]
    parts = build(knobs)
    frame = of_body(parts, 0)
    if frame.mass_kg < _LEAST_KG or np.linalg.eigvalsh(frame.inertia_kg_m2)[0] < _LEAST_KG_M2:
        raise ConfigError(vehicle.name, "part", "nothing on the frame weighs anything: add parts to it")
    return Assembly(tuple(parts), of_all(vehicle, parts), _misses(vehicle, parts))


def _is_taken(name: str, given: list[PlacedPart]) -> bool:
    return name in _TAKEN or sum(placed.part.name == name for placed in given) > 1


def _denser(placed: PlacedPart, factor: float) -> PlacedPart:
    return placed._replace(part=replace(placed.part, density_kg_m3=factor * placed.part.density_kg_m3))


def _with_rotor_inertia(vehicle: Vehicle, parts: list[PlacedPart]) -> list[PlacedPart]:
    """Give the parts of each rotor the density with which it has its inertia; a rotor without parts gets a disc."""
    ready = [placed for placed in parts if placed.body == 0]
    for number, rotor in enumerate(vehicle.rotors, start=1):
        own = [placed for placed in parts if placed.body == number] or [
            placed for placed in usual_parts(vehicle, Knobs()) if placed.body == number
        ]
        factor = _rotor_inertia(vehicle, rotor) / float(of_body(own, number).inertia_kg_m2[2, 2])
        ready += [_denser(placed, factor) for placed in own]
    return ready


def _rotor_inertia(vehicle: Vehicle, rotor: Rotor) -> float:
    return max(rotor.inertia_kg_m2, _LEAST_ROTOR_SHARE * vehicle.inertia_kg_m2[2])


def _miss_of(
    vehicle: Vehicle, build: Callable[[FloatArray], list[PlacedPart]]
) -> Callable[[FloatArray], FloatArray]:
    """Return what must become zero: mass, centre of gravity, moments and products of inertia, as weighted shares."""

    def miss(x: FloatArray) -> FloatArray:
        return _WEIGHTS * _miss(vehicle, of_all(vehicle, build(x)))

    return miss


def _miss(vehicle: Vehicle, whole: MassProperties) -> FloatArray:
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


_NAMES = (
    "mass", "centre of gravity x", "centre of gravity y", "centre of gravity z",
    "Ix", "Iy", "Iz", "Ixy", "Ixz", "Iyz",
)  # fmt: skip


def _misses(vehicle: Vehicle, parts: list[PlacedPart]) -> dict[str, float]:
    values = np.abs(_miss(vehicle, of_all(vehicle, parts))).tolist()
    misses = dict(zip(_NAMES, values, strict=True))
    for number, rotor in enumerate(vehicle.rotors, start=1):
        own = float(of_body(parts, number).inertia_kg_m2[2, 2])
        wanted = _rotor_inertia(vehicle, rotor)
        misses[f"inertia of rotor {number}"] = abs(own / wanted - 1.0)
    return misses
