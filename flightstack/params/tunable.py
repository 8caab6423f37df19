"""Declarations of the tunable parameters of control laws, made beside each law."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from flightstack.params.spec import LARGEST_NAME, ParamSpec

UNDECLARED_LIMIT = 1e6
"""Range, of either sign, of parameters of a controller without declarations."""


class Tunable(NamedTuple):
    """A field of a control law's parameter NamedTuple that is a parameter of the vehicle.

    The default comes from the vehicle and its gains file. Quantities derived from the vehicle (mass, inertia) are no
    parameters.
    """

    field: str
    name: str
    low: float
    high: float
    unit: str
    help: str
    decimals: int = 3
    integrates: str = ""
    """Field of the law's memory that this gain multiplies; scaled when the gain changes so that the integral term is
    continuous."""
    at_least: str = ""
    """Name of the parameter that this one must not be below."""


def spec_of(tunable: Tunable, default: float, group: str) -> ParamSpec:
    """Return the declaration with its default; the range is extended to include the default."""
    return ParamSpec(
        tunable.name,
        default,
        min(tunable.low, default),
        max(tunable.high, default),
        tunable.unit,
        tunable.help,
        group=group,
        decimals=tunable.decimals,
        at_least=tunable.at_least,
    )


def undeclared(controller: str, fields: Sequence[str]) -> tuple[Tunable, ...]:
    """Declare all fields of a controller without declarations: ``lqr``'s ``angle_roll`` becomes LQR_ANGLE_ROLL.

    The name has up to four characters of the controller's name and the field, cut to MAVLink's length. Duplicates get a
    number at the end.
    """
    prefix = _plain(controller)[:4].strip("_") or "CTRL"
    tunables: dict[str, Tunable] = {}
    for field in fields:
        name = _free(f"{prefix}_{_plain(field) or 'P'}"[:LARGEST_NAME], tunables)
        text = f"{field} of the controller {controller}"
        tunables[name] = Tunable(field, name, -UNDECLARED_LIMIT, UNDECLARED_LIMIT, "", text, 6)
    return tuple(tunables.values())


def declaration_problem(
    tunables: Sequence[Tunable], params_fields: Sequence[str], memory_fields: Sequence[str]
) -> str | None:
    """Return the first problem with the declarations of a law with these fields, or None."""
    for tunable in tunables:
        problem = _problem(tunable, params_fields, memory_fields)
        if problem is not None:
            return f"{problem} for its parameter {tunable.name!r}"
    if len({tunable.name for tunable in tunables}) < len(tunables):
        return "declares a parameter twice"
    return None


def _problem(tunable: Tunable, params_fields: Sequence[str], memory_fields: Sequence[str]) -> str | None:
    if not re.fullmatch(r"[A-Z][A-Z0-9_]*", tunable.name) or len(tunable.name) > LARGEST_NAME:
        return f"needs another name (A to Z, 0 to 9 and _, at most {LARGEST_NAME})"
    if tunable.field not in params_fields:
        return f"has no field {tunable.field!r}"
    if tunable.integrates and tunable.integrates not in memory_fields:
        return f"has no field {tunable.integrates!r} in its memory"
    if not (math.isfinite(tunable.low) and math.isfinite(tunable.high) and tunable.low < tunable.high):
        return "has no range"
    return None


def _plain(text: str) -> str:
    return re.sub(r"[^0-9A-Z]+", "_", text.upper()).strip("_")


def _free(name: str, taken: Iterable[str]) -> str:
    candidate, number = name, 2
    while candidate in taken:
        ending = f"_{number}"
        candidate = name[: LARGEST_NAME - len(ending)] + ending
        number += 1
    return candidate
