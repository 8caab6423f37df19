"""``gcs fly`` and ``gcs sim``: commands that start simulator and flight stack, for a plan or until Ctrl-C."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from flightstack.process import collection
from flightstack.process.command_line import IN_OUTPUT, PanelCommand, expand_options, make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.fly_flags import FlyOptions, RunOptions, complete_options
from gcs_cli.settings import FlownInstanceOption, FlownTimeoutOption, JsonOption, output_of, settings_of
from gcs_cli.sim.sim_flags import PLAN_FIELDS, SimOptions

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
    from gcs_cli.fly.processes import prepare  # noqa: PLC0415  # --help has no use for it

    with settings_of(context).prepared or prepare() as programs:
        with collection.paused():
            from gcs_cli.fly.fly_run import run_fly

        run_fly(complete_options(context, "fly", options, run), run, out, programs)


@app.command(cls=PanelCommand)
@partial(expand_options, without=PLAN_FIELDS)
def sim(
    context: typer.Context,
    options: SimOptions,
    instance: FlownInstanceOption = None,
    timeout: FlownTimeoutOption = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Open the live view; its end ends the simulation.", **IN_OUTPUT)
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate one or several vehicles for any MAVLink client.

    Starts simulator and flight stack of each vehicle, in real time, and prints the addresses for MAVSDK,
    QGroundControl and gcs. Ctrl-C ends all of them.
    """
    out = output_of(context, as_json)
    if watch and out.as_json:
        raise CliError("give either --watch or --json: the view needs the terminal", USAGE)
    from gcs_cli.fly.processes import prepare  # noqa: PLC0415  # --help has no use for it

    with settings_of(context).prepared or prepare() as programs:
        with collection.paused():
            from gcs_cli.sim.sim_run import simulate

        run = RunOptions(instance=instance, timeout=timeout)
        simulate(complete_options(context, "sim", options, run), out, watch, programs)
