"""Parity of a user's controller: its generated C in double against its compiled Python, bit for bit."""

from __future__ import annotations

import ctypes

from flightstack.control.attitude_controller import AttitudeController
from flightstack.core.errors import ConfigError
from flightstack.firmware.build import BuildError, host_library
from flightstack.firmware.law_tree import firmware_for

VECTORS = 1000


def differing_steps(controller: AttitudeController, count: int = VECTORS) -> int:
    """Return for how many of ``count`` random steps, half with boundary values, C has other bits than Python.

    Raise ConfigError if the law has no C, or the C does not compile.
    """
    from flightstack.firmware.generator.call_c import CFunction, Vectors, differences  # noqa: PLC0415
    from flightstack.firmware.generator.unit import Program  # noqa: PLC0415

    try:
        with firmware_for(controller):
            library = ctypes.CDLL(str(host_library("double")))
    except (BuildError, OSError) as error:
        raise ConfigError("--controller", controller.name, f"its C cannot be compiled: {error}") from None
    function = Program().add(controller.step)
    kinds = Vectors(1, edges=0.0), Vectors(2)
    samples = [kinds[number % 2].arguments(function) for number in range(count)]
    return len(differences(CFunction(library, function), controller.step, samples))
