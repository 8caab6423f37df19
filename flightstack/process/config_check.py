"""Check a configuration without building the stack, for commands that start it as another process."""

from __future__ import annotations

import math

from flightstack.control.controller import controller_of
from flightstack.control.controller_loading import check_python, load_controller
from flightstack.control.loop_parameters import loop_numbers
from flightstack.core.errors import ConfigError
from flightstack.firmware.c_loops import LoopsSetup
from flightstack.firmware.choice import PYTHON, parse_loops
from flightstack.firmware.law_tree import law_tree
from flightstack.params.config import ESTIMATED, STATES, StackConfig
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import Vehicle, load_vehicle
from flightstack.process.clock import Rates, rates
from flightstack.vehicle.parameters import read_parameters

DIRECTORY_HINT = "; the directory is --state-dir"
"""End of the refusal of a state in a program that has this option."""


def check_state(state: str, hint: str = "") -> None:
    """Raise ConfigError for an unknown kind of state; ``hint`` ends its text."""
    if state not in STATES:
        raise ConfigError("--state", state, f"is not one of {', '.join(STATES)}{hint}")


def vehicle_of(config: StackConfig) -> Vehicle:
    """Load the vehicle; raise ConfigError."""
    check_state(config.state)
    vehicle = load_vehicle(config.vehicle)
    if config.state == ESTIMATED and not vehicle.sensors.numbers:
        raise ConfigError(
            "--state", config.state, f"needs sensors, and {config.vehicle} has none: add [sensors]"
        )
    return vehicle.with_ideal_rotors() if config.ideal_rotors else vehicle


def loops_setup(config: StackConfig, loop_rates: Rates) -> LoopsSetup:
    """Return the configuration of the loops; raise ConfigError."""
    return LoopsSetup(
        vehicle_of(config),
        load_controller(config.controller),
        open_gains(config.gains),
        math.radians(config.behaviour.max_tilt_deg),
        loop_rates.inner_hz,
        loop_rates.outer_hz,
        loop_rates.divisor,
    )


def check(config: StackConfig) -> None:
    """Raise ConfigError for a configuration that ``build`` refuses; neither compile loops nor open a target."""
    setup = loops_setup(config, rates(config.inner_hz, config.outer_hz))
    if parse_loops(config.loops).kind != PYTHON:
        from flightstack.firmware.targets import check_loops  # noqa: PLC0415  # 40 ms that loops in Python save

        check_loops(config.loops)
        setup.numbers()
        law_tree(setup.controller)
    else:
        check_python(controller_of(setup.controller))
    numbers = loop_numbers(setup.vehicle, setup.controller, setup.gains, setup.max_tilt_rad)
    read_parameters(config, numbers.specs)
