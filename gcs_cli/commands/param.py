"""``gcs param list|get|set|reset|save|load|diff``."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flightstack.process.command_line import make_app
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.settings import (
    ConnectOption,
    InstanceOption,
    JsonOption,
    OverwriteOption,
    TimeoutOption,
    meet_vehicle,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flightstack.mavlink.param_values import Parameter
    from gcs_cli.link.connection import Connection
    from gcs_cli.vehicle.param_info import ParamInfo

app = make_app(help="The vehicle's parameters.", no_args_is_help=True)

NameArgument = Annotated[str, typer.Argument(metavar="NAME", show_default=False)]
_WIDE = 200  # columns where nobody looks: a pipe or a file
_RESET_ALL = 2.0  # PREFLIGHT_STORAGE, parameter 1


@app.command("list")
def list_parameters(
    context: typer.Context,
    pattern: Annotated[
        str,
        typer.Argument(
            metavar="[PATTERN]", help="A part of the name, or a pattern: MPC_*.", show_default=False
        ),
    ] = "*",
    as_json: JsonOption = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """List the parameters; those that are not at their default stand out."""
    from gcs_cli.transfers import param_calls  # noqa: PLC0415
    from gcs_cli.vehicle.param_table import matching  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        found = matching(param_calls.fetch_all(connection), pattern)
        infos = param_calls.fetch_metadata(connection) if found else {}
    if not found:
        raise CliError(f"no parameter matches {pattern}")
    _show(found, infos, as_json)


@app.command()
def get(
    context: typer.Context,
    name: NameArgument,
    as_json: JsonOption = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Show one parameter."""
    from gcs_cli.transfers import param_calls  # noqa: PLC0415
    from gcs_cli.vehicle.param_info import UNKNOWN  # noqa: PLC0415
    from gcs_cli.vehicle.param_table import description, facts  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        told = param_calls.fetch(connection, name.upper())
        infos = param_calls.fetch_metadata(connection)
    if as_json:
        typer.echo(json.dumps(facts(told, infos)))
    else:
        typer.echo(description(told, infos.get(told.name, UNKNOWN)))


@app.command("set", context_settings={"ignore_unknown_options": True})  # a value may be negative
def set_parameter(
    context: typer.Context,
    name: NameArgument,
    value: Annotated[str, typer.Argument(metavar="VALUE", show_default=False)],
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Set a parameter."""
    from gcs_cli.transfers import param_calls  # noqa: PLC0415
    from gcs_cli.vehicle.param_info import UNKNOWN  # noqa: PLC0415
    from gcs_cli.vehicle.param_table import change_line  # noqa: PLC0415

    number = _number(value)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        before = param_calls.fetch(connection, name.upper())
        after = param_calls.change(connection, name.upper(), number)
        infos = param_calls.fetch_metadata(connection)
    typer.echo(change_line(after.name, before.value, after.value, infos.get(after.name, UNKNOWN)))


@app.command()
def reset(
    context: typer.Context,
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", show_default=False)] = None,
    everything: Annotated[bool, typer.Option("--all", help="All parameters.")] = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Give parameters their defaults back."""
    if bool(names) == everything:
        raise CliError("reset: expected names of parameters, or --all", USAGE)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        if everything:
            _reset_all(connection)
        else:
            _reset_some(connection, [name.upper() for name in names or ()])


@app.command()
def save(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="Where to write them.", show_default=False)],
    overwrite: OverwriteOption = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Write all parameters to a file, as QGroundControl does."""
    from flightstack.core.atomic_file import check_new, write_text_atomically  # noqa: PLC0415
    from flightstack.params.param_file import is_parameter_name  # noqa: PLC0415
    from gcs_cli.transfers import param_calls  # noqa: PLC0415
    from gcs_cli.vehicle.param_file import render_parameters  # noqa: PLC0415

    check_new(file, overwrite)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        told = param_calls.fetch_all(connection)
        kept = [parameter for parameter in told if is_parameter_name(parameter.name)]
        write_text_atomically(file, render_parameters(kept, *connection.session.target))
    typer.echo(f"{len(kept)} parameters saved to {file}")
    if len(kept) < len(told):
        names = ", ".join(parameter.name for parameter in told if parameter not in kept)
        typer.echo(f"gcs: left out, as no parameter can have this name: {names}", err=True)


@app.command()
def load(
    context: typer.Context,
    file: Annotated[
        Path, typer.Argument(help="A file of this command or of QGroundControl.", show_default=False)
    ],
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Set the parameters that a file has; the others stay as they are."""
    from gcs_cli.transfers import param_calls  # noqa: PLC0415
    from gcs_cli.vehicle.param_file import load_parameters  # noqa: PLC0415

    wanted = load_parameters(file)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        present = {told.name: told for told in param_calls.fetch_all(connection)}
        failures: list[str] = []
        changed = 0
        for name, value in wanted.items():
            if name in present and _same(present[name].value, value):
                continue
            try:
                if name not in present:
                    raise CliError(f"{name}: the vehicle has no such parameter")
                param_calls.change(connection, name, value)
                changed += 1
            except CliError as error:
                if error.exit_code != FAILED:
                    raise
                failures.append(str(error))
    typer.echo(f"{changed} of {len(wanted)} parameters changed")
    for failure in failures:
        typer.echo(f"gcs: {failure}", err=True)
    if failures:
        raise CliError(f"{len(failures)} parameters of {file} were not set")


