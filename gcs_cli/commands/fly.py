"""``gcs fly``: simulator, flight stack and ground station in one command, from plan to report.

A module of its own, as each command: it is imported when it is used.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.process.command_line import IN_OUTPUT, PanelCommand, expand_options, make_app
from gcs_cli.fly.fly_flags import FlyOptions, RunOptions, complete_options

app = make_app(add_completion=False)


@app.command(cls=PanelCommand)
@expand_options
def fly(
    context: typer.Context,
    options: FlyOptions,
    run: RunOptions,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Directory of the results.  [default: runs/<stamp>-<plan>]",
            **IN_OUTPUT,
        ),
    ] = None,
) -> None:
    """Fly a mission in simulation and write log, summary and report."""
    from gcs_cli.fly.fly_run import run_fly

    run_fly(complete_options(context, "fly", options, run), run, out)
