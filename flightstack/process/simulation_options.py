"""The options of ``sim-bridge`` that ``gcs fly`` and ``gcs pil`` offer as well: flag, metavar and help of each."""

from __future__ import annotations

import typer

VEHICLE = typer.Option(help="Built-in vehicle (paper_quad, x_quad) or a TOML file.")
PLANT = typer.Option(help="rigid, multibody (MuJoCo), or paper (small angles).")
WIND = typer.Option(metavar="N,E[,D]", help="Steady wind, m/s.")
GUST = typer.Option(help="Standard deviation of the gusts, m/s.")
DRAG = typer.Option("--drag", help="Fly with the optional drag of the vehicle's file, so that wind acts.")
FORCE = typer.Option(metavar="N,E,D", help="Constant external force, N.")
TORQUE = typer.Option(metavar="X,Y,Z", help="Constant external torque, body FRD, N m.")
TORQUE_GUST = typer.Option(help="Standard deviation of a gusty torque about roll and pitch, N m.")
SEED = typer.Option(help="Seed of the gusts.")
SPEED = typer.Option(metavar="max|N", help="N times real time, or as fast as it goes.")
IDEAL_ROTORS = typer.Option(
    "--ideal-rotors", help="Rotors without limits, without lag and without spin-up torque."
)
PHYSICS_HZ = typer.Option(help="Lowest rate of the integration steps, Hz.")
BATTERY_START = typer.Option(metavar="PERCENT", help="Charge at the start.  [default: 100]")
BATTERY_CAPACITY = typer.Option(metavar="MAH", help="Capacity.  [default: the vehicle's]")
BATTERY_DRAIN = typer.Option(metavar="FACTOR", help="Let the charge fall so many times as fast.")
FAULTS = typer.Option(
    "--fault",
    metavar="SPEC",
    help="rotor:N:off, rotor:N:weak=SHARE, rotor:N:stuck=RAD_S, state:freeze, state:nan, state:drop or "
    "battery:level=SHARE, each with @BEGIN or @BEGIN-END in seconds; may be repeated.",
)
VIEW = typer.Option("--view", help="Show the vehicle in a window.")
