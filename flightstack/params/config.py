"""Configuration of the flight stack at startup."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.params.behaviour import Behaviour
from flightstack.params.gains_file import DEFAULT_GAINS
from flightstack.params.spec import ParamSpec, group_of
from flightstack.params.vehicle import DEFAULT_VEHICLE

DEFAULT_HOME = GeoPoint(47.397742, 8.545594, 488.0)
DEFAULT_CONTROLLER = "pid"
DEFAULT_INNER_HZ = 500.0
DEFAULT_OUTER_HZ = 100.0
ESTIMATED, TRUTH = "estimated", "truth"
STATES = (ESTIMATED, TRUTH)
"""Sources of the state: the vehicle's sensors, or the simulator."""
CLOCKS = ("lockstep", "realtime")
"""Sources of the time: the simulator, or the computer."""
FLOWN_ON = {ESTIMATED: "on its sensors", TRUTH: "on the true state"}
"""Description of the vehicle's configuration, for people."""
DEFAULT_STATE = ESTIMATED


@dataclass(frozen=True)
class StackConfig:
    """Configuration of a flight; the same configuration gives the same log."""

    vehicle: str = DEFAULT_VEHICLE
    controller: str = DEFAULT_CONTROLLER
    gains: str = DEFAULT_GAINS
    loops: str = "python"
    """Control loops in use; syntax in ``flightstack.firmware.choice``."""
    inner_hz: float = DEFAULT_INNER_HZ
    outer_hz: float = DEFAULT_OUTER_HZ
    state: str = DEFAULT_STATE
    """Source of the state, one of ``STATES``."""
    ideal_rotors: bool = False
    lockstep: bool = True
    home: GeoPoint = DEFAULT_HOME
    system_id: int = 1
    behaviour: Behaviour = field(default_factory=Behaviour)
    params_file: str | None = None
    """Parameter file loaded at startup."""
    params: tuple[str, ...] = ()
    """``NAME=VALUE`` of any parameter, for this run only; overrides the file and ``behaviour``."""


def parse_home(text: str) -> GeoPoint:
    """Read ``LAT,LON,ALT``; raise ConfigError."""
    try:
        latitude, longitude, altitude = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(
            "--home", text, "must be LATITUDE,LONGITUDE,ALTITUDE in degrees and metres"
        ) from None
    if not (
        abs(latitude) < 90.0 and abs(longitude) <= 180.0 and math.isfinite(altitude) and abs(altitude) < 2e4
    ):
        raise ConfigError("--home", text, "is not a place on earth")
    return GeoPoint(latitude, longitude, altitude)


SYSTEM_ID, AUTOPILOT = "MAV_SYS_ID", "FS_AUTOPILOT"
PX4_COMPATIBLE, GENERIC = 0, 1
"""Values of FS_AUTOPILOT."""


def identity_specs(system_id: int) -> tuple[ParamSpec, ...]:
    """Return the parameters of the vehicle's identity, read once at startup; ``system_id`` is the default."""
    return (
        ParamSpec(
            SYSTEM_ID, system_id, 1, 250, "", "MAVLink system id", True, group_of(SYSTEM_ID), 0, (), True
        ),
        ParamSpec(
            AUTOPILOT, PX4_COMPATIBLE, 0, 1, "", "Autopilot type reported to ground stations", True,
            group_of(AUTOPILOT), 0,
            ((PX4_COMPATIBLE, "PX4 (compatible modes and altitudes)"), (GENERIC, "Generic autopilot")), True,
        ),
    )  # fmt: skip
