"""The options of ``gcs sim``: those of a flight in simulation without a plan, and those of the processes that stay."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.port_numbers import INSTANCES
from flightstack.process import command_line as world
from flightstack.process import options as stack
from gcs_cli.fly.fly_flags import FlyOptions

PLAN_FIELDS = ("plan_path", "limit_s")
"""Fields of a flight that ``gcs sim`` does not offer."""


@dataclass(frozen=True)
class SimOptions(FlyOptions):
    """The vehicles and their conditions."""

    speed: Annotated[str, world.SPEED] = "1"
    params: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE|none",
            help="Parameter file, created if there is none; 'none' for none. Several vehicles read it and do not "
            "write it.  [default: vehicle.params in the state directory]",
            **world.IN_VEHICLE,
        ),
    ] = None
    home: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON,ALT",
            help="Start position of the first vehicle, degrees and m.  [default: 47.397742,8.545594,488]",
            **world.IN_VEHICLE,
        ),
    ] = None
    vehicles: Annotated[
        int,
        typer.Option(
            min=1,
            max=INSTANCES,
            metavar="N",
            help="Number of vehicles, each an instance of its own.",
            **world.IN_VEHICLE,
        ),
    ] = 1
    spacing: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=10_000.0,
            metavar="METRES",
            help="Distance between the start positions, to the east.",
            **world.IN_VEHICLE,
        ),
    ] = 5.0
    listen: stack.Listen = "127.0.0.1"
    gcs: stack.GroundStations = None
    log: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|none",
            help="Log file; 'none' for no log. Of several vehicles each has a folder instance-N beside it.  "
            "[default: runs/<stamp>-flight.ulg, or runs/instance-<instance>/<stamp>-flight.ulg]",
            **world.IN_OUTPUT,
        ),
    ] = None
    overwrite: stack.Overwrite = False
    state_dir: Annotated[
        str | None,
        typer.Option(
            metavar="DIR|none",
            help="Directory for parameters, mission, geofence, rally points and home, restored at the next start; "
            "'none' for none. Of several vehicles each has a folder instance-N in it.  "
            "[default: runs/state-<instance>; none with --params none]",
            **world.IN_OUTPUT,
        ),
    ] = None


TO_STACK = ("listen", "gcs", "overwrite")
"""Options of the flight stack that are passed on unchanged, besides those of ``gcs fly``."""
