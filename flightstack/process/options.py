"""The options of the ``flightstack`` command, each with its type and its help, in the order that help shows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.port_numbers import INSTANCES

Vehicle = Annotated[str, typer.Option(help="Built-in vehicle or TOML file.")]
Controller = Annotated[str, typer.Option(help="Attitude controller: pid, backstepping or yours.")]
Gains = Annotated[
    str, typer.Option(help="Gains: tuned, paper, paper_rate_fed, backstepping_poles or a TOML file.")
]
InnerHz = Annotated[float, typer.Option(help="Rate of the inner loop, Hz.")]
OuterHz = Annotated[
    float | None,
    typer.Option(help="Rate of the outer loop, Hz; divides the inner one.  [default: about 100]"),
]
Clock = Annotated[str, typer.Option(help="lockstep (the simulator owns time) or realtime.")]
Loops = Annotated[
    str,
    typer.Option(
        help="Which loops fly: python, c (compiled here), or those of a target: host (a process), emulated "
        "(a Cortex-M4F), serial:DEVICE[:BAUD] (a board).",
        metavar="LOOPS",
    ),
]
SimHost = Annotated[str, typer.Option(help="Host of the simulator.")]
SimPort = Annotated[int | None, typer.Option(help="Port of the simulator.  [default: 4560 + instance]")]
SimTimeout = Annotated[float, typer.Option(help="Longest wait for the simulator, s.")]
Instance = Annotated[
    int, typer.Option(min=0, max=INSTANCES - 1, help="Number of this vehicle; shifts ports and id.")
]
GroundStations = Annotated[
    list[str] | None,
    typer.Option(help="Ground station to address unasked: HOST:PORT; may be repeated."),
]
GcsPort = Annotated[
    int | None,
    typer.Option(
        help="UDP port of the ground station, without --gcs.  [default: 14550 + instance up to 9; see the MAVLink page]"
    ),
]
ApiPort = Annotated[
    int | None,
    typer.Option(
        help="UDP port of the API client.  [default: 14540 + instance up to 9; see the MAVLink page]"
    ),
]
TcpPort = Annotated[
    int | None, typer.Option(help="TCP port to listen on; 0 for none.  [default: 5760 + 10 x instance]")
]
Listen = Annotated[
    str, typer.Option(help="Address of this machine to listen on for MAVLink; 0.0.0.0 for all.")
]
SigningKey = Annotated[
    Path | None,
    typer.Option(help="Sign MAVLink with the key in this file (made if missing); refuse what is unsigned."),
]
AllowUnsigned = Annotated[
    bool, typer.Option("--allow-unsigned", help="With --signing-key: take unsigned messages as well.")
]
LogFile = Annotated[
    str | None,
    typer.Option(
        help="Log file; 'none' for no log. Ground stations see the logs of its folder.  "
        "[default: runs/<stamp>-flight.ulg, or runs/instance-<instance>/<stamp>-flight.ulg]"
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Let --log replace a file that exists.")]
Assignments = Annotated[
    list[str] | None, typer.Option(metavar="NAME=VALUE", help="Set a parameter; may be repeated.")
]
ParamFile = Annotated[
    str | None,
    typer.Option(
        help="Parameter file; 'none' for none.  [default: vehicle.params in the state directory]",
        metavar="FILE|none",
    ),
]
State = Annotated[
    str | None,
    typer.Option(
        help="Directory of what the vehicle keeps over a restart: parameters, mission, geofence, rally points, home; "
        "'none' for none.  [default: runs/state-<instance>; none with --params none]",
        metavar="DIR|none",
    ),
]
Home = Annotated[str | None, typer.Option(help="LATITUDE,LONGITUDE,ALTITUDE of the local origin.")]
IdealRotors = Annotated[bool, typer.Option(help="Rotors without lag and limits, as the paper assumes.")]
WaitForStart = Annotated[bool, typer.Option(help="Keep time at zero until a mission is started.")]
Check = Annotated[bool, typer.Option("--check", help="Check the configuration, compile the loops, end.")]
ExitOnGcsLoss = Annotated[
    float | None, typer.Option(help="End when no ground station is heard for so long, s.")
]
