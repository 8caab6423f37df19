"""Load installed controllers, and report in one sentence why one cannot be used."""

from __future__ import annotations

import ast
import functools
import inspect
import os
import re
import sys
import traceback
from collections.abc import Callable
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.control.control_law import ControlLaw, CStep
from flightstack.control.controller import (
    BUILT_IN,
    POSITION,
    STEP_FORMS,
    TILT_FIELD,
    Controller,
    controller_of,
    is_built_in,
)
from flightstack.control.position_pid import POSITION_PID
from flightstack.core.compiled import IS_DISABLED
from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable, declaration_problem, undeclared
from flightstack.params.vehicle import Vehicle

ENTRY_POINT_GROUP = "flightstack.attitude_controllers"
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_PLACE = re.compile(r'File "([^"]+)", line (\d+)| at (/[^\n]+) \((\d+)\)')
_UNKNOWN = re.compile(r"name '(\w+)' is not defined|has no attribute '(\w+)'")
_LONGEST_REASON = 160


def controller_names() -> list[str]:
    """Return the names of the installed controllers."""
    return sorted({point.name for point in entry_points_of_controllers()})


def entry_points_of_controllers() -> EntryPoints:
    """Return the entry points of the installed controllers. Read them again only if a directory changed."""
    return _read_entry_points(tuple((path, _changed_ns(path)) for path in sys.path))


def _changed_ns(path: str) -> int:
    try:
        return os.stat(path or ".").st_mtime_ns
    except OSError:
        return 0


@functools.lru_cache(maxsize=1)
def _read_entry_points(_directories: tuple[tuple[str, int], ...]) -> EntryPoints:
    """Read the files of all installed packages, which takes 10 ms."""
    return entry_points(group=ENTRY_POINT_GROUP)


def controller_error(name: str, problem: str) -> ConfigError:
    """Return the error for a controller; its text lists the installed ones."""
    return ConfigError("--controller", name, f"{problem}; installed are {', '.join(controller_names())}")


def load_controller(name: str) -> Controller:
    """Return the installed controller ``name``; raise ConfigError if it is missing or broken."""
    points = list(entry_points_of_controllers().select(name=name))
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
    return controller_of(controller)


def _owner(point: EntryPoint) -> str:
    return point.value if point.dist is None else point.dist.name


def form_problem(name: str, given: object) -> str | None:
    """Return why ``given`` cannot be used as the controller ``name``, as the end of a sentence, or None."""
    if not isinstance(given, Controller | ControlLaw):
        return "is neither a Controller nor an AttitudeController"
    if given.name != name:
        return f"calls itself {given.name!r}, and must bear the name of its entry point"
    controller = controller_of(given)
    for role, law in controller.laws.items():
        problem = _law_problem(role, law)
        if problem is not None:
            return problem if isinstance(given, ControlLaw) else f"has a law of {role} that {problem}"
    names = [tunable.name for role, law in controller.laws.items() for tunable in law_tunables(role, law)]
    double = next((item for item in names if names.count(item) > 1), None)
    return None if double is None else f"declares the parameter {double} in two laws"


def _law_problem(role: str, law: object) -> str | None:
    if not isinstance(law, ControlLaw):
        return "is not a ControlLaw"
    if is_built_in(role, law) and law.step not in [known.step for known in BUILT_IN[role]]:
        return f"needs another name than {law.name!r}, which is that of a built-in law"
    fields, initial = len(fields_of(law.memory_type)), len(law.initial_memory)
    if fields != initial or not fields:
        return f"has {initial} initial values for the {fields} fields of its memory (one at least)"
    if not fields_of(law.params_type):
        return "has no parameters: params_type must be a NamedTuple of one float at least"
    return _inputs_problem(role, law) or _tunables_problem(law)


def _inputs_problem(role: str, law: ControlLaw) -> str | None:
    if isinstance(law.step, CStep):
        return None
    form, signature = STEP_FORMS[role], inspect.signature(law.step)
    try:
        signature.bind(*form.inputs)
    except TypeError:
        return f"has a step({', '.join(signature.parameters)}), which must take ({', '.join(form.inputs)})"
    return None


def _tunables_problem(law: ControlLaw) -> str | None:
    tunables: object = law.tunables
    if tunables is None:
        return None
    if not isinstance(tunables, tuple) or not all(isinstance(item, Tunable) for item in tunables):
        return "must declare its parameters as a tuple of Tunable"
    return declaration_problem(tunables, fields_of(law.params_type), fields_of(law.memory_type))


def fields_of(kind: type) -> tuple[str, ...]:
    """Return the field names of a NamedTuple, or an empty tuple for any other type."""
    names: tuple[str, ...] = getattr(kind, "_fields", ())
    return names


def law_tunables(role: str, law: ControlLaw) -> tuple[Tunable, ...]:
    """Return the declarations of a law's parameters, derived from its fields if it has none."""
    if law.tunables is not None:
        return law.tunables
    fields = fields_of(law.params_type)
    return undeclared(law.name, [field for field in fields if (role, field) != (POSITION, TILT_FIELD)])


