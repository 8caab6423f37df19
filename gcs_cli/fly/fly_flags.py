"""The options of a flight in simulation: one table for ``gcs fly``, ``gcs pil`` and the processes that they start.

A field with an option is an option of both commands. Those in ``TO_SIMULATOR`` and ``TO_STACK`` are passed on
unchanged; ``NOT_PASSED`` lists the other options of simulator and flight stack.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from flightstack.core.port_numbers import ground_station_port, simulator_port
from flightstack.process import command_line as world
from flightstack.process import options as stack
from gcs_cli.errors import USAGE, CliError
from gcs_cli.settings import (
    FlownInstanceOption,
    FlownTimeoutOption,
    JsonOption,
    LinkOptions,
    OpenOption,
    OverwriteOption,
    given_options,
    settings_of,
)
from gcs_cli.transfers.plan_files import DEFAULT_PLAN, PlanArgument

LONGEST_S = 1e6
"""Longest limit of a flight [s of simulated time]."""


def _ranged(option: Any, low: float, high: float) -> Any:
    """Return a copy of an option with its allowed range."""
    ranged = copy.copy(option)
    ranged.min, ranged.max = low, high
    return ranged


@dataclass(frozen=True)
class FlyOptions:
    """The plan, the vehicle and the conditions of a flight."""

    plan_path: PlanArgument = Path(DEFAULT_PLAN)
    controller: stack.Controller = "pid"
    gains: stack.Gains = "tuned"
    plant: Annotated[str, world.PLANT] = "rigid"
    speed: Annotated[str, world.SPEED] = "max"
    inner_hz: stack.InnerHz = 500.0
    outer_hz: stack.OuterHz = None
    seed: Annotated[int, _ranged(world.SEED, 0, 2**31 - 1)] = 1
    wind: Annotated[str | None, world.WIND] = None
    gust: Annotated[float | None, _ranged(world.GUST, 0.0, 50.0)] = None
    torque_gust: Annotated[float | None, _ranged(world.TORQUE_GUST, 0.0, 100.0)] = None
    vehicle: Annotated[str, world.VEHICLE] = "paper_quad"
    instance: int = 0
    ideal_rotors: Annotated[bool, world.IDEAL_ROTORS] = False
    timeout_s: float = 180.0
    limit_s: Annotated[
        float | None,
        typer.Option(
            "--limit",
            metavar="SECONDS",
            min=1.0,
            max=LONGEST_S,
            help="Longest flight, in simulated time.  [default: 60 s more than three times the plan's]",
            **world.IN_SIMULATION,
        ),
    ] = None
    battery_start: Annotated[float | None, _ranged(world.BATTERY_START, 0.0, 100.0)] = None
    battery_capacity: Annotated[float | None, _ranged(world.BATTERY_CAPACITY, 1.0, 1e6)] = None
    battery_drain: Annotated[float | None, _ranged(world.BATTERY_DRAIN, 0.0, 1e4)] = None
    faults: Annotated[list[str] | None, world.FAULTS] = None
    params: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Parameter file to fly with.  [default: none]", **world.IN_VEHICLE),
    ] = None
    loops: stack.Loops = "python"
    state: stack.State = "estimated"
    force: Annotated[str | None, world.FORCE] = None
    torque: Annotated[str | None, world.TORQUE] = None
    physics_hz: Annotated[float | None, world.PHYSICS_HZ] = None
    slope: Annotated[float | None, world.SLOPE] = None
    boat: Annotated[str | None, world.BOAT] = None
    home: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON,ALT",
            help="Start position of the vehicle, degrees and m.  [default: the plan's home]",
            **world.IN_VEHICLE,
        ),
    ] = None
    param: stack.Assignments = None
    view: Annotated[bool, world.VIEW] = False
    drag: Annotated[bool, world.DRAG] = False
    signing_key: Path | None = None

    @property
    def speed_factor(self) -> float:
        """Speed of the flight as a multiple of real time; infinite for ``max``."""
        return math.inf if self.speed == "max" else float(self.speed)

    @property
    def gcs_port(self) -> int:
        """UDP port of other ground stations."""
        return ground_station_port(self.instance)

    @property
    def simulator_port(self) -> int:
        """TCP port on which the simulator listens."""
        return simulator_port(self.instance)


TO_SIMULATOR = (
    "vehicle", "plant", "speed", "instance", "seed", "wind", "gust", "drag", "force", "torque", "torque_gust",
    "physics_hz", "slope", "boat", "battery_start", "battery_capacity", "battery_drain", "faults",
    "ideal_rotors", "view", "state",
)  # fmt: skip
TO_STACK = (
    "vehicle",
    "controller",
    "gains",
    "loops",
    "state",
    "inner_hz",
    "instance",
    "param",
    "ideal_rotors",
)

_SET = "set by gcs fly"
_LOCAL = "the links of this flight stay on this machine"
NOT_PASSED = {
    "host": _SET, "port": _SET, "sim_host": _SET, "sim_port": _SET, "gcs": _SET, "gcs_port": _SET,
    "wait_for_start": _SET, "exit_on_gcs_loss": _SET, "clock": "lockstep: the flight is the same at any speed",
    "head_start": "set by gcs fly for a vehicle on its sensors", "timeout": "--timeout of gcs fly",
    "sim_timeout": "--timeout of gcs fly", "log": "--out of gcs fly",
    "params": "--params of gcs fly, which creates no file", "outer_hz": "--outer-hz of gcs fly",
    "home": "--home of gcs fly, or the plan's home", "overwrite": "--overwrite of gcs fly",
    "state_dir": "none: a flight depends on its command line alone",
    "api_port": _LOCAL, "tcp_port": _LOCAL, "listen": _LOCAL, "signing_key": "--signing-key of gcs",
    "allow_unsigned": _LOCAL, "check": "gcs fly checks before it starts anything", "version": "gcs --version",
}  # fmt: skip
"""Options of simulator and flight stack that are not passed on unchanged, each with the reason."""


def flag_of(name: str) -> str:
    """Return the flag of a field."""
    return "--fault" if name == "faults" else f"--{name.replace('_', '-')}"


def passed(options: FlyOptions, names: Sequence[str]) -> list[str]:
    """Return the command line arguments of the fields ``names`` that are set."""
    arguments: list[str] = []
    for name in names:
        value, flag = getattr(options, name), flag_of(name)
        if value is True:
            arguments.append(flag)
        elif isinstance(value, list | tuple):
            arguments += [f"{flag}={item}" for item in value]
        elif value is not None and value is not False:
            arguments.append(f"{flag}={value}")
    return arguments


@dataclass(frozen=True)
class ResultOptions:
    """The options of a command that writes a directory of results."""

    overwrite: OverwriteOption = False
    open_report: OpenOption = False
    as_json: JsonOption = False


@dataclass(frozen=True)
class RunOptions(ResultOptions):
    """The options of a command that starts a vehicle of its own."""

    instance: FlownInstanceOption = None
    timeout: FlownTimeoutOption = None


Options = TypeVar("Options", bound=FlyOptions)


def complete_options(context: typer.Context, command: str, options: Options, run: RunOptions) -> Options:
    """Return the options with those given before the command; raise CliError (usage) for ``--connect``."""
    settings = settings_of(context)
    if settings.link.connect is not None:
        raise CliError(
            f"{command} starts a vehicle of its own: leave --connect out, or see --instance", USAGE
        )
    link = given_options(context, LinkOptions(timeout=run.timeout, instance=run.instance))
    timeout_s = FlyOptions.timeout_s if link.timeout is None else link.timeout
    return replace(
        options, instance=link.instance or 0, timeout_s=timeout_s, signing_key=settings.signing_key
    )
