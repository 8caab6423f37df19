"""Parse and check values of the command line; a bad value raises UsageProblemError with one sentence."""

from __future__ import annotations

import math
from importlib.util import find_spec
from numbers import Real

from flightstack.core.contract import Vector3
from flightstack.core.errors import INSTALL_MULTIBODY, plain
from flightstack.core.geodesy import GeoPoint
from flightstack.params.config import CLOCKS, ESTIMATED, STATES
from flightstack.params.vehicle import Vehicle
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.battery import BatteryOptions
from sim_bridge.plant.faults.checks import Client, Flight, check_faults, client_refusal
from sim_bridge.plant.faults.schedule import Fault, parse_fault, shortened
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.plants import MULTIBODY, NO_MUJOCO, PLANT_NAMES
from sim_bridge.simulator import FASTEST_PHYSICS_HZ, SLOWEST_PHYSICS_HZ

_LONGEST_QUOTE = 60


def _quoted(text: str) -> str:
    return repr(text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…")


def parse_numbers(flag: str, text: str, counts: tuple[int, ...]) -> tuple[float, ...]:
    """Parse finite numbers separated by commas; their count must be one of ``counts``."""
    wanted = " or ".join(str(count) for count in counts)
    shown = _quoted(text)
    parts = text.split(",")
    try:
        values = tuple(float(part) for part in parts)
    except ValueError:
        values = ()
    if not values or "_" in text:  # float() accepts 1_000
        raise UsageProblemError(f"{flag}: {shown} is not {wanted} numbers separated by commas")
    if len(values) not in counts:
        has = "1 number" if len(values) == 1 else f"{len(values)} numbers"
        raise UsageProblemError(f"{flag}: {shown} has {has}, {wanted} are needed")
    for value in values:
        check_range(flag, value, -1e9, 1e9)
    return values


def parse_times(flag: str, text: str, most: int) -> tuple[float, ...]:
    """Parse one or more times [s] separated by commas, at most ``most``."""
    count = text.count(",") + 1
    if count > most:
        raise UsageProblemError(f"{flag}: {count} times are more than the allowed {most}")
    try:
        return parse_numbers(flag, text, (count,))
    except UsageProblemError:
        raise UsageProblemError(
            f"{flag}: {_quoted(text)} is not a list of times in seconds, separated by commas"
        ) from None


def parse_vector(flag: str, text: str) -> Vector3:
    """Parse three numbers."""
    x, y, z = parse_numbers(flag, text, (3,))
    return Vector3(x, y, z)


def parse_wind(flag: str, text: str) -> Vector3:
    """Parse north, east and, optionally, down."""
    north, east, down = (*parse_numbers(flag, text, (2, 3)), 0.0)[:3]
    for value in (north, east, down):
        check_range(flag, value, -200.0, 200.0)
    return Vector3(north, east, down)


def check_range(flag: str, value: float, low: float, high: float) -> float:
    """Return ``value`` if it is a number in [low, high]."""
    if not isinstance(value, Real):
        raise UsageProblemError(f"{flag}: {value!r} is not a number")
    if not math.isfinite(value) or not low <= value <= high:
        raise UsageProblemError(
            f"{flag}: {plain(value)} is outside the allowed range {plain(low)} to {plain(high)}"
        )
    return value


def check_plant(name: str) -> str:
    """Return the name of a plant that can be simulated."""
    if name not in PLANT_NAMES:
        raise UsageProblemError(f"--plant: {name!r} is not one of {', '.join(PLANT_NAMES)}")
    if name == MULTIBODY and find_spec("mujoco") is None:
        raise UsageProblemError(NO_MUJOCO)
    return name


def require(what: str, *modules: str) -> None:
    """Raise UsageProblemError if a module of the extra ``multibody`` is not installed."""
    if any(find_spec(module) is None for module in ("mujoco", *modules)):
        raise UsageProblemError(f"{what} needs MuJoCo: {INSTALL_MULTIBODY}")


def parse_speed(text: str) -> float:
    """Parse a speed; "max" is infinite."""
    if text == "max":
        return math.inf
    try:
        value = float(text)
    except ValueError:
        raise UsageProblemError(f"--speed: {text!r} is neither a number nor max") from None
    return check_range("--speed", value, 1e-3, 1e4)


def check_physics_hz(value: float) -> float:
    """Return a valid rate of the integration steps."""
    return check_range("--physics-hz", value, SLOWEST_PHYSICS_HZ, FASTEST_PHYSICS_HZ)


def parse_home(text: str) -> GeoPoint:
    """Parse latitude and longitude [deg] and altitude [m]."""
    latitude, longitude, altitude = parse_numbers("--home", text, (3,))
    check_range("--home latitude", latitude, -89.9, 89.9)
    check_range("--home longitude", longitude, -180.0, 180.0)
    check_range("--home altitude", altitude, -1000.0, 20000.0)
    return GeoPoint(latitude, longitude, altitude)


def parse_boat(text: str) -> Vector3:
    """Parse the velocity north and east [m/s] of the ground."""
    north, east = parse_numbers("--boat", text, (2,))
    return check_boat(Vector3(north, east, 0.0))


def check_boat(velocity: Vector3, flag: str = "--boat") -> Vector3:
    """Return the velocity of the ground if it is in range."""
    for value in velocity:
        check_range(flag, value, -20.0, 20.0)
    return velocity


def check_slope(slope_deg: float, plant: str, boat: Vector3, flag: str = "--slope") -> float:
    """Return the slope of the ground [rad] if this plant can have it."""
    check_range(flag, slope_deg, -30.0, 30.0)
    if slope_deg and plant != "rigid":
        raise UsageProblemError(f"{flag}: the ground of the {plant} plant is level; use the plant rigid")
    if slope_deg and any(boat):
        raise UsageProblemError(f"{flag}: the deck of a boat is level; leave out one of them")
    return math.radians(slope_deg)


def parse_rotor_speeds(text: str, vehicle: Vehicle) -> tuple[float, ...]:
    """Parse one speed [rad/s] for each rotor of the vehicle."""
    speeds = parse_numbers("--rotors", text, (len(vehicle.rotors),))
    for value in speeds:
        check_range("--rotors", value, -1e5, 1e5)
    return speeds


def check_battery(
    vehicle: Vehicle, start_percent: float | None, capacity_mah: float | None, drain: float | None
) -> BatteryOptions:
    """Return the battery options; None is the default of each."""
    given = {"--battery-start": start_percent, "--battery-capacity": capacity_mah, "--battery-drain": drain}
    flags = [flag for flag, value in given.items() if value is not None]
    if flags and vehicle.battery is None:
        raise UsageProblemError(f"{flags[0]}: the vehicle {vehicle.name} has no [battery]")
    start = 100.0 if start_percent is None else check_range("--battery-start", start_percent, 0.0, 100.0)
    if capacity_mah is not None:
        check_range("--battery-capacity", capacity_mah, 1.0, 1e6)
    factor = 1.0 if drain is None else check_range("--battery-drain", drain, 0.0, 1e4)
    return BatteryOptions(start / 100.0, capacity_mah, factor)


def parse_faults(texts: list[str], vehicle: Vehicle, plant: str, options: PlantOptions) -> tuple[Fault, ...]:
    """Parse the faults, and check that each can act."""
    faults = tuple(parse_fault(text, len(vehicle.rotors), "--fault") for text in texts)
    check_faults(faults, Flight(vehicle, plant, options), [f"--fault {shortened(text)}" for text in texts])
    return faults


def check_client(faults: tuple[Fault, ...], state: str | None, clock: str | None) -> None:
    """Check state and clock of the flight stack, and that each fault can act on it, if both are known."""
    if state is not None and state not in STATES:
        problem = f"is not one of {', '.join(STATES)}"
        raise UsageProblemError(f"--state: {state}: {problem}")
    if clock is not None and clock not in CLOCKS:
        raise UsageProblemError(f"--clock: {clock}: is not one of {', '.join(CLOCKS)}")
    if state is None or clock is None:
        return
    on_sensors = state == ESTIMATED
    refusal = client_refusal(faults, Client(on_sensors, on_sensors, clock == "lockstep"))
    if refusal is not None:
        raise UsageProblemError(f"--fault: {refusal}")
