"""Make the loops that fly from the word behind ``--loops``."""

from __future__ import annotations

from pathlib import Path

from flightstack.control.backend import ControlBackend
from flightstack.control.loops import PythonLoops
from flightstack.firmware.build import BuildError, host_library
from flightstack.firmware.c_loops import CLoops, LoopsSetup
from flightstack.firmware.choice import PYTHON, C, parse_loops
from flightstack.firmware.host_library import HostLoops
from flightstack.params.errors import ConfigError


def make_loops(loops: str, setup: LoopsSetup, lockstep: bool = True) -> ControlBackend:
    """Make the loops that ``loops`` names, with all their numbers; raise ConfigError."""
    choice = parse_loops(loops)
    if choice.is_target and not lockstep:
        problem = f"loops on a target ({loops}) fly in lockstep alone: their link keeps no real time"
        raise ConfigError("--clock", "realtime", problem)
    if choice.kind == PYTHON:
        return PythonLoops(
            setup.vehicle,
            setup.controller,
            setup.gains,
            setup.inner_hz,
            setup.outer_hz,
            setup.max_tilt_rad,
        )
    numbers = setup.numbers()
    try:
        if choice.kind == C:
            computer = HostLoops(host_library(), numbers)
            return CLoops(loops, computer, setup)
    except BuildError as error:
        raise ConfigError("--loops", loops, str(error)) from error
    raise ConfigError("--loops", loops, "is not there yet")


def finish_loops(loops: ControlBackend, log: Path | None) -> None:
    """End the loops; raise OSError when what they have to leave beside ``log`` cannot be written."""
    loops.close()
