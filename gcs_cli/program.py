"""The command line of ``gcs``: options, commands and their groups."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from flightstack.process.command_line import Version, expand_options, make_app
from flightstack.process.console import replace_unencodable
from gcs_cli.commands.registry import GcsGroup, add_groups
from gcs_cli.output import run_command
from gcs_cli.settings import LinkOptions, Settings, SigningKeyOption, given_options, settings_of

if TYPE_CHECKING:
    from flightstack.process.supervised import PreparedPrograms

app = make_app(
    name="gcs",
    cls=GcsGroup,
    help="Ground station on the command line: fly missions, command and watch a vehicle over MAVLink.",
    no_args_is_help=True,
)
add_groups(app)


@app.callback()
@expand_options
def options(
    context: typer.Context,
    link: LinkOptions,
    signing_key: SigningKeyOption = None,
    version: Version = False,  # its callback does all
) -> None:
    """Keep the options that are given before the command."""
    before = settings_of(context)  # of a shell, or of the start of the program
    context.obj = replace(
        before, link=given_options(context, link), signing_key=signing_key or before.signing_key
    )


def run(argv: list[str], prepared: PreparedPrograms | None = None) -> int:
    """Run a command line; return the exit code. ``prepared`` are the programs of a command that starts some.

    An error is one sentence on stderr; with ``--json`` it is also an object on stdout.
    """
    replace_unencodable()
    start = Settings(prepared=prepared)
    return run_command(
        lambda: app(argv, prog_name="gcs", standalone_mode=False, obj=start), as_json="--json" in argv
    )
