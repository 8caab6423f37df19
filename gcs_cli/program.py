"""The command line of ``gcs``: options, commands and their groups."""

from __future__ import annotations

import typer

from flightstack.process.command_line import Version, expand_options, make_app
from flightstack.process.console import replace_unencodable
from gcs_cli.commands.registry import GcsGroup, add_groups
from gcs_cli.output import run_command
from gcs_cli.settings import LinkOptions, Settings, SigningKeyOption, given_options, settings_of

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
    before = settings_of(context)  # of a shell
    context.obj = Settings(given_options(context, link), signing_key or before.signing_key, before.lent)


def run(argv: list[str]) -> int:
    """Run a command line; return the exit code.

    An error is one sentence on stderr; with ``--json`` it is also an object on stdout.
    """
    replace_unencodable()
    return run_command(lambda: app(argv, prog_name="gcs", standalone_mode=False), as_json="--json" in argv)
