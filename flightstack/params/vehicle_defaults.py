"""Default parameters of a vehicle: the optional table ``[params]`` of a vehicle file, as PX4's airframe defaults."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping

from flightstack.params.behaviour import SPECS
from flightstack.params.estimator import ESTIMATOR_SPECS
from flightstack.params.spec import ParamSpec
from flightstack.params.toml_file import Table

Defaults = tuple[tuple[str, float], ...]
"""Names and values of parameters whose default is the vehicle's own."""

_ALLOWED: Mapping[str, ParamSpec] = {**SPECS, **ESTIMATOR_SPECS}


def read_defaults(top: Table) -> Defaults:
    """Read the table ``[params]``; raise ConfigError for an unknown name, or a value outside its range.

    Parameters of control laws are not allowed: their defaults are those of the gains file.
    """
    table = top.optional_table("params")
    return tuple((name, _default(table, name)) for name in table.values())


def _default(table: Table, name: str) -> float:
    spec = _ALLOWED.get(name)
    if spec is None:
        near = difflib.get_close_matches(name, _ALLOWED, n=1)
        hint = f"; did you mean {near[0]}?" if near else "; those of control laws belong to the gains file"
        raise table.error(name, f"is no parameter of guidance, commander or estimator{hint}")
    accepted = spec.accepted(table.number(name, -math.inf, math.inf))
    if isinstance(accepted, str):
        raise table.error(name, accepted)
    return accepted


def with_defaults(specs: Iterable[ParamSpec], defaults: Defaults) -> list[ParamSpec]:
    """Return the declarations, with the vehicle's own defaults instead of the general ones."""
    own = dict(defaults)
    return [spec._replace(default=own[spec.name]) if spec.name in own else spec for spec in specs]
