"""``gcs sim``: vehicle and simulator together, until Ctrl-C.

A module of its own, as each command: it is imported when it is used.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from flightstack.process.command_line import IN_OUTPUT, PanelCommand, expand_options, make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.fly_flags import RunOptions, complete_options
from gcs_cli.settings import FlownInstanceOption, FlownTimeoutOption, JsonOption, output_of
from gcs_cli.sim.sim_flags import PLAN_FIELDS, SimOptions

app = make_app(add_completion=False)


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
    from gcs_cli.sim.sim_run import simulate

    run = RunOptions(instance=instance, timeout=timeout)
    simulate(complete_options(context, "sim", options, run), out, watch)
