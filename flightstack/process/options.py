"""The options of the ``flightstack`` command, each with its type and its help, in the order that help shows.

A module of its own: the help of the programs imports no flight stack.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.port_numbers import INSTANCES
from flightstack.process.command_line import IN_LINKS, IN_LOOPS, IN_OUTPUT, IN_VEHICLE

Vehicle = Annotated[
    str, typer.Option(help="Built-in vehicle or a TOML file.", metavar="NAME|FILE", **IN_VEHICLE)
]
Controller = Annotated[
    str,
    typer.Option(
        help="Attitude controller: pid, backstepping, or the name of a plug-in.", metavar="NAME", **IN_LOOPS
    ),
]
Gains = Annotated[
    str,
    typer.Option(
        help="Gains: tuned, paper, paper_rate_fed, backstepping_poles or a TOML file.",
        metavar="NAME|FILE",
        **IN_LOOPS,
    ),
]
InnerHz = Annotated[float, typer.Option(help="Rate of the inner loop.", metavar="HZ", **IN_LOOPS)]
OuterHz = Annotated[
    float | None,
    typer.Option(
        help="Rate of the outer loop; must divide the inner rate.  [default: about 100]",
        metavar="HZ",
        **IN_LOOPS,
    ),
]
Clock = Annotated[
    str,
    typer.Option(help="lockstep (the simulator drives the time) or realtime.", metavar="CLOCK", **IN_LOOPS),
]
Loops = Annotated[
    str,
    typer.Option(
        help="Control loops: python, c (compiled here), or on a target: host (a process), emulated (a Cortex-M4F) "
        "or serial:DEVICE[:BAUD] (a board); TARGET,short sends less, for a slow line; TARGET,free "
        "runs them by the target's own timer, with --clock realtime.",
        metavar="LOOPS",
        **IN_LOOPS,
    ),
]
SimHost = Annotated[str, typer.Option(help="Simulator host.", metavar="HOST", **IN_LINKS)]
SimPort = Annotated[
    int | None, typer.Option(help="Simulator port.  [default: 4560 + instance]", metavar="PORT", **IN_LINKS)
]
SimTimeout = Annotated[float, typer.Option(help="Simulator timeout.", metavar="SECONDS", **IN_LINKS)]
Instance = Annotated[
    int,
    typer.Option(
        min=0, max=INSTANCES - 1, help="Vehicle number; offsets ports and system id.", metavar="N", **IN_LINKS
    ),
]
GroundStations = Annotated[
    list[str] | None,
    typer.Option(
        help="Ground station to send to without being contacted; may be repeated.",
        metavar="HOST:PORT",
        **IN_LINKS,
    ),
]
GcsPort = Annotated[
    int | None,
    typer.Option(
        help="UDP port of the ground station, without --gcs.  "
        "[default: 14550 + instance up to 9; see the MAVLink page]",
        metavar="PORT",
        **IN_LINKS,
    ),
]
ApiPort = Annotated[
    int | None,
    typer.Option(
        help="UDP port of the API client.  [default: 14540 + instance up to 9; see the MAVLink page]",
        metavar="PORT",
        **IN_LINKS,
    ),
]
TcpPort = Annotated[
    int | None,
    typer.Option(
        help="TCP port to listen on; 0 for none.  [default: 5760 + 10 x instance]", metavar="PORT", **IN_LINKS
    ),
]
Listen = Annotated[
    str,
    typer.Option(help="Local address to listen on for MAVLink; 0.0.0.0 for all.", metavar="HOST", **IN_LINKS),
]
SigningKey = Annotated[
    Path | None,
    typer.Option(
        help="Sign MAVLink with the key in this file (created if missing) and refuse unsigned messages.",
        metavar="FILE",
        **IN_LINKS,
    ),
]
AllowUnsigned = Annotated[
    bool,
    typer.Option("--allow-unsigned", help="Accept unsigned messages too, with --signing-key.", **IN_LINKS),
]
LogFile = Annotated[
    str | None,
    typer.Option(
        help="Log file; 'none' for no log. Ground stations can download all logs of its folder.  "
        "[default: runs/<stamp>-flight.ulg, or runs/instance-<instance>/<stamp>-flight.ulg]",
        metavar="FILE|none",
        **IN_OUTPUT,
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an existing log file.", **IN_OUTPUT)]
Assignments = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="Set a parameter; may be repeated.", **IN_VEHICLE),
]
ParamFile = Annotated[
    str | None,
    typer.Option(
        help="Parameter file, created if there is none; 'none' for none.  "
        "[default: vehicle.params in the state directory]",
        metavar="FILE|none",
        **IN_VEHICLE,
    ),
]
State = Annotated[
    str,
    typer.Option(
        help="estimated (from the sensors of the vehicle) or truth (of the simulator).",
        metavar="STATE",
        **IN_LOOPS,
    ),
]
StateDir = Annotated[
    str | None,
    typer.Option(
        help="Directory for parameters, mission, geofence, rally points and home, restored at the next start; "
        "'none' for none.  [default: runs/state-<instance>; none with --params none]",
        metavar="DIR|none",
        **IN_OUTPUT,
    ),
]
Home = Annotated[
    str | None,
    typer.Option(help="Origin of the local frame, degrees and m.", metavar="LAT,LON,ALT", **IN_VEHICLE),
]
IdealRotors = Annotated[
    bool, typer.Option(help="Rotors without lag and limits, as in the paper.", **IN_VEHICLE)
]
WaitForStart = Annotated[
    bool, typer.Option(help="Hold simulated time at zero until a mission is started.", **IN_LOOPS)
]
Check = Annotated[bool, typer.Option("--check", help="Check the configuration, compile the loops and exit.")]
ExitOnGcsLoss = Annotated[
    float | None,
    typer.Option(help="Exit if no ground station is heard for this time.", metavar="SECONDS", **IN_LINKS),
]


@dataclass(frozen=True)
class RunOptions:
    """The options of the command, as given."""

    vehicle: Vehicle = "paper_quad"
    controller: Controller = "pid"
    gains: Gains = "tuned"
    inner_hz: InnerHz = 500.0
    outer_hz: OuterHz = None
    clock: Clock = "lockstep"
    loops: Loops = "python"
    state: State = "estimated"
    sim_host: SimHost = "127.0.0.1"
    sim_port: SimPort = None
    sim_timeout: SimTimeout = 30.0
    instance: Instance = 0
    gcs: GroundStations = None
    gcs_port: GcsPort = None
    api_port: ApiPort = None
    tcp_port: TcpPort = None
    listen: Listen = "127.0.0.1"
    signing_key: SigningKey = None
    allow_unsigned: AllowUnsigned = False
    log: LogFile = None
    overwrite: Overwrite = False
    param: Assignments = None
    params: ParamFile = None
    state_dir: StateDir = None
    home: Home = None
    ideal_rotors: IdealRotors = False
    wait_for_start: WaitForStart = False
    check: Check = False
    exit_on_gcs_loss: ExitOnGcsLoss = None

    @property
    def named_params(self) -> Path | None:
        """The parameter file given on the command line, if any."""
        return None if self.params in (None, "none") else Path(str(self.params))
