"""Check the options of ``gcs fly``, and make the command lines of simulator and flight stack."""

from __future__ import annotations

import math
import socket
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.core.geodesy import GeoPoint
from flightstack.core.port_numbers import vehicle_api_port, vehicle_ground_port
from flightstack.firmware.choice import parse_loops
from flightstack.params.behaviour import SPECS, Behaviour
from flightstack.params.config import parse_home
from flightstack.params.gains_file import hidden_gains, open_gains
from flightstack.params.store import read_assignment
from flightstack.params.vehicle import Vehicle, hidden_vehicle, load_vehicle
from flightstack.plan import POSITION_COMMANDS, Command, Plan, load_plan
from flightstack.process.clock import nearest_outer_hz, rates
from flightstack.process.console import complain
from flightstack.process.signing_file import load_key
from flightstack.transports.udp import PortBusyError, UdpSocket
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.flight_limit import flight_limit_s
from gcs_cli.fly.fly_flags import TO_SIMULATOR, TO_STACK, FlyOptions, passed
from gcs_cli.link.endpoint import LOOPBACK
from gcs_cli.report.run_directory import LOG_NAME
from gcs_cli.transfers.plan_parts import plan_problem
from gcs_cli.vehicle.param_info import load_parameters

CONTROLLERS = "flightstack.attitude_controllers"
PLANTS = ("rigid", "multibody", "paper")
DEFAULT_HOME = GeoPoint(47.397742, 8.545594, 488.0)
GCS_LOSS_S = 5.0
_RETURN = Command.NAV_RETURN_TO_LAUNCH


def checked_plan(options: FlyOptions) -> Plan:
    """Check the options before anything starts, and return the plan; raise CliError or ConfigError."""
    _check_flags(options)
    plan = load_plan(options.plan_path)
    flown_vehicle(options)
    open_gains(options.gains)
    for sentence in (hidden_vehicle(options.vehicle), hidden_gains(options.gains)):
        if sentence is not None:
            complain(f"gcs: {sentence}")
    if options.params is not None and not options.params.is_file():
        raise CliError(f"--params {options.params}: no such file", USAGE)
    if options.signing_key is not None:
        load_key(options.signing_key)
    rates(options.inner_hz, outer_rate_hz(options))
    if not plan.items:
        raise CliError(f"{options.plan_path}: has no mission items", USAGE)
    problem = plan_problem(plan, home_of(options, plan))
    if problem is not None:
        raise CliError(f"{options.plan_path}: {problem}", USAGE)
    moving = (item.command for item in plan.items if item.command in POSITION_COMMANDS | {_RETURN})
    if next(moving, None) in (Command.NAV_LAND, _RETURN):
        problem = "the mission begins with a landing or a return, but the vehicle is on the ground"
        raise CliError(f"{options.plan_path}: {problem}", USAGE)
    return plan


def outer_rate_hz(options: FlyOptions) -> float:
    """Return the rate of the outer loop: as given, else the divisor of the inner rate nearest to 100 Hz."""
    return nearest_outer_hz(options.inner_hz) if options.outer_hz is None else options.outer_hz


def home_of(options: FlyOptions, plan: Plan) -> GeoPoint:
    """Return the start position: as given, else the plan's home; raise ConfigError."""
    return plan.home or DEFAULT_HOME if options.home is None else parse_home(options.home)


def flown_vehicle(options: FlyOptions) -> Vehicle:
    """Return the vehicle that the simulator flies; raise ConfigError, or CliError for wind that has no effect."""
    vehicle = load_vehicle(options.vehicle)
    if options.drag:
        vehicle = vehicle.with_drag(options.plant)
    has_wind = options.wind is not None and any(float(part) for part in options.wind.split(","))
    if has_wind or options.gust:
        refusal = vehicle.wind_refusal(options.plant)
        if refusal is not None:
            raise CliError(f"{'--gust' if options.gust else '--wind'}: {refusal}", USAGE)
    return vehicle


