"""What an attitude controller is.

A controller is a value of ``AttitudeController`` in a module, announced by the entry point group
``flightstack.attitude_controllers`` (``controller_loading``). A user's package adds one in its own
``pyproject.toml`` and flies it with ``--controller name``; docs/tutorials/controller.md shows an example.
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
    """What an attitude controller sees in one tick.

    ``error_rad`` is the rotation from the vehicle to the reference as a rotation vector in the body frame: on
    one axis it is the angle error itself. ``relative_rotor_speed_rad_s`` is the paper's Ω_r from the previous
    tick. ``saturation`` is −1, 0 or +1 for each axis: the direction in which the mixer could not follow.
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
    ``Vector3`` in N m about the body axes. ``memory_type`` and ``params_type`` are NamedTuples of floats
    only, one at least; ``initial_memory`` is what a reset restores. ``read_params(vehicle, gains)`` makes the
    parameters from the vehicle and the table ``[attitude_<name>]`` of the gains file, which is empty when
    the file has none.

    ``tunables`` declares which fields of ``params_type`` are parameters of the vehicle, to be read and changed in
    flight. Without it, all are, under names made of the controller's and the field's.
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
        """Identify name and source text, so that a cached kernel is never an older controller's."""
        digest = hashlib.sha256()
        for source in _sources(self.step.__module__):
            digest.update(source.read_bytes())
        return f"{re.sub(r'[^0-9A-Za-z]', '_', self.name)}_{digest.hexdigest()[:12]}"


def _sources(module_name: str) -> list[Path]:
    """Return the module's file and, in a package, those beside and below it: the law may call into them."""
    module = sys.modules[module_name]
    if module.__file__ is None:
        return []
    path = Path(module.__file__)
    if not module.__package__ or is_own(module_name):  # ours: the cache directory covers what it imports
        return [path]
    return sorted(path.parent.rglob("*.py"))
