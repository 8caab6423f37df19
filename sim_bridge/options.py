"""Options of ``sim-bridge`` and ``sim-bridge open-loop``, each with its type and help.

A module of its own: the help imports no plant.
"""

from __future__ import annotations

from dataclasses import dataclass
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
Host = Annotated[str, typer.Option(metavar="HOST", help="Address to listen on.", **shared.IN_LINKS)]
Port = Annotated[
    int | None,
    typer.Option(
        metavar="PORT", help="TCP port; 0 picks a free one.  [default: 4560 + instance]", **shared.IN_LINKS
    ),
]
Instance = Annotated[int, typer.Option(metavar="N", help="Number of the vehicle, from 0.", **shared.IN_LINKS)]
IdealRotors = Annotated[bool, shared.IDEAL_ROTORS]
PhysicsHz = Annotated[float, shared.PHYSICS_HZ]
Slope = Annotated[float, shared.SLOPE]
Boat = Annotated[str, shared.BOAT]
BatteryStart = Annotated[float | None, shared.BATTERY_START]
BatteryCapacity = Annotated[float | None, shared.BATTERY_CAPACITY]
BatteryDrain = Annotated[float | None, shared.BATTERY_DRAIN]
Faults = Annotated[list[str] | None, shared.FAULTS]
Home = Annotated[
    str,
    typer.Option(metavar="LAT,LON,ALT", help="Start position, degrees and m.", **shared.IN_VEHICLE),
]
View = Annotated[bool, shared.VIEW]
Timeout = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Timeout of the flight stack.  [default: none to connect, then 30]",
        **shared.IN_LINKS,
    ),
]
Check = Annotated[bool, typer.Option("--check", help="Check the options and exit.")]
HeadStart = Annotated[
    float,
    typer.Option(
        metavar="SECONDS",
        help="In lockstep, let so much simulated time pass as fast as possible, and the rest at --speed. "
        "gcs gives 1.1 to a vehicle on its sensors, which then is ready.",
        **shared.IN_SIMULATION,
    ),
]
State = Annotated[str | None, typer.Option(hidden=True, help="--state of the flight stack, if it is known.")]
Clock = Annotated[str | None, typer.Option(hidden=True, help="--clock of the flight stack, if it is known.")]


@dataclass(frozen=True)
class SimulatorOptions:
    """The options of the simulator process, as given."""

    vehicle: Vehicle = "paper_quad"
    plant: Plant = "rigid"
    speed: Speed = "1"
    host: Host = "127.0.0.1"
    port: Port = None
    instance: Instance = 0
    seed: Seed = 1
    wind: Wind = "0,0"
    gust: Gust = 0.0
    drag: Drag = False
    force: Force = "0,0,0"
    torque: Torque = "0,0,0"
    torque_gust: TorqueGust = 0.0
    ideal_rotors: IdealRotors = False
    physics_hz: PhysicsHz = 1000.0
    slope: Slope = 0.0
    boat: Boat = "0,0"
    battery_start: BatteryStart = None
    battery_capacity: BatteryCapacity = None
    battery_drain: BatteryDrain = None
    fault: Faults = None
    home: Home = "47.397742,8.545594,488.0"
    view: View = False
    timeout: Timeout = None
    head_start: HeadStart = 0.0
    check: Check = False
    state: State = None
    clock: Clock = None


# of an open-loop flight
Rotors = Annotated[str, typer.Option(metavar="W1,W2,…", help="Constant rotor speeds, rad/s.")]
Seconds = Annotated[float, typer.Option(metavar="SECONDS", help="Duration of the flight, s.")]
Position = Annotated[str, typer.Option(metavar="N,E,D", help="Initial position, m.")]
Velocity = Annotated[str, typer.Option(metavar="N,E,D", help="Initial velocity, m/s.")]
EulerDeg = Annotated[str, typer.Option(metavar="ROLL,PITCH,YAW", help="Initial attitude, degrees.")]
Rates = Annotated[str, typer.Option(metavar="P,Q,R", help="Initial body rates FRD, rad/s.")]
Step = Annotated[float, typer.Option(metavar="SECONDS", help="Integration step, s.")]
NoGround = Annotated[bool, typer.Option("--no-ground", help="Fly without ground.")]
NoLag = Annotated[
    bool,
    typer.Option("--no-lag", help="Start the rotors at their speeds, without lag."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@dataclass(frozen=True)
class OpenLoopOptions:
    """The options of an open-loop flight, as given."""

    rotors: Rotors
    seconds: Seconds
    vehicle: Vehicle = "paper_quad"
    plant: Plant = "rigid"
    pos: Position = "0,0,0"
    vel: Velocity = "0,0,0"
    euler_deg: EulerDeg = "0,0,0"
    rates: Rates = "0,0,0"
    dt: Step = 0.001
    no_ground: NoGround = False
    no_lag: NoLag = False
    wind: Wind = "0,0"
    gust: Gust = 0.0
    drag: Drag = False
    force: Force = "0,0,0"
    torque: Torque = "0,0,0"
    torque_gust: TorqueGust = 0.0
    seed: Seed = 1
    as_json: Json = False
