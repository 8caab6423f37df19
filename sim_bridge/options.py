"""The options of ``sim-bridge`` and ``sim-bridge open-loop``, each with its type and its help."""

from __future__ import annotations

from typing import Annotated

import typer

from flightstack.process import command_line as shared

# of both commands
Vehicle = Annotated[str, shared.VEHICLE]
Plant = Annotated[str, shared.PLANT]
Wind = Annotated[str, shared.WIND]
Gust = Annotated[float, shared.GUST]
Drag = Annotated[bool, shared.DRAG]
Force = Annotated[str, shared.FORCE]
Torque = Annotated[str, shared.TORQUE]
TorqueGust = Annotated[float, shared.TORQUE_GUST]
Seed = Annotated[int, shared.SEED]

# of the simulator
Speed = Annotated[str, shared.SPEED]
Host = Annotated[str, typer.Option(help="Address to listen on.")]
Port = Annotated[int | None, typer.Option(help="TCP port; 0 takes a free one.  [default: 4560 + instance]")]
Instance = Annotated[int, typer.Option(help="Number of the vehicle, from 0.")]
IdealRotors = Annotated[bool, shared.IDEAL_ROTORS]
PhysicsHz = Annotated[float, shared.PHYSICS_HZ]
BatteryStart = Annotated[float | None, shared.BATTERY_START]
BatteryCapacity = Annotated[float | None, shared.BATTERY_CAPACITY]
BatteryDrain = Annotated[float | None, shared.BATTERY_DRAIN]
Faults = Annotated[list[str] | None, shared.FAULTS]
Home = Annotated[str, typer.Option(metavar="LAT,LON,ALT", help="Where the vehicle stands.")]
View = Annotated[bool, shared.VIEW]
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
