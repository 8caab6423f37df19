"""Parity of a user's controller: its generated C in double against its compiled Python, bit for bit."""

from __future__ import annotations

import ctypes
from typing import Any

from flightstack.control.control_law import CStep
from flightstack.control.controller import AnyController, controller_of
from flightstack.core.errors import ConfigError
from flightstack.firmware.build import BuildError, host_library
from flightstack.firmware.law_tree import firmware_for

VECTORS = 1000


def differing_steps(controller: AnyController, count: int = VECTORS) -> int:
    """Return for how many random steps, ``count`` of each law, C has other bits than Python; half have boundary values.

    Raise ConfigError if the law has no C, or the C does not compile.
    """
    try:
        with firmware_for(controller):
            library = ctypes.CDLL(str(host_library("double")))
    except (BuildError, OSError) as error:
        raise ConfigError("--controller", controller.name, f"its C cannot be compiled: {error}") from None
    steps = [law.step for law in controller_of(controller).own_laws.values()]
    return sum(_differing(library, step, count) for step in steps if not isinstance(step, CStep))


def _differing(library: ctypes.CDLL, step: Any, count: int) -> int:
    from flightstack.firmware.generator.call_c import CFunction, Vectors, differences  # noqa: PLC0415
    from flightstack.firmware.generator.unit import Program  # noqa: PLC0415

    function = Program().add(step)
    kinds = Vectors(1, edges=0.0), Vectors(2)
    samples = [kinds[number % 2].arguments(function) for number in range(count)]
    return len(differences(CFunction(library, function), step, samples))
