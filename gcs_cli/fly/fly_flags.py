"""The flags of a flight in simulation: one table for the commands that fly, and for what their children are told.

A field with an option is a flag of ``gcs fly`` and ``gcs pil``. Those in ``TO_SIMULATOR`` and ``TO_STACK`` are passed
on as they are; ``NOT_PASSED`` says what becomes of the children's other options.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from flightstack.core.port_numbers import ground_station_port, simulator_port
from flightstack.process import command_line as world
from flightstack.process import options as stack
from gcs_cli.transfers.plan_files import DEFAULT_PLAN, PlanArgument


@dataclass(frozen=True)
class FlyOptions:
    """What is flown, and under what."""

    plan_path: PlanArgument = Path(DEFAULT_PLAN)
    controller: stack.Controller = "pid"
    gains: stack.Gains = "tuned"
    plant: Annotated[str, world.PLANT] = "rigid"
    speed: Annotated[str, world.SPEED] = "max"
    inner_hz: stack.InnerHz = 500.0
    outer_hz: stack.OuterHz = None
    seed: Annotated[int, world.SEED] = 1
    wind: Annotated[str | None, world.WIND] = None
    gust: Annotated[float | None, world.GUST] = None
    torque_gust: Annotated[float | None, world.TORQUE_GUST] = None
    vehicle: Annotated[str, world.VEHICLE] = "paper_quad"
    instance: int = 0
    ideal_rotors: Annotated[bool, world.IDEAL_ROTORS] = False
    timeout_s: float = 180.0
    limit_s: Annotated[
        float | None,
        typer.Option(
            "--limit",
            help="Longest flight, s of simulated time.  [default: 60 s more than three times the plan's]",
        ),
    ] = None
    battery_start: Annotated[float | None, world.BATTERY_START] = None
    battery_capacity: Annotated[float | None, world.BATTERY_CAPACITY] = None
    battery_drain: Annotated[float | None, world.BATTERY_DRAIN] = None
    faults: Annotated[list[str] | None, world.FAULTS] = None
    params: Annotated[Path | None, typer.Option(help="Parameter file to fly with.  [default: none]")] = None
    loops: stack.Loops = "python"
    force: Annotated[str | None, world.FORCE] = None
    torque: Annotated[str | None, world.TORQUE] = None
    physics_hz: Annotated[float | None, world.PHYSICS_HZ] = None
    home: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON,ALT", help="Where the vehicle stands.  [default: the plan's home]"),
    ] = None
    param: stack.Assignments = None
    view: Annotated[bool, world.VIEW] = False
    drag: Annotated[bool, world.DRAG] = False

    @property
    def outer_rate_hz(self) -> float:
        """Rate of the outer loop: as given, else the one nearest to 100 Hz that divides the inner one."""
        from flightstack.process.clock import nearest_outer_hz  # noqa: PLC0415  # slow to load

        return nearest_outer_hz(self.inner_hz) if self.outer_hz is None else self.outer_hz

    @property
    def speed_factor(self) -> float:
        """How many times real time the flight shall be; infinite for ``max``."""
        return math.inf if self.speed == "max" else float(self.speed)

    @property
    def gcs_port(self) -> int:
        """UDP port of ground stations beside us."""
        return ground_station_port(self.instance)

    @property
    def simulator_port(self) -> int:
        """TCP port on which the simulator listens."""
        return simulator_port(self.instance)


TO_SIMULATOR = (
    "vehicle", "plant", "speed", "instance", "seed", "wind", "gust", "drag", "force", "torque", "torque_gust",
    "physics_hz", "battery_start", "battery_capacity", "battery_drain", "faults", "ideal_rotors", "view",
)  # fmt: skip
TO_STACK = ("vehicle", "controller", "gains", "loops", "inner_hz", "instance", "param", "ideal_rotors")

_SET = "set by gcs fly"
_LOCAL = "the links of this flight stay on this machine"
NOT_PASSED = {
    "host": _SET, "port": _SET, "sim_host": _SET, "sim_port": _SET, "gcs": _SET, "gcs_port": _SET,
    "wait_for_start": _SET, "exit_on_gcs_loss": _SET, "clock": "lockstep: the flight is the same at any speed",
    "timeout": "--timeout of gcs fly", "sim_timeout": "--timeout of gcs fly", "log": "--out of gcs fly",
    "params": "--params of gcs fly, which begins no file", "outer_hz": "--outer-hz of gcs fly",
    "home": "--home of gcs fly, or the plan's home", "overwrite": "--overwrite of gcs fly",
    "state": "none: a flight depends on its command line alone",
    "api_port": _LOCAL, "tcp_port": _LOCAL, "listen": _LOCAL, "signing_key": _LOCAL, "allow_unsigned": _LOCAL,
    "check": "gcs fly checks before it starts anything", "version": "gcs --version",
}  # fmt: skip
"""The children's options that are no flags of ours, or not passed on as they are, each with the reason."""


def flag_of(name: str) -> str:
    """Return the flag of a field, and of a child's option of that name."""
    return "--fault" if name == "faults" else f"--{name.replace('_', '-')}"


def passed(options: FlyOptions, names: Sequence[str]) -> list[str]:
    """Return the command line of a child for the fields ``names``; what was not given is left to the child."""
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


def flies(without: Collection[str] = ()) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the flags of ``FlyOptions`` in place of its parameter ``options``, but for those ``without``."""
    hints = get_type_hints(FlyOptions, include_extras=True)
    flags = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=hints[field.name],
        )
        for field in dataclasses.fields(FlyOptions)
        if field.name not in without and hasattr(hints[field.name], "__metadata__")
    ]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def run(**given: Any) -> None:
            chosen = {flag.name: given.pop(flag.name) for flag in flags}
            command(options=FlyOptions(**chosen), **given)

        own = inspect.signature(command, eval_str=True).parameters
        named = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in own.values()]
        at = list(own).index("options")
        parameters = [*named[:at], *flags, *named[at + 1 :]]
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run

    return decorate