def law_params(role: str, law: ControlLaw, vehicle: Vehicle, gains: Table) -> FloatArray:
    """Return a law's parameters for a vehicle, from its table of the gains file; raise ConfigError."""
    table = gains if law is POSITION_PID else gains.optional_table(f"{role}_{law.name}")
    try:
        values = np.array(law.read_params(vehicle, table), dtype=np.float64)
    except ConfigError:
        raise
    except Exception as error:
        raise controller_error(law.name, f"its parameters cannot be read: {_reason(error)}") from error
    count = len(fields_of(law.params_type))
    if values.shape != (count,) or not np.isfinite(values).all():
        raise controller_error(law.name, f"its read_params must return {count} finite numbers")
    return values


def check_python(controller: Controller) -> None:
    """Raise ConfigError for a law that the loops in Python cannot fly: one in C, or one that is not compiled."""
    for role, law in controller.laws.items():
        if isinstance(law.step, CStep):
            problem = (
                f"its law of {role} is written in C: fly it with --loops c, host, emulated or serial:DEVICE"
            )
            raise ConfigError("--controller", controller.name, problem)
        if not (IS_DISABLED or hasattr(law.step, "py_func")):
            raise controller_error(controller.name, f"its step of {role} is not marked @compiled")


def compile_error(controller: Controller, error: Exception) -> ConfigError:
    """Return the error for a controller whose step does not compile, with reason, file and line of the user."""
    own = controller.own_laws
    sources = sorted({source.resolve() for law in own.values() for source in law.sources})
    place = _unknown_name_place(error, sources) or _own_place(error, sources)
    if place is None:
        for role, law in own.items():
            problem = _result_problem(role, law, sources)
            if problem is not None:
                step = "its step" if len(own) == 1 else f"its step of {role}"
                return controller_error(controller.name, f"{step} {problem}")
    where = f" ({place})" if place else ""
    return controller_error(controller.name, f"its step cannot be compiled: {_reason(error)}{where}")


def _own_place(error: Exception, sources: list[Path]) -> str | None:
    """Return the innermost place in the user's files that the error names."""
    places = [
        (match[1] or match[3], int(match[2] or match[4]))
        for match in _PLACE.finditer(_COLOURS.sub("", str(error)))
    ]
    frames = traceback.extract_tb(error.__traceback__)  # without a compiler, Python's error
    places += [(frame.filename, frame.lineno or 0) for frame in reversed(frames)]
    own = (f"{Path(file).name}, line {line}" for file, line in places if Path(file).resolve() in sources)
    return next(own, None)


def _unknown_name_place(error: Exception, sources: list[Path]) -> str | None:
    """Return the place of a name that does not exist, which Numba's text lacks."""
    text = _COLOURS.sub("", str(error))
    unknown = _UNKNOWN.search(text)
    if unknown is None:
        return None
    function = re.search(r"<function (\w+?)(?:__part)? at", text)
    name = unknown[1] or unknown[2]
    return _first_place(
        sources,
        None if function is None else function[1],
        lambda node: name in (getattr(node, "id", None), getattr(node, "attr", None)),
    )


def _first_place(
    sources: list[Path], function: str | None, is_meant: Callable[[ast.AST], bool]
) -> str | None:
    """Return the first place that ``is_meant`` in the function of this name, or in any function."""
    for source in sources:
        defined = [
            node
            for node in ast.walk(ast.parse(source.read_bytes()))
            if isinstance(node, ast.FunctionDef) and function in (None, node.name)
        ]
        inner = (node for outer in defined for node in ast.walk(outer) if is_meant(node))
        line = min((getattr(node, "lineno", 0) for node in inner), default=None)
        if line is not None:
            return f"{source.name}, line {line}"
    return None


def _result_problem(role: str, law: ControlLaw, sources: list[Path]) -> str | None:
    """Return what is wrong with the result of a step that compiles, unlike the loop around it."""
    form = STEP_FORMS[role]
    wanted = f"({law.memory_type.__name__}, {form.output_type.__name__})"
    part = getattr(law.step, "part", None)
    results = [_type_name(signature.return_type) for signature in getattr(part, "nopython_signatures", ())]
    found = next((result for result in results if result != wanted), None)
    if found is None:
        return None
    name = getattr(law.step, "__name__", None)
    place = _first_place(sources, name, lambda node: isinstance(node, ast.Return)) or _first_place(
        sources, name, lambda node: isinstance(node, ast.FunctionDef)
    )
    where = "" if place is None else f" ({place})"
    return f"must return (memory, {form.output}), of types {wanted}, and returns {found}{where}"


def _type_name(kind: Any) -> str:
    """Return the name of a type of Numba, without the fields of named tuples."""
    if hasattr(kind, "instance_class"):
        return str(kind.instance_class.__name__)
    if hasattr(kind, "types"):
        return f"({', '.join(map(_type_name, kind.types))})"
    return str(kind).replace("none", "None")


def _reason(error: Exception) -> str:
    """Return the first line of an error's text after Numba's own position, without colours.

    Numba colours its text if colorama is installed.
    """
    lines = [line.strip() for line in _COLOURS.sub("", str(error)).splitlines()]
    reasons = [line for line in lines if line and not line.startswith("Failed in")]
    reason = reasons[0] if reasons else type(error).__name__
    return reason if len(reason) <= _LONGEST_REASON else reason[: _LONGEST_REASON - 1] + "…"
