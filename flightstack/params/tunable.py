"""Declarations of the numbers of a control law that a user may tune, each beside the law that uses it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from flightstack.params.spec import LARGEST_NAME, ParamSpec

UNDECLARED_LIMIT = 1e6
"""Range, both ways, of the parameters of a controller that declares none."""


class Tunable(NamedTuple):
    """One field of a law's NamedTuple of parameters, as a parameter of the vehicle.

    The default is no part of it: that is what the vehicle and its gains file give. What is derived from the vehicle
    (mass, inertia) is no parameter and has no declaration. A C table of a law is its NamedTuple's fields in order, with
    the name, range and scale of the declaration that names the field.
    """

    field: str
    name: str
    low: float
    high: float
    unit: str
    help: str
    decimals: int = 3
    integrates: str = ""
    """The field of the law's memory that this gain multiplies. It is scaled when the gain changes, so that the integral
    term goes on from where it is."""


def spec_of(tunable: Tunable, default: float, group: str) -> ParamSpec:
    """Return the declaration with its default, whose range a gains file in other units may have stretched."""
    return ParamSpec(
        tunable.name,
        default,
        min(tunable.low, default),
        max(tunable.high, default),
        tunable.unit,
        tunable.help,
        group=group,
        decimals=tunable.decimals,
    )


def undeclared(controller: str, fields: Sequence[str]) -> tuple[Tunable, ...]:
    """Declare every field of a controller that declares none: ``lqr``'s ``angle_roll`` is LQR_ANGLE_ROLL.

    At most four characters of the controller's name, then the field, cut to what MAVLink carries. Where two names
    become one, the later ones end in a number.
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
    """Tell what is wrong with the declarations of a law whose parameters and memory have these fields, or None."""
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
        return f"remembers no {tunable.integrates!r}"
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
