"""What ``gcs fly`` is asked for: checked, and turned into the arguments of its two children."""

from __future__ import annotations

import math
import socket
from dataclasses import dataclass
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from flightstack.clock import nearest_outer_hz, rates
from flightstack.firmware.choice import PYTHON, parse_loops
from flightstack.geodesy import GeoPoint
from flightstack.params.behaviour import SPECS, Behaviour
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from flightstack.plan import POSITION_COMMANDS, Command, Plan, load_plan
from flightstack.transport.udp import PortBusyError, UdpSocket
from gcs_cli.errors import USAGE, CliError
from gcs_cli.flight_limit import LONGEST_S, flight_limit_s
from gcs_cli.param_file import load_parameters
from gcs_cli.plan_parts import plan_problem
from gcs_cli.run_directory import LOG_NAME

CONTROLLERS = "flightstack.attitude_controllers"
PLANTS = ("rigid", "multibody", "paper")
DEFAULT_HOME = GeoPoint(47.397742, 8.545594, 488.0)
GCS_LOSS_S = 5.0
MOST_INSTANCES = 100
_RETURN = Command.NAV_RETURN_TO_LAUNCH


@dataclass(frozen=True)
class FlyOptions:
    """The flags of ``gcs fly``."""

    plan_path: Path
    controller: str = "pid"
    gains: str = "tuned"
    plant: str = "rigid"
    speed: str = "max"
    inner_hz: float = 500.0
    outer_hz: float | None = None
    seed: int = 1
    wind: str | None = None
    gust: float | None = None
    torque_gust: float | None = None
    vehicle: str = "paper_quad"
    instance: int = 0
    ideal_rotors: bool = False
    timeout_s: float = 60.0
    limit_s: float | None = None
    battery_start: float | None = None
    battery_capacity: float | None = None
    battery_drain: float | None = None
    faults: tuple[str, ...] = ()
    params: Path | None = None
    loops: str = PYTHON

    @property
    def outer_rate_hz(self) -> float:
        """Rate of the outer loop: as given, else the one nearest to 100 Hz that divides the inner one."""
        if self.outer_hz is not None:
            return self.outer_hz
        return nearest_outer_hz(self.inner_hz)

    @property
    def speed_factor(self) -> float:
        """How many times real time the flight shall be; infinite for ``max``."""
        return math.inf if self.speed == "max" else float(self.speed)

    @property
    def gcs_port(self) -> int:
        """UDP port to which the vehicle sends."""
        return 14550 + 10 * self.instance

    @property
    def simulator_port(self) -> int:
        """TCP port on which the simulator listens."""
        return 4560 + self.instance


def checked_plan(options: FlyOptions) -> Plan:
    """Check all that can be before anything starts, and return the plan; raise CliError or ConfigError."""
    _check_flags(options)
    plan = load_plan(options.plan_path)
    load_vehicle(options.vehicle)
    open_gains(options.gains)
    if options.params is not None and not options.params.is_file():
        raise CliError(f"--params {options.params}: there is no such file", USAGE)
    rates(options.inner_hz, options.outer_rate_hz)
    if not plan.items:
        raise CliError(f"{options.plan_path}: holds no mission to fly", USAGE)
    problem = plan_problem(plan, plan.home or DEFAULT_HOME)
    if problem is not None:
        raise CliError(f"{options.plan_path}: {problem}", USAGE)
    moving = (item.command for item in plan.items if item.command in POSITION_COMMANDS | {_RETURN})
    if next(moving, None) in (Command.NAV_LAND, _RETURN):
        problem = "the mission begins with a landing or a return, and the vehicle stands on the ground"
        raise CliError(f"{options.plan_path}: {problem}", USAGE)
    return plan


def longest_flight_s(options: FlyOptions, plan: Plan) -> float:
    """Return the simulated time after which the flight is given up: as asked for, else as the plan needs.

    Raise ConfigError for a parameter file that is not one.
    """
    if options.limit_s is not None:
        return options.limit_s
    behaviour = Behaviour()
    if options.params is not None:
        for name, value in load_parameters(options.params).items():
            if name in SPECS:
                behaviour = behaviour.updated(name, value)
    return flight_limit_s(plan.items, plan.home or DEFAULT_HOME, behaviour)


