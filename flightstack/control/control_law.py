"""Interface of control laws: of attitude, position, guidance and mixer (``controller``).

A package of a user registers a law of attitude, an ``AttitudeController``, in the entry point group
``flightstack.attitude_controllers`` (``controller_loading``) of its own ``pyproject.toml``; ``--controller name``
selects it. docs/tutorials/controller.md shows an example, and laws of the other roles.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from flightstack.control.law_sources import LawSources, law_sources
from flightstack.core.contract import AttitudeReference, Quaternion, Vector3
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import Vehicle


class CStep(NamedTuple):
    """A step written in C by hand, for loops in C and targets.

    ``header`` declares the type ``memory``, ``void <init>(memory *)`` and ``void <step>(memory *, inputs, const
    params *, fs_real dt_s, outputs)``, with the inputs and outputs of the law's role. The step changes the memory in
    place, a copy that is dropped if the output is not finite. The header includes ``<name>_params.h``, generated, with
    the structure of ``params_type``, and ``fs_types.h``.
    """

    header: Path
    sources: tuple[Path, ...]
    memory: str
    init: str
    step: str


class ControlLaw(NamedTuple):
    """A control law: a pure step function and the types of its memory and parameters.

    ``step(memory, …, params, dt_s, …) -> (memory, output)`` is marked ``@compiled``; the rest of its signature is that
    of its role in ``Controller``. ``memory_type`` and ``params_type`` are NamedTuples of at least one field, floats
    only; a reset restores ``initial_memory``. ``read_params(vehicle, gains)`` returns the parameters from the vehicle
    and the table ``[<role>_<name>]`` of the gains file, which is empty if the file has none.

    ``tunables`` declares the fields of ``params_type`` that are vehicle parameters, readable and writable in flight.
    Without it, all fields are, with names derived from law and field.
    """

    name: str
    step: Callable[..., Any] | CStep
    memory_type: type
    params_type: type
    initial_memory: tuple[float, ...]
    read_params: Callable[[Vehicle, Table], tuple[float, ...]]
    tunables: tuple[Tunable, ...] | None = None

    @property
    def key(self) -> str:
        """Name and hash of sources and constants, so that a change of the law invalidates its cached kernel."""
        used = self._used
        digest = hashlib.sha256("\n".join(used.constants).encode())
        for source in used.files:
            digest.update(source.read_bytes())
        return f"{re.sub(r'[^0-9A-Za-z]', '_', self.name)}_{digest.hexdigest()[:12]}"

    @property
    def sources(self) -> list[Path]:
        """The source files of the law and of the functions that it calls, but for those of this project."""
        return self._used.files

    @property
    def _used(self) -> LawSources:
        if isinstance(self.step, CStep):
            return LawSources([self.step.header, *self.step.sources], [])
        return law_sources(self.step, (self.memory_type, self.params_type))


class AttitudeInputs(NamedTuple):
    """Inputs of an attitude controller in one tick.

    ``error_rad`` is the rotation from the vehicle to the reference as a rotation vector in the body frame; for a
    rotation about one axis it is the angle error. ``relative_rotor_speed_rad_s`` is the paper's Ω_r from the previous
    tick. ``saturation`` is −1, 0 or +1 for each axis: the direction in which the mixer was saturated.
    """

    attitude: Quaternion
    rates_frd_rad_s: Vector3
    reference: AttitudeReference
    error_rad: Vector3
    relative_rotor_speed_rad_s: float
    saturation: Vector3


AttitudeController: TypeAlias = ControlLaw
"""A law of attitude: ``step(memory, inputs, params, dt_s) -> (memory, torque)``.

``inputs`` are ``AttitudeInputs``; the torque is a ``Vector3`` in N m about the body axes.
"""


class NoMemory(NamedTuple):
    """Placeholder: a law without state; a memory type needs at least one field."""

    unused: float


class NoParams(NamedTuple):
    """Placeholder: a law without parameters; a type of parameters needs at least one field."""

    unused: float


def c_law(
    name: str,
    step: CStep,
    params_type: type,
    read_params: Callable[[Vehicle, Table], tuple[float, ...]],
    tunables: tuple[Tunable, ...] | None = None,
) -> ControlLaw:
    """Return a law written in C; see ``CStep`` and ``ControlLaw``."""
    return ControlLaw(name, step, NoMemory, params_type, (0.0,), read_params, tunables)
