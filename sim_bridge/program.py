"""What the commands of ``sim-bridge`` do. A module of its own: ``--help`` does not import it, which takes 0.2 s."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.core.contract import Vector3
from flightstack.core.errors import WriteError
from flightstack.core.port_numbers import simulator_port, system_id
from flightstack.params.vehicle import Vehicle, hidden_vehicle, load_vehicle
from flightstack.process import console
from flightstack.process.compile_notice import announce_compilation
from sim_bridge import arguments
from sim_bridge.errors import UsageProblemError
from sim_bridge.multibody.assembly import TOLERANCE, assemble, mass_table
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.open_loop import OpenLoop, run_open_loop
from sim_bridge.options import OpenLoopOptions, SimulatorOptions
from sim_bridge.output import complain, print_result
from sim_bridge.plant.disturbance import Disturbance, check_wind
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.plants import kernels_of
from sim_bridge.render.live_view import LiveView
from sim_bridge.server.server import ServerOptions, serve


def simulate(given: SimulatorOptions) -> int:
    """Check the options and run the simulator, with a window if it is asked for; return the exit code.

    Raises UsageProblemError, ConfigError.
    """
    served = server_options(given)
    if given.view:
        arguments.require("--view")
    if given.check:
        return 0
    if not given.view:
        return serve(served)
    window = LiveView(given.vehicle)
    try:
        return serve(served._replace(view=window))
    finally:
        window.close()


def server_options(given: SimulatorOptions) -> ServerOptions:
    """Return the checked configuration of the simulator; raise UsageProblemError, ConfigError."""
    plant, port, timeout = given.plant, given.port, given.timeout
    arguments.check_plant(plant)
    arguments.check_range("--instance", given.instance, 0, 250)
    arguments.check_range("--seed", given.seed, 0, 2**63)
    vehicle = _load_vehicle(given)
    battery = arguments.check_battery(
        vehicle, given.battery_start, given.battery_capacity, given.battery_drain
    )
    disturbance = _disturbance(given)
    check_wind(vehicle, plant, disturbance)
    boat = arguments.parse_boat(given.boat)
    slope_rad = arguments.check_slope(given.slope, plant, boat)
    plant_options = PlantOptions(
        disturbance, given.seed, battery=battery, slope_rad=slope_rad, boat_ned_m_s=boat
    )
    faults = arguments.parse_faults(given.fault or [], vehicle, plant, plant_options)
    arguments.check_client(faults, given.state, given.clock)
    default_port = simulator_port(given.instance)
    return ServerOptions(
        vehicle=vehicle,
        plant=plant,
        plant_options=plant_options,
        faults=faults,
        home=arguments.parse_home(given.home),
        speed=arguments.parse_speed(given.speed),
        head_start_s=arguments.check_range("--head-start", given.head_start, 0.0, 3600.0),
        host=given.host,
        port=default_port if port is None else int(arguments.check_range("--port", port, 0, 65535)),
        system_id=system_id(given.instance),
        ideal_rotors=given.ideal_rotors,
        physics_hz=arguments.check_physics_hz(given.physics_hz),
        timeout_s=None if timeout is None else arguments.check_range("--timeout", timeout, 0.001, 1e6),
    )


def fly_open_loop(given: OpenLoopOptions) -> None:
    """Print the state after a flight at constant rotor speeds; raise UsageProblemError, ConfigError."""
    _check_open_loop(given.plant, given.seconds, given.dt, given.seed)
    initial = _initial(given)
    vehicle = _load_vehicle(given)
    speeds_rad_s = arguments.parse_rotor_speeds(given.rotors, vehicle)
    disturbance = _disturbance(given)
    announce_compilation("sim-bridge", kernels_of(given.plant))
    flight = OpenLoop(
        vehicle=vehicle,
        plant=given.plant,
        rotor_speed_rad_s=speeds_rad_s,
        initial=initial,
        seconds=given.seconds,
        dt_s=given.dt,
        ground=not given.no_ground,
        lag=not given.no_lag,
        disturbance=disturbance,
        seed=given.seed,
    )
    state = run_open_loop(flight, warn=complain)
    print_result(json.dumps(state) if given.as_json else _table(state))


def _check_open_loop(plant: str, seconds: float, dt: float, seed: int) -> None:
    arguments.check_plant(plant)
    arguments.check_range("--seconds", seconds, 0.0, 1e5)
    arguments.check_range("--dt", dt, 1e-6, 1.0)
    arguments.check_range("--seed", seed, 0, 2**63)


def _initial(given: OpenLoopOptions) -> InitialState:
    euler_rad = Vector3(
        *(math.radians(angle) for angle in arguments.parse_vector("--euler-deg", given.euler_deg))
    )
    position = arguments.parse_vector("--pos", given.pos)
    if position.z > 0.0 and not given.no_ground:
        raise UsageProblemError(f"--pos: {position.z:g} m down is below the ground; add --no-ground")
    velocity = arguments.parse_vector("--vel", given.vel)
    rates = arguments.parse_vector("--rates", given.rates)
    return InitialState(position, velocity, euler_rad, rates)


def _table(state: dict[str, Any]) -> str:
    lines = []
    for name, value in state.items():
        values = value if isinstance(value, list) else [value]
        lines.append(f"{name:<20}" + "".join(f"{number:>16.9g}" for number in values))
    return "\n".join(lines)


def write_mjcf(name: str, out: Path | None, overwrite: bool, scene: bool) -> None:
    """Write a vehicle's multibody model, to stdout if ``out`` is None; raise ConfigError."""
    if out is not None:
        check_new(out, overwrite)
    vehicle = _named_vehicle(name)
    text = model_xml(vehicle, scene=scene)
    assembly = assemble(vehicle)
    console.complain(mass_table(vehicle, assembly))
    if assembly.largest_error > TOLERANCE:
        complain(f"warning: {assembly.summary()}; the model has these errors")
    if out is None:
        print_result(text.removesuffix("\n"))
        return
    try:
        write_text_atomically(out, text)
    except OSError as error:
        raise WriteError(out, "", f"cannot be written: {error.strerror}") from None


def _disturbance(given: SimulatorOptions | OpenLoopOptions) -> Disturbance:
    return Disturbance(
        arguments.parse_wind("--wind", given.wind),
        arguments.check_range("--gust", given.gust, 0.0, 50.0),
        arguments.parse_vector("--force", given.force),
        arguments.parse_vector("--torque", given.torque),
        arguments.check_range("--torque-gust", given.torque_gust, 0.0, 100.0),
    )


def _load_vehicle(given: SimulatorOptions | OpenLoopOptions) -> Vehicle:
    vehicle = _named_vehicle(given.vehicle)
    return vehicle.with_drag(given.plant) if given.drag else vehicle


def _named_vehicle(name: str) -> Vehicle:
    """Load the vehicle of ``--vehicle``; warn if a built-in vehicle hides a file of that name. Raises ConfigError."""
    if (sentence := hidden_vehicle(name)) is not None:
        complain(sentence)
    return load_vehicle(name)
