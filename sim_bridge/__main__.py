"""The command `sim-bridge`: the simulator as a process, and `sim-bridge open-loop`."""

from __future__ import annotations

import json
import math
import os
import sys
from typing import Annotated, Any

import typer

from flightstack.contract import Vector3
from flightstack.params.errors import ConfigError
from sim_bridge import arguments
from sim_bridge.errors import PlantDivergedError, UsageProblemError
from sim_bridge.export_command import export_mjcf
from sim_bridge.live_view import LiveView
from sim_bridge.render_command import render, require

app = typer.Typer(add_completion=False, rich_markup_mode=None)

# typer brings its own copy of click in some versions: the base of all complaints about usage in either
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]

_ZERO = "0,0,0"
_VehicleOption = Annotated[str, typer.Option(help="Built-in vehicle (paper_quad, x_quad) or a TOML file.")]
_PlantOption = Annotated[str, typer.Option(help="rigid, multibody (MuJoCo), or paper (small angles).")]
_WindOption = Annotated[str, typer.Option(metavar="N,E[,D]", help="Steady wind, m/s.")]
_GustOption = Annotated[float, typer.Option(help="Standard deviation of the gusts, m/s.")]
_ForceOption = Annotated[str, typer.Option(metavar="N,E,D", help="Constant external force, N.")]
_TorqueOption = Annotated[str, typer.Option(metavar="X,Y,Z", help="Constant external torque, body FRD, N m.")]
_TorqueGustOption = Annotated[
    float, typer.Option(help="Standard deviation of a gusty torque about roll and pitch, N m.")
]
_SeedOption = Annotated[int, typer.Option(help="Seed of the gusts.")]


def _disturbance(wind: str, gust: float, force: str, torque: str, torque_gust: float) -> Any:
    from sim_bridge.disturbance import Disturbance  # noqa: PLC0415

    return Disturbance(
        arguments.wind("--wind", wind),
        arguments.in_range("--gust", gust, 0.0, 50.0),
        arguments.vector("--force", force),
        arguments.vector("--torque", torque),
        arguments.in_range("--torque-gust", torque_gust, 0.0, 100.0),
    )


@app.callback(invoke_without_command=True)
def run(
    context: typer.Context,
    vehicle: _VehicleOption = "paper_quad",
    plant: _PlantOption = "rigid",
    speed: Annotated[
        str, typer.Option(metavar="max|N", help="N times real time, or as fast as it goes.")
    ] = "1",
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[
        int | None, typer.Option(help="TCP port; 0 takes a free one.  [default: 4560 + instance]")
    ] = None,
    instance: Annotated[int, typer.Option(help="Number of the vehicle, from 0.")] = 0,
    seed: _SeedOption = 1,
    wind: _WindOption = "0,0",
    gust: _GustOption = 0.0,
    force: _ForceOption = _ZERO,
    torque: _TorqueOption = _ZERO,
    torque_gust: _TorqueGustOption = 0.0,
    ideal_rotors: Annotated[bool, typer.Option("--ideal-rotors", help="No rotor lag, no limits.")] = False,
    physics_hz: Annotated[float, typer.Option(help="Lowest rate of the integration steps.")] = 1000.0,
    battery_start: Annotated[
        float | None, typer.Option(metavar="PERCENT", help="Charge at the start.  [default: 100]")
    ] = None,
    battery_capacity: Annotated[
        float | None, typer.Option(metavar="MAH", help="Capacity.  [default: the vehicle's]")
    ] = None,
    battery_drain: Annotated[
        float | None, typer.Option(metavar="FACTOR", help="Let the charge fall so many times as fast.")
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC",
            help="rotor:N:off, rotor:N:weak=SHARE, rotor:N:stuck=RAD_S, state:freeze, state:nan, state:drop or "
            "battery:level=SHARE, each with @BEGIN or @BEGIN-END in seconds; may be repeated.",
        ),
    ] = None,
    home: Annotated[str, typer.Option(metavar="LAT,LON,ALT", help="Where the vehicle stands.")] = (
        "47.397742,8.545594,488.0"
    ),
    view: Annotated[bool, typer.Option("--view", help="Show the vehicle in a window.")] = False,
    timeout: Annotated[
        float | None,
        typer.Option(
            help="Seconds to wait for the flight stack.  [default: for ever to connect, then 30 to answer]"
        ),
    ] = None,
) -> None:
    """Simulate a vehicle for one flight stack that connects over TCP; Ctrl-C ends."""
    if context.invoked_subcommand is not None:
        return
    arguments.plant(plant)
    arguments.in_range("--instance", instance, 0, 250)
    arguments.in_range("--seed", seed, 0, 2**63)
    from flightstack.params.vehicle import load_vehicle  # noqa: PLC0415
    from sim_bridge.plant import PlantOptions  # noqa: PLC0415
    from sim_bridge.server import ServerOptions, serve  # noqa: PLC0415
    from sim_bridge.simulator import FASTEST_PHYSICS_HZ, SLOWEST_PHYSICS_HZ  # noqa: PLC0415

    loaded = load_vehicle(vehicle)
    options = ServerOptions(
        vehicle=loaded,
        plant=plant,
        plant_options=PlantOptions(
            _disturbance(wind, gust, force, torque, torque_gust),
            seed,
            battery=arguments.battery(loaded, battery_start, battery_capacity, battery_drain),
        ),
        faults=arguments.faults(fault or [], loaded),
        home=arguments.home(home),
        speed=arguments.speed(speed),
        host=host,
        port=4560 + instance if port is None else int(arguments.in_range("--port", port, 0, 65535)),
        system_id=instance + 1,
        ideal_rotors=ideal_rotors,
        physics_hz=arguments.in_range("--physics-hz", physics_hz, SLOWEST_PHYSICS_HZ, FASTEST_PHYSICS_HZ),
        timeout_s=None if timeout is None else arguments.in_range("--timeout", timeout, 0.001, 1e6),
    )
    if view:
        require("sim-bridge --view")
        options = options._replace(view=LiveView(vehicle))
    try:
        code = serve(options)
    finally:
        if options.view is not None:
            options.view.close()
    raise typer.Exit(code)