def longest_flight_s(options: FlyOptions, plan: Plan) -> float:
    """Return the simulated time after which the flight is aborted: as given, else derived from the plan.

    Raise ConfigError for an invalid parameter file or assignment.
    """
    if options.limit_s is not None:
        return options.limit_s
    values = {} if options.params is None else load_parameters(options.params)
    values.update(map(read_assignment, options.param or ()))
    behaviour = Behaviour()
    for name in SPECS.keys() & values.keys():
        behaviour = behaviour.updated(name, values[name])
    return flight_limit_s(plan.items, home_of(options, plan), behaviour)


def _check_flags(options: FlyOptions) -> None:
    known = sorted(point.name for point in entry_points(group=CONTROLLERS))
    if options.controller not in known:
        raise CliError(
            f"--controller {options.controller}: unknown controller; known are {', '.join(known)}", USAGE
        )
    if options.plant not in PLANTS:
        raise CliError(f"--plant {options.plant}: expected {', '.join(PLANTS[:-1])} or {PLANTS[-1]}", USAGE)
    if options.plant == "multibody" and find_spec("mujoco") is None:
        raise CliError(f"--plant multibody needs MuJoCo: {INSTALL_MULTIBODY}", USAGE)
    parse_loops(options.loops)
    if options.speed != "max":
        _number("--speed", options.speed, 0.001, 10_000.0)
    if options.wind is not None:
        parts = options.wind.split(",")
        if len(parts) not in (2, 3):
            raise CliError(f"--wind {options.wind}: expected N,E or N,E,D in m/s", USAGE)
        for part in parts:
            _number("--wind", part, -200.0, 200.0)
    _number("--inner-hz", options.inner_hz, 1.0, 1e5)


def _number(flag: str, value: str | float, low: float, high: float) -> None:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not low <= number <= high:
        raise CliError(f"{flag} {value}: expected a number from {low:.10g} to {high:.10g}", USAGE)


def check_ports(options: FlyOptions) -> None:
    """Raise CliError (usage) if a port of simulator or flight stack is in use."""
    try:
        for port in (vehicle_ground_port(options.instance), vehicle_api_port(options.instance)):
            UdpSocket(LOOPBACK, port).close()
    except PortBusyError as error:
        raise _port_error(error) from None
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, options.simulator_port))
            probe.listen(1)
        except OSError:
            problem = PortBusyError("TCP", (LOOPBACK, options.simulator_port), "is in use")
            raise _port_error(problem) from None


def _port_error(error: PortBusyError) -> CliError:
    return CliError(f"{error}: end the program that uses it, or fly beside it with --instance N", USAGE)


def simulator_arguments(options: FlyOptions, home: GeoPoint) -> list[str]:
    """Return the command line of ``sim-bridge``."""
    return [
        *passed(options, TO_SIMULATOR),
        f"--port={options.simulator_port}",
        f"--home={_home(home)}",
        f"--timeout={options.timeout_s:g}",
    ]


def stack_arguments(options: FlyOptions, home: GeoPoint, folder: Path, ground_port: int) -> list[str]:
    """Return the command line of ``flightstack``, which sends to ``ground_port`` and the default ground station."""
    signing = [] if options.signing_key is None else [f"--signing-key={options.signing_key}"]
    return [
        *passed(options, TO_STACK),
        f"--outer-hz={outer_rate_hz(options)!r}",
        f"--sim-port={options.simulator_port}",
        f"--sim-timeout={options.timeout_s:g}",
        f"--gcs={LOOPBACK}:{ground_port}",
        f"--gcs={LOOPBACK}:{options.gcs_port}",
        f"--log={folder / LOG_NAME}",
        f"--home={_home(home)}",
        f"--exit-on-gcs-loss={GCS_LOSS_S:g}",
        f"--params={options.params or 'none'}",
        "--state=none",  # a flight depends on its command line alone
        "--wait-for-start",
        *signing,
    ]


def _home(home: GeoPoint) -> str:
    return f"{home.latitude_deg!r},{home.longitude_deg!r},{home.altitude_m!r}"
