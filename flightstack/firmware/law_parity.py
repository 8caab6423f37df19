"""Parity of a user's controller: its generated C in double against its compiled Python, bit for bit."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

from flightstack.control.control_law import CStep
from flightstack.control.controller import AnyController, controller_of
from flightstack.core.errors import ConfigError
from flightstack.firmware.generator.call_c import CFunction, Vectors, differences
from flightstack.firmware.generator.unit import Program
from flightstack.firmware.law_tree import firmware_for
from flightstack.firmware.toolchain.build import BuildError, host_library

VECTORS = 1000


class Parity(NamedTuple):
    """Random steps of a controller's own laws."""

    compared: int
    """0 if every own law is written in C."""
    differing: int
    """Steps for which C has other bits than Python."""


def law_parity(controller: AnyController, count: int = VECTORS) -> Parity:
    """Compare C with Python in ``count`` random steps of each law in Python; half have boundary values.

    Raise ConfigError if the law has no C, or the C does not compile.
    """
    try:
        with firmware_for(controller):
            library = ctypes.CDLL(str(host_library("double")))
    except (BuildError, OSError) as error:
        raise ConfigError("--controller", controller.name, f"its C cannot be compiled: {error}") from None
    laws = controller_of(controller).own_laws.values()
    steps = [law.step for law in laws if not isinstance(law.step, CStep)]
    return Parity(count * len(steps), sum(_differing(library, step, count) for step in steps))


def _differing(library: ctypes.CDLL, step: Any, count: int) -> int:
    function = Program().add(step)
    kinds = Vectors(1, edges=0.0), Vectors(2)
    samples = [kinds[number % 2].arguments(function) for number in range(count)]
    return len(differences(CFunction(library, function), step, samples))