@app.command("open-loop")
def open_loop(
    rotors: Annotated[str, typer.Option(metavar="W1,W2,…", help="Rotor speeds, rad/s, held constant.")],
    seconds: Annotated[float, typer.Option(help="Time to fly.")],
    vehicle: _VehicleOption = "paper_quad",
    plant: _PlantOption = "rigid",
    pos: Annotated[str, typer.Option(metavar="N,E,D", help="Position at the start, m.")] = _ZERO,
    vel: Annotated[str, typer.Option(metavar="N,E,D", help="Velocity at the start, m/s.")] = _ZERO,
    euler_deg: Annotated[str, typer.Option(metavar="ROLL,PITCH,YAW", help="Attitude at the start.")] = _ZERO,
    rates: Annotated[str, typer.Option(metavar="P,Q,R", help="Body rates FRD at the start, rad/s.")] = _ZERO,
    dt: Annotated[float, typer.Option(help="Step of the integration, s.")] = 0.001,
    no_ground: Annotated[bool, typer.Option("--no-ground", help="Fly without a ground.")] = False,
    no_lag: Annotated[
        bool, typer.Option("--no-lag", help="Rotors turn at their speeds from the start.")
    ] = False,
    wind: _WindOption = "0,0",
    gust: _GustOption = 0.0,
    force: _ForceOption = _ZERO,
    torque: _TorqueOption = _ZERO,
    torque_gust: _TorqueGustOption = 0.0,
    seed: _SeedOption = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print the state after some time at constant rotor speeds (taken as given, without limits)."""
    arguments.plant(plant)
    arguments.in_range("--seconds", seconds, 0.0, 1e5)
    arguments.in_range("--dt", dt, 1e-6, 1.0)
    arguments.in_range("--seed", seed, 0, 2**63)
    roll, pitch, yaw = (math.radians(angle) for angle in arguments.vector("--euler-deg", euler_deg))
    position = arguments.vector("--pos", pos)
    if position.z > 0.0 and not no_ground:
        raise UsageProblemError(f"--pos: {position.z:g} m down is below the ground; add --no-ground")
    from flightstack.params.vehicle import load_vehicle  # noqa: PLC0415
    from sim_bridge.open_loop import OpenLoop, run_open_loop  # noqa: PLC0415
    from sim_bridge.plant import InitialState  # noqa: PLC0415
    from sim_bridge.server import complain  # noqa: PLC0415

    loaded = load_vehicle(vehicle)
    disturbance = _disturbance(wind, gust, force, torque, torque_gust)
    velocity, rates_frd = arguments.vector("--vel", vel), arguments.vector("--rates", rates)
    state = run_open_loop(
        OpenLoop(
            loaded, plant, arguments.rotor_speeds(rotors, loaded),
            InitialState(position, velocity, Vector3(roll, pitch, yaw), rates_frd),
            seconds, dt, not no_ground, not no_lag, disturbance, seed,
        ),
        warn=complain,
    )  # fmt: skip
    _print(json.dumps(state) if as_json else _table(state))


app.command()(render)
app.command()(export_mjcf)


def _print(text: str) -> None:
    try:
        print(text, flush=True)
    except OSError as error:
        sys.stdout = open(os.devnull, "w", encoding="ascii")  # noqa: SIM115  # Python tries again at its end
        if not isinstance(error, BrokenPipeError):  # who closed a pipe has read enough
            print(f"sim-bridge: cannot write the result: {error.strerror}", file=sys.stderr)
        raise typer.Exit(1) from None


def _table(state: dict[str, Any]) -> str:
    lines = []
    for name, value in state.items():
        values = value if isinstance(value, list) else [value]
        lines.append(f"{name:<20}" + "".join(f"{number:>16.9g}" for number in values))
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    try:
        return app(argv, standalone_mode=False) or 0
    except PlantDivergedError as error:
        print(f"sim-bridge: {error}", file=sys.stderr)
        return 1
    except _UsageError as error:
        message: str = getattr(error, "format_message", error.__str__)()
        print(f"sim-bridge: {message}", file=sys.stderr)
    except (UsageProblemError, ConfigError) as error:
        print(f"sim-bridge: {error}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
