"""The command ``sim-bridge``: the simulator process, ``open-loop``, ``export-mjcf`` and ``render``."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.core.contract import Vector3
from flightstack.core.errors import ConfigError
from flightstack.core.port_numbers import simulator_port, system_id
from flightstack.process import collection, console
from flightstack.process.command_line import (
    Overwrite,
    PanelCommand,
    PanelGroup,
    UsageError,
    Version,
    expand_options,
    make_app,
    usage_sentence,
)
from sim_bridge import arguments, options
from sim_bridge.errors import PlantDivergedError, UsageProblemError
from sim_bridge.output import complain, load_named_vehicle, print_result
from sim_bridge.render.live_view import LiveView
from sim_bridge.render.render_command import render, require

if TYPE_CHECKING:
    from flightstack.params.vehicle import Vehicle
    from sim_bridge.plant.plant import InitialState
    from sim_bridge.server.server import ServerOptions

app = make_app(name="sim-bridge", cls=PanelGroup)

_ZERO = "0,0,0"


def _disturbance(wind: str, gust: float, force: str, torque: str, torque_gust: float) -> Any:
    from sim_bridge.plant.disturbance import Disturbance  # noqa: PLC0415

    return Disturbance(
        arguments.parse_wind("--wind", wind),
        arguments.check_range("--gust", gust, 0.0, 50.0),
        arguments.parse_vector("--force", force),
        arguments.parse_vector("--torque", torque),
        arguments.check_range("--torque-gust", torque_gust, 0.0, 100.0),
    )


def _load_vehicle(name: str, plant: str, drag: bool) -> Vehicle:
    vehicle = load_named_vehicle(name)
    return vehicle.with_drag(plant) if drag else vehicle


@app.callback(invoke_without_command=True)
@expand_options
def run(
    context: typer.Context,
    given: options.SimulatorOptions,
    version: Version = False,  # handled by its callback
) -> None:
    """Simulate a vehicle for one flight stack, which connects over TCP.

    Ctrl-C ends the simulation.
    """
    if context.invoked_subcommand is not None:
        return
    served = _server_options(given)
    if given.check:
        raise typer.Exit
    raise typer.Exit(_serve(served, given.vehicle if given.view else None))


def _server_options(given: options.SimulatorOptions) -> ServerOptions:
    """Check the options; raise UsageProblemError, ConfigError."""
    plant, port, timeout = given.plant, given.port, given.timeout
    arguments.check_plant(plant)
    arguments.check_range("--instance", given.instance, 0, 250)
    arguments.check_range("--seed", given.seed, 0, 2**63)
    from sim_bridge.plant.disturbance import check_wind  # noqa: PLC0415
    from sim_bridge.plant.plant import PlantOptions  # noqa: PLC0415
    from sim_bridge.server.server import ServerOptions  # noqa: PLC0415

    vehicle = _load_vehicle(given.vehicle, plant, given.drag)
    battery = arguments.check_battery(
        vehicle, given.battery_start, given.battery_capacity, given.battery_drain
    )
    disturbance = _disturbance(given.wind, given.gust, given.force, given.torque, given.torque_gust)
    check_wind(vehicle, plant, disturbance)
    boat = arguments.parse_boat(given.boat)
    slope_rad = arguments.check_slope(given.slope, plant, boat)
    plant_options = PlantOptions(
        disturbance, given.seed, battery=battery, slope_rad=slope_rad, boat_ned_m_s=boat
    )
    default_port = simulator_port(given.instance)
    return ServerOptions(
        vehicle=vehicle,
        plant=plant,
        plant_options=plant_options,
        faults=arguments.parse_faults(given.fault or [], vehicle, plant, plant_options),
        home=arguments.parse_home(given.home),
        speed=arguments.parse_speed(given.speed),
        host=given.host,
        port=default_port if port is None else int(arguments.check_range("--port", port, 0, 65535)),
        system_id=system_id(given.instance),
        ideal_rotors=given.ideal_rotors,
        physics_hz=arguments.check_physics_hz(given.physics_hz),
        timeout_s=None if timeout is None else arguments.check_range("--timeout", timeout, 0.001, 1e6),
    )


def check_arguments(given: Sequence[str]) -> None:
    """Check a command line of the simulator; raise UsageError, UsageProblemError or ConfigError."""
    app([*given, "--check"], prog_name="sim-bridge", standalone_mode=False)


def _serve(served: ServerOptions, viewed: str | None) -> int:
    """Run the simulator, with a window that shows the vehicle ``viewed`` unless it is None; return the exit code."""
    from sim_bridge.server.server import serve  # noqa: PLC0415

    if viewed is None:
        return serve(served)
    require("sim-bridge --view")
    window = LiveView(viewed)
    try:
        return serve(served._replace(view=window))
    finally:
        window.close()


def _check_open_loop(plant: str, seconds: float, dt: float, seed: int) -> None:
    arguments.check_plant(plant)
    arguments.check_range("--seconds", seconds, 0.0, 1e5)
    arguments.check_range("--dt", dt, 1e-6, 1.0)
    arguments.check_range("--seed", seed, 0, 2**63)


@app.command("open-loop", cls=PanelCommand)
def open_loop(
    rotors: options.Rotors,
    seconds: options.Seconds,
    vehicle: options.Vehicle = "paper_quad",
    plant: options.Plant = "rigid",
    pos: options.Position = _ZERO,
    vel: options.Velocity = _ZERO,
    euler_deg: options.EulerDeg = _ZERO,
    rates: options.Rates = _ZERO,
    dt: options.Step = 0.001,
    no_ground: options.NoGround = False,
    no_lag: options.NoLag = False,
    wind: options.Wind = "0,0",
    gust: options.Gust = 0.0,
    drag: options.Drag = False,
    force: options.Force = _ZERO,
    torque: options.Torque = _ZERO,
    torque_gust: options.TorqueGust = 0.0,
    seed: options.Seed = 1,
    as_json: options.Json = False,
) -> None:
    """Print the state after a flight at constant rotor speeds.

    Rotor speeds are not limited.
    """
    _check_open_loop(plant, seconds, dt, seed)
    initial = _initial(pos, vel, euler_deg, rates, no_ground)
    from flightstack.process.compile_notice import announce_compilation  # noqa: PLC0415
    from sim_bridge.open_loop import OpenLoop, run_open_loop  # noqa: PLC0415
    from sim_bridge.plants import kernels_of  # noqa: PLC0415

    loaded = _load_vehicle(vehicle, plant, drag)
    speeds_rad_s = arguments.parse_rotor_speeds(rotors, loaded)
    disturbance = _disturbance(wind, gust, force, torque, torque_gust)
    announce_compilation("sim-bridge", kernels_of(plant))
    flight = OpenLoop(
        loaded, plant, speeds_rad_s, initial, seconds, dt, not no_ground, not no_lag, disturbance, seed
    )
    state = run_open_loop(flight, warn=complain)
    print_result(json.dumps(state) if as_json else _table(state))


def _initial(pos: str, vel: str, euler_deg: str, rates: str, no_ground: bool) -> InitialState:
    from sim_bridge.plant.plant import InitialState  # noqa: PLC0415

    roll, pitch, yaw = (math.radians(angle) for angle in arguments.parse_vector("--euler-deg", euler_deg))
    position = arguments.parse_vector("--pos", pos)
    if position.z > 0.0 and not no_ground:
        raise UsageProblemError(f"--pos: {position.z:g} m down is below the ground; add --no-ground")
    velocity, rates_frd = arguments.parse_vector("--vel", vel), arguments.parse_vector("--rates", rates)
    return InitialState(position, velocity, Vector3(roll, pitch, yaw), rates_frd)


app.command()(render)


@app.command()
def export_mjcf(
    vehicle: options.Vehicle = "paper_quad",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="File to write.  [default: stdout]")
    ] = None,
    overwrite: Overwrite = False,
    scene: Annotated[bool, typer.Option("--scene", help="Add sky, landmarks, light and cameras.")] = False,
) -> None:
    """Write a vehicle's multibody model as MJCF, for any MuJoCo.

    A table of the masses goes to stderr.
    """
    from sim_bridge.multibody.assembly import TOLERANCE, assemble, mass_table  # noqa: PLC0415
    from sim_bridge.multibody.mjcf import model_xml  # noqa: PLC0415

    if out is not None:
        check_new(out, overwrite)
    loaded = load_named_vehicle(vehicle)
    text = model_xml(loaded, scene=scene)
    assembly = assemble(loaded)
    console.complain(mass_table(loaded, assembly))
    if assembly.largest_error > TOLERANCE:
        complain(f"warning: {assembly.summary()}; the model has these errors")
    if out is None:
        print_result(text.removesuffix("\n"))
        return
    try:
        write_text_atomically(out, text)
    except OSError as error:
        raise UsageProblemError(f"--out {out}: cannot be written: {error.strerror}") from None


def _table(state: dict[str, Any]) -> str:
    lines = []
    for name, value in state.items():
        values = value if isinstance(value, list) else [value]
        lines.append(f"{name:<20}" + "".join(f"{number:>16.9g}" for number in values))
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    console.replace_unencodable()
    try:
        with collection.paused():
            return app(argv, prog_name="sim-bridge", standalone_mode=False) or 0
    except PlantDivergedError as error:
        complain(error)
        return 1
    except UsageError as error:
        complain(usage_sentence(error))
    except (UsageProblemError, ConfigError) as error:
        complain(error)
    except OSError as error:
        return console.report_os_error("sim-bridge", error)
    return 2


if __name__ == "__main__":
    sys.exit(main())