def _check_flags(options: FlyOptions) -> None:
    known = sorted(point.name for point in entry_points(group=CONTROLLERS))
    if options.controller not in known:
        raise CliError(
            f"--controller {options.controller}: there is none; known are {', '.join(known)}", USAGE
        )
    if options.plant not in PLANTS:
        raise CliError(f"--plant {options.plant}: expected {', '.join(PLANTS[:-1])} or {PLANTS[-1]}", USAGE)
    if options.plant == "multibody" and find_spec("mujoco") is None:
        raise CliError("--plant multibody needs MuJoCo: pip install 'flightstack[multibody]'", USAGE)
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
    _number("--gust", options.gust or 0.0, 0.0, 50.0)
    _number("--torque-gust", options.torque_gust or 0.0, 0.0, 100.0)
    _number("--seed", options.seed, 0, 2**31 - 1)
    _number("--instance", options.instance, 0, MOST_INSTANCES - 1)
    _number("--timeout", options.timeout_s, 0.1, 86_400.0)
    _number("--limit", _or(options.limit_s, LONGEST_S), 1.0, LONGEST_S)
    _number("--battery-start", _or(options.battery_start, 100.0), 0.0, 100.0)
    _number("--battery-capacity", _or(options.battery_capacity, 1.0), 1.0, 1e6)
    _number("--battery-drain", _or(options.battery_drain, 1.0), 0.0, 1e4)


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _number(flag: str, value: str | float, low: float, high: float) -> None:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not low <= number <= high:
        raise CliError(f"{flag} {value}: expected a number from {low:.10g} to {high:.10g}", USAGE)


def check_ports(options: FlyOptions) -> None:
    """Make sure that the children find their ports free; raise CliError (usage) naming a busy one."""
    local = "127.0.0.1"
    try:
        for port in (18570 + options.instance, 14580 + options.instance):
            UdpSocket(local, port).close()
    except PortBusyError as error:
        raise busy(error) from None
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((local, options.simulator_port))
            probe.listen(1)
        except OSError:
            problem = PortBusyError("TCP", (local, options.simulator_port), "is in use")
            raise busy(problem) from None


def busy(error: PortBusyError) -> CliError:
    """Return what to tell the user about a busy port."""
    return CliError(f"{error}: end the program that uses it, or fly beside it with --instance N", USAGE)


def simulator_arguments(options: FlyOptions, home: GeoPoint) -> list[str]:
    """Return the command line of ``sim-bridge``."""
    arguments = [
        f"--vehicle={options.vehicle}",
        f"--plant={options.plant}",
        f"--speed={options.speed}",
        f"--port={options.simulator_port}",
        f"--instance={options.instance}",
        f"--seed={options.seed}",
        f"--home={_home(home)}",
        f"--timeout={options.timeout_s:g}",
    ]
    if options.wind is not None:
        arguments.append(f"--wind={options.wind}")
    if options.gust is not None:
        arguments.append(f"--gust={options.gust}")
    if options.torque_gust is not None:
        arguments.append(f"--torque-gust={options.torque_gust}")
    battery = {
        "start": options.battery_start,
        "capacity": options.battery_capacity,
        "drain": options.battery_drain,
    }
    arguments += [f"--battery-{name}={value!r}" for name, value in battery.items() if value is not None]
    arguments += [f"--fault={fault}" for fault in options.faults]  # the simulator knows what they may be
    return [*arguments, "--ideal-rotors"] if options.ideal_rotors else arguments


def stack_arguments(options: FlyOptions, home: GeoPoint, folder: Path) -> list[str]:
    """Return the command line of ``flightstack``."""
    arguments = [
        f"--vehicle={options.vehicle}",
        f"--controller={options.controller}",
        f"--gains={options.gains}",
        f"--loops={options.loops}",
        f"--inner-hz={options.inner_hz!r}",
        f"--outer-hz={options.outer_rate_hz!r}",
        f"--sim-port={options.simulator_port}",
        f"--sim-timeout={options.timeout_s:g}",
        f"--instance={options.instance}",
        f"--gcs-port={options.gcs_port}",
        f"--log={folder / LOG_NAME}",
        f"--home={_home(home)}",
        f"--exit-on-gcs-loss={GCS_LOSS_S:g}",
        f"--params={options.params or 'none'}",
        "--wait-for-start",
    ]
    return [*arguments, "--ideal-rotors"] if options.ideal_rotors else arguments


def _home(home: GeoPoint) -> str:
    return f"{home.latitude_deg!r},{home.longitude_deg!r},{home.altitude_m!r}"
