"""Interface of attitude controllers.

A controller is a module-level ``AttitudeController``, registered in the entry point group
``flightstack.attitude_controllers`` (``controller_loading``). A user's package registers its controller in its own
``pyproject.toml`` and selects it with ``--controller name``; docs/tutorials/controller.md shows an example.
"""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from flightstack.core.contract import AttitudeReference, Quaternion, Vector3
from flightstack.core.kernel_cache import is_own
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import Vehicle


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


class AttitudeController(NamedTuple):
    """An attitude controller: a pure step function and the types of its memory and parameters.

    ``step(memory, inputs, params, dt_s) -> (memory, torque)`` is marked ``@compiled``; torque is a
    ``Vector3`` in N m about the body axes. ``memory_type`` and ``params_type`` are NamedTuples of at least one field,
    floats only; a reset restores ``initial_memory``. ``read_params(vehicle, gains)`` returns the parameters from the
    vehicle and the table ``[attitude_<name>]`` of the gains file, which is empty if the file has none.

    ``tunables`` declares the fields of ``params_type`` that are vehicle parameters, readable and writable in flight.
    Without it, all fields are, with names derived from controller and field.
    """

    name: str
    step: Callable[..., Any]
    memory_type: type
    params_type: type
    initial_memory: tuple[float, ...]
    read_params: Callable[[Vehicle, Table], tuple[float, ...]]
    tunables: tuple[Tunable, ...] | None = None

    @property
    def key(self) -> str:
        """Name and source hash, so that a change of the controller invalidates its cached kernel."""
        digest = hashlib.sha256()
        for source in self.sources:
            digest.update(source.read_bytes())
        return f"{re.sub(r'[^0-9A-Za-z]', '_', self.name)}_{digest.hexdigest()[:12]}"

    @property
    def sources(self) -> list[Path]:
        """The source files of the law."""
        return _sources(self.step.__module__)


def _sources(module_name: str) -> list[Path]:
    """Return the module's file and, in a package, all files of its directory tree, which the law may use."""
    module = sys.modules[module_name]
    if module.__file__ is None:
        return []
    path = Path(module.__file__)
    if not module.__package__ or is_own(module_name):  # the key of the cache directory covers its imports
        return [path]
    return sorted(path.parent.rglob("*.py"))
