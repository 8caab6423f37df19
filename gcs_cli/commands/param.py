"""``gcs param list|search|get|set|reset|save|load|diff``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.mavlink.param_values import Parameter
from flightstack.params.param_file import is_parameter_name
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.commands.confirmation import YesOption, confirm_if_armed
from gcs_cli.completion import parameter_names
from gcs_cli.errors import FAILED, USAGE, CliError, VehicleLostError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output
from gcs_cli.parameter_names_generated import NAMES
from gcs_cli.settings import LinkOptions, OverwriteOption, output_of
from gcs_cli.tables import table_console
from gcs_cli.transfers import param_calls
from gcs_cli.vehicle.param_info import UNKNOWN, ParamInfo, load_parameters, render_parameters
from gcs_cli.vehicle.param_search import search_parameters, suggestion
from gcs_cli.vehicle.param_table import (
    change_line,
    description,
    facts,
    is_changed,
    is_pattern,
    matching,
    parameter_table,
)
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

NameArgument = Annotated[
    str, typer.Argument(metavar="NAME", show_default=False, autocompletion=parameter_names)
]


@app.command("list")
@expand_options
def list_parameters(
    context: typer.Context,
    link: LinkOptions,
    pattern: Annotated[
        str,
        typer.Argument(
            metavar="[PATTERN]", help="Part of the name, or a pattern: MPC_*.", show_default=False
        ),
    ] = "*",
) -> None:
    """List the parameters; highlight those not at their default."""
    with connect_vehicle(context, link) as connection:
        found = matching(param_calls.fetch_all(connection), pattern)
        infos = param_calls.fetch_metadata(connection) if found else {}
    if not found:
        raise CliError(f"no parameter matches {pattern}")
    _show(found, infos, output_of(context, link))


@app.command()
@expand_options
def search(
    context: typer.Context,
    link: LinkOptions,
    words: Annotated[
        list[str], typer.Argument(metavar="WORD...", help="Parts of words, in any order.", show_default=False)
    ],
    most: Annotated[int, typer.Option("--most", metavar="N", min=1, help="Largest number of results.")] = 20,
) -> None:
    """Search names and descriptions; misspelt words match too."""
    with connect_vehicle(context, link) as connection:
        parameters = param_calls.fetch_all(connection)
        infos = param_calls.fetch_metadata(connection)
    found = search_parameters(parameters, infos, words)[:most]
    if not found:
        raise CliError(f"no parameter matches {' '.join(words)}")
    _show(found, infos, output_of(context, link))


@app.command()
@expand_options
def get(
    context: typer.Context,
    link: LinkOptions,
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME...",
            help="Names or patterns: 'MPC_*'.",
            show_default=False,
            autocompletion=parameter_names,
        ),
    ],
) -> None:
    """Show parameters with their metadata."""
    with connect_vehicle(context, link) as connection:
        parameters = _fetch_matching(connection, names)
        infos = param_calls.fetch_metadata(connection)
    output = output_of(context, link)
    for parameter in parameters:
        info = infos.get(parameter.name, UNKNOWN)
        output.say("parameter", description(parameter, info), **facts(parameter, infos))


def _fetch_matching(connection: Connection, names: Sequence[str]) -> list[Parameter]:
    """Return the parameters with these names or patterns, each once; raise CliError."""
    found: dict[str, Parameter] = {}
    present = param_calls.fetch_all(connection) if any(map(is_pattern, names)) else ()
    for name in names:
        matches = matching(present, name) if is_pattern(name) else [_fetch(connection, name)]
        if not matches:
            raise CliError(f"no parameter matches {name}")
        found.update({parameter.name: parameter for parameter in matches})
    return list(found.values())


def _fetch(connection: Connection, name: str) -> Parameter:
    """Return one parameter; raise CliError if the vehicle has no such parameter.

    The error suggests similar names of this flight stack and PX4, if the vehicle has them.
    """
    try:
        return param_calls.fetch(connection, name.upper())
    except VehicleLostError:
        raise
    except CliError as error:
        if error.exit_code != FAILED:
            raise
        raise CliError(f"{error}{suggestion(name, NAMES, partial(_is_present, connection))}") from None


def _is_present(connection: Connection, name: str) -> bool:
    try:
        param_calls.fetch(connection, name)
    except CliError:
        return False
    return True


@app.command("set", context_settings={"ignore_unknown_options": True})  # a value may be negative
@expand_options
def set_parameter(
    context: typer.Context,
    link: LinkOptions,
    name: NameArgument,
    value: Annotated[str, typer.Argument(metavar="VALUE", show_default=False)],
) -> None:
    """Set a parameter."""
    number = _number(value)
    with connect_vehicle(context, link) as connection:
        before = _fetch(connection, name)
        after = param_calls.change(connection, name.upper(), number)
        infos = param_calls.fetch_metadata(connection)
    _say_change(output_of(context, link), before, after, infos)


def _say_change(output: Output, before: Parameter, after: Parameter, infos: dict[str, ParamInfo]) -> None:
    info = infos.get(after.name, UNKNOWN)
    output.say(
        "changed",
        change_line(after.name, before.value, after.value, info),
        name=after.name,
        value=after.value,
        before=before.value,
        needs_restart=info.reboot_required,
    )


@app.command()
@expand_options
def reset(
    context: typer.Context,
    link: LinkOptions,
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", show_default=False, autocompletion=parameter_names),
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="All parameters.")] = False,
    yes: YesOption = False,
) -> None:
    """Reset parameters to their defaults.

    With --all, if the vehicle is armed, asks first on a terminal; elsewhere it needs --yes.
    """
    if bool(names) == everything:
        raise CliError("reset: expected names of parameters, or --all", USAGE)
    with connect_vehicle(context, link) as connection:
        if everything:
            confirm_if_armed(connection, "all its parameters will be reset", yes)
            connection.command(calls.RESET_PARAMETERS, "reset of all parameters")
            output_of(context, link).say("reset", "all parameters have their defaults")
        else:
            _reset_some(connection, [name.upper() for name in names or ()], output_of(context, link))


@app.command()
@expand_options
def save(
    context: typer.Context,
    link: LinkOptions,
    file: Annotated[Path, typer.Argument(help="File to write.", show_default=False)],
    overwrite: OverwriteOption = False,
) -> None:
    """Write all parameters to a file, as QGroundControl does."""
    check_new(file, overwrite)
    with connect_vehicle(context, link) as connection:
        parameters = param_calls.fetch_all(connection)
        saved = [parameter for parameter in parameters if is_parameter_name(parameter.name)]
        write_text_atomically(file, render_parameters(saved, *connection.session.target))
    sentence = f"{len(saved)} parameters saved to {file}"
    output_of(context, link).say("saved", sentence, file=str(file), parameters=len(saved))
    if len(saved) < len(parameters):
        names = ", ".join(parameter.name for parameter in parameters if parameter not in saved)
        typer.echo(f"gcs: not saved, not valid as parameter names: {names}", err=True)


@app.command()
@expand_options
def load(
    context: typer.Context,
    link: LinkOptions,
    file: Annotated[
        Path, typer.Argument(help="A file of `gcs param save` or of QGroundControl.", show_default=False)
    ],
    yes: YesOption = False,
) -> None:
    """Set the parameters that a file has; the others stay as they are.

    The order in the file does not matter. If the vehicle refuses a value, none is changed; parameters that it does not
    have are named and left out. If the vehicle is armed, asks first on a terminal; elsewhere it needs --yes.
    """
    wanted = load_parameters(file)
    with connect_vehicle(context, link) as connection:
        confirm_if_armed(connection, f"its parameters will be those of {file}", yes)
        present = {parameter.name: parameter for parameter in param_calls.fetch_all(connection)}
        result = param_calls.change_all(connection, wanted, present)
    changed = len(result.changed)
    sentence = f"{changed} of {len(wanted)} parameters changed"
    output_of(context, link).say("loaded", sentence, file=str(file), changed=changed, parameters=len(wanted))
    for failure in result.failures:
        typer.echo(f"gcs: {failure}", err=True)
    if result.is_undone:
        raise CliError(f"no parameter of {file} was set")
    if result.failures:
        raise CliError(f"{len(result.failures)} of {len(wanted)} parameters of {file} were not set")


@app.command()
@expand_options
def diff(
    context: typer.Context,
    link: LinkOptions,
    file: Annotated[
        Path | None, typer.Argument(help="A parameter file; without it, the defaults.", show_default=False)
    ] = None,
) -> None:
    """Show parameters that differ from the defaults, or from a file."""
    wanted = None if file is None else load_parameters(file)
    with connect_vehicle(context, link) as connection:
        parameters = param_calls.fetch_all(connection)
        infos = param_calls.fetch_metadata(connection)
    if wanted is not None:  # the values of the file take the place of the defaults
        infos = {name: infos.get(name, UNKNOWN)._replace(default=value) for name, value in wanted.items()}
    elif not infos:
        raise CliError(
            "the vehicle does not send the defaults of its parameters: name a file to compare with"
        )
    different = [parameter for parameter in parameters if is_changed(parameter, infos)]
    output = output_of(context, link)
    if different:
        _show(different, infos, output, "file" if file else "default")
    else:
        output.say(
            "equal", f"all parameters are as in {file}" if file else "all parameters have their defaults"
        )
    missing = sorted(set(wanted or ()) - {parameter.name for parameter in parameters})
    if missing:
        output.say("unknown", f"not known to the vehicle: {', '.join(missing)}", names=missing)


def _reset_some(connection: Connection, names: Iterable[str], output: Output) -> None:
    infos = param_calls.fetch_metadata(connection)
    before, defaults = dict[str, Parameter](), dict[str, float]()
    for name in names:
        before[name] = _fetch(connection, name)
        default = infos.get(name, UNKNOWN).default
        if default is None:
            raise CliError(f"{name}: the vehicle does not send its default: use `gcs param set {name} VALUE`")
        defaults[name] = default
    result = param_calls.change_all(connection, defaults, before)
    if result.failures:
        raise CliError(result.failures[0])
    after = before | {parameter.name: parameter for parameter in result.changed}
    for name in before:
        _say_change(output, before[name], after[name], infos)


def _show(
    parameters: Sequence[Parameter], infos: dict[str, ParamInfo], output: Output, compared: str = "default"
) -> None:
    if output.as_json:
        for parameter in parameters:
            output.say("parameter", "", **facts(parameter, infos))
        return
    table_console().print(parameter_table(parameters, infos, compared))


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise CliError(f"{text}: expected a number", USAGE)
    return number
