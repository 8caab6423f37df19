"""``gcs replay``: a log as a vehicle that any client can watch.

A module of its own, as each command: it is imported when it is used.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.port_numbers import system_id
from flightstack.process import options as stack
from flightstack.process.command_line import make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.replay.replay_run import ReplayPorts, replay_log
from gcs_cli.settings import FlownInstanceOption, JsonOption, output_of, settings_of

app = make_app(add_completion=False)


@app.command()
def replay(
    context: typer.Context,
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG", help="A ULog or tlog file, or the directory of a flight.", show_default=False
        ),
    ],
    speed: Annotated[float, typer.Option(min=0.1, max=1000.0, metavar="N", help="N times real time.")] = 1.0,
    begin: Annotated[
        float,
        typer.Option(
            "--from", "--seek", min=0.0, max=1e7, metavar="SECONDS", help="Start, from the start of the log."
        ),
    ] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    gcs: stack.GroundStations = None,
    listen: stack.Listen = "127.0.0.1",
    instance: FlownInstanceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Replay a log as a vehicle that any client can watch.

    It sends heartbeats, attitude, position, battery, mode, mission and texts to the ports of a vehicle, and refuses
    commands. The items of the mission are those in the tlog, or in the tlog of the flight's directory.
    With --instance it has the ports and the system id of that instance.
    Keys: space pauses, left and right seek by 10 s, up and down change the speed, home restarts, q ends.
    """
    settings = settings_of(context)
    if settings.link.connect is not None:
        raise CliError("replay is a vehicle of its own: leave --connect out, or see --gcs", USAGE)
    number = settings.link.instance if instance is None else instance
    ports = ReplayPorts(number or 0, gcs or [], listen)
    try:
        system = None if number is None else system_id(number)
        replay_log(log, ports, output_of(context, as_json), speed, begin, loop, system)
    finally:
        ports.close()
