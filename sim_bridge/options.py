"""The options of ``sim-bridge`` and ``sim-bridge open-loop``, each with its type and its help."""

from __future__ import annotations

from typing import Annotated

import typer

# of both commands
Vehicle = Annotated[str, typer.Option(help="Built-in vehicle (paper_quad, x_quad) or a TOML file.")]
Plant = Annotated[str, typer.Option(help="rigid, multibody (MuJoCo), or paper (small angles).")]
Wind = Annotated[str, typer.Option(metavar="N,E[,D]", help="Steady wind, m/s.")]
Gust = Annotated[float, typer.Option(help="Standard deviation of the gusts, m/s.")]
Drag = Annotated[
    bool, typer.Option("--drag", help="Fly with the optional drag of the vehicle's file, so that wind acts.")
]
Force = Annotated[str, typer.Option(metavar="N,E,D", help="Constant external force, N.")]
Torque = Annotated[str, typer.Option(metavar="X,Y,Z", help="Constant external torque, body FRD, N m.")]
TorqueGust = Annotated[
    float, typer.Option(help="Standard deviation of a gusty torque about roll and pitch, N m.")
]
Seed = Annotated[int, typer.Option(help="Seed of the gusts.")]

# of the simulator
Speed = Annotated[str, typer.Option(metavar="max|N", help="N times real time, or as fast as it goes.")]
Host = Annotated[str, typer.Option(help="Address to listen on.")]
Port = Annotated[int | None, typer.Option(help="TCP port; 0 takes a free one.  [default: 4560 + instance]")]
Instance = Annotated[int, typer.Option(help="Number of the vehicle, from 0.")]
IdealRotors = Annotated[
    bool,
    typer.Option("--ideal-rotors", help="Rotors without limits, without lag and without spin-up torque."),
]
PhysicsHz = Annotated[float, typer.Option(help="Lowest rate of the integration steps.")]
BatteryStart = Annotated[
    float | None, typer.Option(metavar="PERCENT", help="Charge at the start.  [default: 100]")
]
BatteryCapacity = Annotated[
    float | None, typer.Option(metavar="MAH", help="Capacity.  [default: the vehicle's]")
]
BatteryDrain = Annotated[
    float | None, typer.Option(metavar="FACTOR", help="Let the charge fall so many times as fast.")
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SPEC",
        help="rotor:N:off, rotor:N:weak=SHARE, rotor:N:stuck=RAD_S, state:freeze, state:nan, state:drop or "
        "battery:level=SHARE, each with @BEGIN or @BEGIN-END in seconds; may be repeated.",
    ),
]
Home = Annotated[str, typer.Option(metavar="LAT,LON,ALT", help="Where the vehicle stands.")]
View = Annotated[bool, typer.Option("--view", help="Show the vehicle in a window.")]
Timeout = Annotated[
    float | None,
    typer.Option(
        help="Seconds to wait for the flight stack.  [default: for ever to connect, then 30 to answer]"
    ),
]

# of an open-loop flight
Rotors = Annotated[str, typer.Option(metavar="W1,W2,…", help="Rotor speeds, rad/s, held constant.")]
Seconds = Annotated[float, typer.Option(help="Time to fly.")]
Position = Annotated[str, typer.Option(metavar="N,E,D", help="Position at the start, m.")]
Velocity = Annotated[str, typer.Option(metavar="N,E,D", help="Velocity at the start, m/s.")]
EulerDeg = Annotated[str, typer.Option(metavar="ROLL,PITCH,YAW", help="Attitude at the start.")]
Rates = Annotated[str, typer.Option(metavar="P,Q,R", help="Body rates FRD at the start, rad/s.")]
Step = Annotated[float, typer.Option(help="Step of the integration, s.")]
NoGround = Annotated[bool, typer.Option("--no-ground", help="Fly without a ground.")]
NoLag = Annotated[
    bool,
    typer.Option("--no-lag", help="Rotors turn at their speeds from the start."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