@app.command()
def diff(
    context: typer.Context,
    file: Annotated[
        Path | None, typer.Argument(help="A parameter file; without it, the defaults.", show_default=False)
    ] = None,
    as_json: JsonOption = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Show what differs from the defaults, or from a file."""
    from gcs_cli.transfers import param_calls  # noqa: PLC0415
    from gcs_cli.vehicle.param_file import load_parameters  # noqa: PLC0415
    from gcs_cli.vehicle.param_info import UNKNOWN  # noqa: PLC0415
    from gcs_cli.vehicle.param_table import is_changed  # noqa: PLC0415

    wanted = None if file is None else load_parameters(file)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        told = param_calls.fetch_all(connection)
        infos = param_calls.fetch_metadata(connection)
    if wanted is not None:  # the file takes the place of the defaults
        infos = {name: infos.get(name, UNKNOWN)._replace(default=value) for name, value in wanted.items()}
    elif not infos:
        raise CliError(
            "the vehicle does not tell the defaults of its parameters: name a file to compare with"
        )
    different = [parameter for parameter in told if is_changed(parameter, infos)]
    if different or as_json:
        _show(different, infos, as_json, "file" if file else "default")
    else:
        typer.echo(f"all parameters are as in {file}" if file else "all parameters have their defaults")
    missing = sorted(set(wanted or ()) - {parameter.name for parameter in told})
    if missing and not as_json:
        typer.echo(f"not known to the vehicle: {', '.join(missing)}")


def _reset_all(connection: Connection) -> None:
    from flightstack.mavlink.dialect import mavlink  # noqa: PLC0415
    from gcs_cli.commands.actions import order  # noqa: PLC0415

    order(connection, (int(mavlink.MAV_CMD_PREFLIGHT_STORAGE), (_RESET_ALL,)), "reset of all parameters")
    typer.echo("all parameters have their defaults")


def _reset_some(connection: Connection, names: Iterable[str]) -> None:
    from gcs_cli.transfers import param_calls  # noqa: PLC0415
    from gcs_cli.vehicle.param_info import UNKNOWN  # noqa: PLC0415
    from gcs_cli.vehicle.param_table import change_line  # noqa: PLC0415

    infos = param_calls.fetch_metadata(connection)
    for name in names:
        before = param_calls.fetch(connection, name)
        info = infos.get(name, UNKNOWN)
        if info.default is None:
            raise CliError(f"{name}: the vehicle does not tell its default: use `gcs param set {name} VALUE`")
        after = param_calls.change(connection, name, info.default)
        typer.echo(change_line(name, before.value, after.value, info))


def _show(
    parameters: Sequence[Parameter], infos: dict[str, ParamInfo], as_json: bool, compared: str = "default"
) -> None:
    from gcs_cli.vehicle.param_table import facts, parameter_table  # noqa: PLC0415

    if as_json:
        typer.echo(json.dumps([facts(told, infos) for told in parameters]))
        return
    from rich.console import Console  # noqa: PLC0415

    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDE)
    console.print(parameter_table(parameters, infos, compared))


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise CliError(f"{text}: expected a number", USAGE)
    return number


def _same(one: float, other: float) -> bool:
    from gcs_cli.vehicle.param_info import number_text  # noqa: PLC0415

    return number_text(one) == number_text(other)
