"""Load installed attitude controllers, and report in one sentence why one cannot be used."""

from __future__ import annotations

import re
from importlib.metadata import EntryPoint, entry_points

import numpy as np

from flightstack.control.attitude_controller import AttitudeController
from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable, declaration_problem, undeclared
from flightstack.params.vehicle import Vehicle

ENTRY_POINT_GROUP = "flightstack.attitude_controllers"
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_LONGEST_REASON = 160


def controller_names() -> list[str]:
    """Return the names of the installed attitude controllers."""
    return sorted({point.name for point in entry_points(group=ENTRY_POINT_GROUP)})


def controller_error(name: str, problem: str) -> ConfigError:
    """Return the error for a controller; its text lists the installed ones."""
    return ConfigError("--controller", name, f"{problem}; installed are {', '.join(controller_names())}")


def load_controller(name: str) -> AttitudeController:
    """Return the installed attitude controller ``name``; raise ConfigError if it is missing or broken."""
    points = list(entry_points(group=ENTRY_POINT_GROUP, name=name))
    if not points:
        raise controller_error(name, "there is no such attitude controller")
    if len({point.value for point in points}) > 1:
        owners = ", ".join(sorted(_owner(point) for point in points))
        raise controller_error(name, f"several packages have a controller of this name: {owners}")
    try:
        controller = points[0].load()
    except Exception as error:  # a user's package may raise anything
        raise controller_error(name, f"{points[0].value} cannot be loaded: {_reason(error)}") from error
    problem = form_problem(name, controller)
    if problem is not None:
        raise controller_error(name, f"{points[0].value} {problem}")
    assert isinstance(controller, AttitudeController)
    return controller


def _owner(point: EntryPoint) -> str:
    return point.value if point.dist is None else point.dist.name


def form_problem(name: str, controller: object) -> str | None:
    """Return why ``controller`` cannot be used as the controller ``name``, as the end of a sentence, or None."""
    if not isinstance(controller, AttitudeController):
        return "is not an AttitudeController"
    if controller.name != name:
        return f"calls itself {controller.name!r}, and must bear the name of its entry point"
    fields, initial = len(getattr(controller.memory_type, "_fields", ())), len(controller.initial_memory)
    if fields != initial or not fields:
        return f"has {initial} initial values for the {fields} fields of its memory (one at least)"
    if not getattr(controller.params_type, "_fields", ()):
        return "has no parameters: params_type must be a NamedTuple of one float at least"
    return _tunables_problem(controller)


def _tunables_problem(controller: AttitudeController) -> str | None:
    tunables: object = controller.tunables
    if tunables is None:
        return None
    if not isinstance(tunables, tuple) or not all(isinstance(item, Tunable) for item in tunables):
        return "must declare its parameters as a tuple of Tunable"
    return declaration_problem(tunables, fields_of(controller.params_type), fields_of(controller.memory_type))


def fields_of(kind: type) -> tuple[str, ...]:
    """Return the field names of a NamedTuple, or an empty tuple for any other type."""
    names: tuple[str, ...] = getattr(kind, "_fields", ())
    return names


def controller_tunables(controller: AttitudeController) -> tuple[Tunable, ...]:
    """Return the declarations of the controller's parameters, derived from its fields if it has none."""
    if controller.tunables is not None:
        return controller.tunables
    return undeclared(controller.name, fields_of(controller.params_type))


def controller_params(controller: AttitudeController, vehicle: Vehicle, gains: Table) -> FloatArray:
    """Return the controller's parameters for a vehicle, from its table of the gains file; raise ConfigError."""
    table = gains.optional_table(f"attitude_{controller.name}")
    try:
        values = np.array(controller.read_params(vehicle, table), dtype=np.float64)
    except ConfigError:
        raise
    except Exception as error:
        raise controller_error(controller.name, f"its parameters cannot be read: {_reason(error)}") from error
    count = len(controller.params_type._fields)  # type: ignore[attr-defined]  # checked when it was loaded
    if values.shape != (count,) or not np.isfinite(values).all():
        raise controller_error(controller.name, f"its read_params must return {count} finite numbers")
    return values


def compile_error(name: str, error: Exception) -> ConfigError:
    """Return the error for a controller whose step does not compile, with reason and line."""
    place = re.search(r'File "([^"]+)", line (\d+)', _COLOURS.sub("", str(error)))
    where = f" ({place[1].rsplit('/', 1)[-1]}, line {place[2]})" if place else ""
    return controller_error(name, f"its step cannot be compiled: {_reason(error)}{where}")


def _reason(error: Exception) -> str:
    """Return the first line of an error's text after Numba's own position, without colours.

    Numba colours its text if colorama is installed.
    """
    lines = [line.strip() for line in _COLOURS.sub("", str(error)).splitlines()]
    reasons = [line for line in lines if line and not line.startswith("Failed in")]
    reason = reasons[0] if reasons else type(error).__name__
    return reason if len(reason) <= _LONGEST_REASON else reason[: _LONGEST_REASON - 1] + "…"
