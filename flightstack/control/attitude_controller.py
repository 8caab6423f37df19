"""What an attitude controller is, and where the stack finds one by name.

A controller is a value of ``AttitudeController`` in a module, announced by the entry point group
``flightstack.attitude_controllers``. A user's package adds one in its own ``pyproject.toml`` and flies it with
``--controller name``; docs/controllers.md shows an example.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NamedTuple

from flightstack.contract import AttitudeReference, Quaternion, Vector3
from flightstack.params.errors import ConfigError
from flightstack.params.toml_reader import Table
from flightstack.params.vehicle import Vehicle

ENTRY_POINT_GROUP = "flightstack.attitude_controllers"


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

    ``step(memory, inputs, params, dt_s) -> (memory, torque)`` is marked ``@compiled``; torque is a ``Vector3``
    in N m about the body axes. ``memory_type`` and ``params_type`` are NamedTuples of floats only;
    ``initial_memory`` is what a reset restores. ``read_params(vehicle, gains)`` makes the parameters from the
    vehicle and the controller's table of the gains file (None when the file has none).
    """

    name: str
    step: Callable[..., Any]
    memory_type: type
    params_type: type
    initial_memory: tuple[float, ...]
    read_params: Callable[[Vehicle, Table | None], tuple[float, ...]]

    @property
    def key(self) -> str:
        """Identify name and source text, so that a cached kernel is never an older controller's."""
        module = sys.modules[self.step.__module__]
        source = Path(module.__file__).read_bytes() if module.__file__ else b""
        return f"{self.name}_{hashlib.sha256(source).hexdigest()[:12]}"


def controller_names() -> list[str]:
    """Return the names of the installed attitude controllers."""
    return sorted(point.name for point in entry_points(group=ENTRY_POINT_GROUP))


def load_controller(name: str) -> AttitudeController:
    """Return the installed attitude controller ``name``; raise ConfigError if there is none or it is broken."""
    points = entry_points(group=ENTRY_POINT_GROUP, name=name)
    if not points:
        raise ConfigError("--controller", name, f"is not one of {', '.join(controller_names())}")
    try:
        controller = next(iter(points)).load()
    except Exception as error:  # a user's package may fail in any way: report it as theirs
        raise ConfigError("--controller", name, f"cannot be loaded: {error}") from error
    if not isinstance(controller, AttitudeController):
        raise ConfigError("--controller", name, "its entry point is not an AttitudeController")
    return controller
