"""Check the options of ``gcs fly``, and make the command lines of simulator and flight stack."""

from __future__ import annotations

from pathlib import Path

from flightstack.core.geodesy import GeoPoint
from flightstack.core.port_numbers import system_id, vehicle_api_port, vehicle_ground_port
from flightstack.firmware.choice import FREE, parse_loops
from flightstack.params.behaviour import SPECS
from flightstack.params.config import DEFAULT_HOME, ESTIMATED, StackConfig, parse_home
from flightstack.params.gains_file import hidden_gains
from flightstack.params.store import read_assignment
from flightstack.params.vehicle import Vehicle, load_vehicle
from flightstack.plan import POSITION_COMMANDS, Command, Plan, load_plan
from flightstack.process.clock import nearest_outer_hz
from flightstack.process.config_check import check as check_stack
from flightstack.process.console import complain
from flightstack.process.signing_file import load_key
from flightstack.transports.udp import PortBusyError, UdpSocket
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.flight_limit import flight_limit_s
from gcs_cli.fly.fly_flags import TO_SIMULATOR, TO_STACK, FlyOptions, passed
from gcs_cli.link.endpoint import LOOPBACK
from gcs_cli.run_directory import LOG_NAME
from gcs_cli.transfers.plan_parts import plan_problem
from gcs_cli.vehicle.param_info import load_parameters
from sim_bridge.command import check_arguments as check_simulator
from sim_bridge.command import check_port as check_simulator_port
from sim_bridge.errors import UsageProblemError

GCS_LOSS_S = 5.0
_HEAD_START_S = 1.1
"""Simulated time after which a vehicle on its sensors becomes ready, within 0.03 s with the built-in ones.

No later: the rest would pass at full speed after the takeoff.
"""
_RETURN = Command.NAV_RETURN_TO_LAUNCH


def checked_plan(options: FlyOptions) -> Plan:
    """Check the options before anything starts, and return the plan; raise CliError or ConfigError."""
    plan = load_plan(options.plan_path)
    home = home_of(options, plan)
    check_options(options, home)
    if not plan.items:
        raise CliError(f"{options.plan_path}: has no mission items", USAGE)
    problem = plan_problem(plan, home)
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
    """Return the vehicle that the simulator flies; raise ConfigError."""
    vehicle = load_vehicle(options.vehicle)
    return vehicle.with_drag(options.plant) if options.drag else vehicle


def longest_flight_s(options: FlyOptions, plan: Plan) -> float:
    """Return the simulated time after which the flight is aborted: as given, else derived from the plan.

    Raise ConfigError for an invalid parameter file or assignment.
    """
    if options.limit_s is not None:
        return options.limit_s
    values = {} if options.params is None else load_parameters(options.params)
    values.update(map(read_assignment, options.param or ()))
    behaviour = load_vehicle(options.vehicle).behaviour
    for name in SPECS.keys() & values.keys():
        behaviour = behaviour.updated(name, values[name])
    return flight_limit_s(plan.items, home_of(options, plan), behaviour)


def check_options(options: FlyOptions, home: GeoPoint) -> None:
    """Check the options as simulator and flight stack do at their start."""
    try:
        check_simulator(simulator_arguments(options, home))
    except UsageProblemError as error:
        raise CliError(str(error), USAGE) from None
    if options.params is not None and not options.params.is_file():
        problem = "is a directory" if options.params.is_dir() else "no such file"
        raise CliError(f"--params {options.params}: {problem}", USAGE)
    if runs_freely(options) and options.speed_factor != 1.0:
        raise CliError(
            f"--loops {options.loops}: a free-running target flies in real time: add --speed 1", USAGE
        )
    check_stack(
        StackConfig(
            vehicle=options.vehicle,
            controller=options.controller,
            gains=options.gains,
            loops=options.loops,
            inner_hz=options.inner_hz,
            outer_hz=outer_rate_hz(options),
            state=options.state,
            ideal_rotors=options.ideal_rotors,
            home=home,
            system_id=system_id(options.instance),
            params_file=None if options.params is None else str(options.params),
            params=tuple(options.param or ()),
        )
    )
    if (sentence := hidden_gains(options.gains)) is not None:
        complain(f"gcs: {sentence}")
    if options.signing_key is not None:
        load_key(options.signing_key)


def check_ports(options: FlyOptions) -> None:
    """Raise CliError (usage) if a port of simulator or flight stack is in use."""
    try:
        for port in (vehicle_ground_port(options.instance), vehicle_api_port(options.instance)):
            UdpSocket(LOOPBACK, port).close()
    except PortBusyError as error:
        raise _port_error(error) from None
    try:  # as the simulator does
        check_simulator_port(LOOPBACK, options.simulator_port)
    except OSError:
        problem = PortBusyError("TCP", (LOOPBACK, options.simulator_port), "is in use")
        raise _port_error(problem) from None


def _port_error(error: PortBusyError) -> CliError:
    return CliError(f"{error}: end the program that uses it, or fly beside it with --instance N", USAGE)


def simulator_arguments(options: FlyOptions, home: GeoPoint) -> list[str]:
    """Return the command line of ``sim-bridge``."""
    starts_ahead = options.state == ESTIMATED and not runs_freely(options)
    return [
        *passed(options, TO_SIMULATOR),
        f"--port={options.simulator_port}",
        f"--home={home_text(home)}",
        f"--timeout={options.timeout_s:g}",
        f"--clock={'realtime' if runs_freely(options) else 'lockstep'}",
        *([f"--head-start={_HEAD_START_S:g}"] if starts_ahead else []),
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
        f"--home={home_text(home)}",
        f"--exit-on-gcs-loss={GCS_LOSS_S:g}",
        f"--params={options.params or 'none'}",
        *(["--clock=realtime"] if runs_freely(options) else []),
        "--state-dir=none",  # a flight depends on its command line alone
        "--wait-for-start",
        *signing,
    ]


def runs_freely(options: FlyOptions) -> bool:
    """Return True if the loops run on a target by its own timer."""
    return parse_loops(options.loops).ending == FREE


def home_text(home: GeoPoint) -> str:
    """Return a position as the options ``--home`` read it."""
    return f"{home.latitude_deg!r},{home.longitude_deg!r},{home.altitude_m!r}"
