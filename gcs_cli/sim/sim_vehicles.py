"""The vehicles of ``gcs sim``: their options, start positions, command lines and connection strings. Pure."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.port_numbers import (
    INSTANCES,
    api_client_port,
    ground_station_port,
    system_id,
    tcp_port,
)
from flightstack.params.config import DEFAULT_HOME, parse_home
from gcs_cli.errors import USAGE, CliError
from gcs_cli.fly.fly_flags import TO_STACK as FLOWN_TO_STACK
from gcs_cli.fly.fly_flags import passed
from gcs_cli.fly.fly_options import home_text, outer_rate_hz
from gcs_cli.link.endpoint import LOOPBACK, vehicle_connection
from gcs_cli.sim.sim_flags import TO_STACK, SimOptions
from gcs_cli.vehicle.param_info import load_parameters, number_text

NONE = "none"
_ALL_INTERFACES = "0.0.0.0"


def vehicles_of(options: SimOptions) -> list[SimOptions]:
    """Return the options of each vehicle; raise CliError (usage) or ConfigError.

    Each has an instance, a start position and a seed of its own; several vehicles share no file that they write. All
    send to the ground station of the first, as PX4's instances do, so that one view shows them.
    """
    first = DEFAULT_HOME if options.home is None else parse_home(options.home)
    if options.instance + options.vehicles > INSTANCES:
        raise CliError(
            f"--vehicles {options.vehicles}: the last instance would be {options.instance + options.vehicles - 1}, "
            f"allowed are 0 to {INSTANCES - 1}",
            USAGE,
        )
    single = options.vehicles == 1
    assignments = [] if single else shared_parameters(options)
    stations = (
        options.gcs if single else options.gcs or [f"{LOOPBACK}:{ground_station_port(options.instance)}"]
    )
    frame = LocalFrame(first)
    return [
        replace(
            options,
            instance=options.instance + index,
            seed=options.seed + index,
            gcs=stations,
            home=home_text(frame.to_geo(Vector3(0.0, index * options.spacing, 0.0)) if index else first),
            log=options.log if single else _own_log(options, options.instance + index),
            state_dir=options.state_dir if single else _own_state_dir(options, options.instance + index),
            params=options.params if single or options.params == Path(NONE) else None,
            param=[*assignments, *(options.param or ())] or None,
        )
        for index in range(options.vehicles)
    ]


def shared_parameters(options: SimOptions) -> list[str]:
    """Return the parameters of the file as assignments, without the system id; raise ConfigError."""
    if options.params is None or options.params == Path(NONE):
        return []
    values = load_parameters(options.params)
    return [f"{name}={number_text(value)}" for name, value in values.items() if name != "MAV_SYS_ID"]


def _own_log(options: SimOptions, instance: int) -> str | None:
    if options.log in (None, NONE):
        return options.log
    path = Path(str(options.log))
    return str(path.parent / f"instance-{instance}" / path.name)


def _own_state_dir(options: SimOptions, instance: int) -> str | None:
    if options.state_dir in (None, NONE):
        return options.state_dir
    return str(Path(str(options.state_dir)) / f"instance-{instance}")


def start_of(vehicle: SimOptions) -> GeoPoint:
    """Return the start position of one vehicle."""
    return DEFAULT_HOME if vehicle.home is None else parse_home(vehicle.home)


def stack_arguments(vehicle: SimOptions) -> list[str]:
    """Return the command line of ``flightstack`` for one vehicle."""
    files = {"log": vehicle.log, "state-dir": vehicle.state_dir, "params": vehicle.params}
    signing = [] if vehicle.signing_key is None else [f"--signing-key={vehicle.signing_key}"]
    return [
        *passed(vehicle, FLOWN_TO_STACK),
        *passed(vehicle, TO_STACK),
        f"--outer-hz={outer_rate_hz(vehicle)!r}",
        f"--sim-port={vehicle.simulator_port}",
        f"--sim-timeout={vehicle.timeout_s:g}",
        f"--home={home_text(start_of(vehicle))}",
        *(f"--{name}={value}" for name, value in files.items() if value is not None),
        *signing,
    ]


def station_port(vehicle: SimOptions) -> int | None:
    """Return the UDP port of the ground station on this machine that the vehicle sends to; None if there is none."""
    if not vehicle.gcs:
        return ground_station_port(vehicle.instance)
    ports = (station.rpartition(":") for station in vehicle.gcs)
    return next((int(port) for host, _, port in ports if host == LOOPBACK and port.isdecimal()), None)


def local_host(vehicle: SimOptions) -> str:
    """Return the address at which a program on this machine reaches the vehicle."""
    return "127.0.0.1" if vehicle.listen == _ALL_INTERFACES else vehicle.listen


def connections(vehicle: SimOptions) -> dict[str, Any]:
    """Return how clients reach the vehicle, by stable keys."""
    instance, home = vehicle.instance, start_of(vehicle)
    return {
        "instance": instance,
        "system_id": system_id(instance),
        "mavsdk": f"udpin://127.0.0.1:{api_client_port(instance)}",
        "ground_station_port": station_port(vehicle),
        "gcs": vehicle_connection(instance),
        "tcp": f"tcp:{local_host(vehicle)}:{tcp_port(instance)}",
        "latitude_deg": home.latitude_deg,
        "longitude_deg": home.longitude_deg,
        "altitude_m": home.altitude_m,
    }


def _is_alone(vehicle: SimOptions) -> bool:
    return vehicle.instance == 0 and vehicle.vehicles == 1


def name_of(vehicle: SimOptions) -> str:
    """Return how texts name the vehicle: by its system id and, unless it is instance 0 alone, its instance."""
    name = f"vehicle {system_id(vehicle.instance)}"
    return name if _is_alone(vehicle) else f"{name} (instance {vehicle.instance})"


def ready_text(vehicle: SimOptions) -> str:
    """Return the lines that say how to connect to the vehicle."""
    facts = connections(vehicle)
    key = "" if vehicle.signing_key is None else f" --signing-key {shlex.quote(str(vehicle.signing_key))}"
    number = "" if _is_alone(vehicle) else f" --instance {vehicle.instance}"
    port = station_port(vehicle)
    stations = ", ".join(vehicle.gcs or ()) if port is None else str(port)
    added = "" if port in (None, ground_station_port(0)) else ", added as a link"
    rows = (
        ("MAVSDK", facts["mavsdk"]),
        ("QGroundControl", f"UDP {stations}{added}"),
        ("gcs", f"gcs{key}{number} status"),
        ("any program", facts["tcp"]),
    )
    title = f"{name_of(vehicle)} is ready: {vehicle.vehicle}"
    return "\n".join([title, *(f"  {name:<15} {value}" for name, value in rows)])
