"""The type of the tables in this package: the facts about one autopilot that the ground station needs. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import NamedTuple, TypeAlias


class VehicleCommand(NamedTuple):
    """A MAV_CMD with its parameters; omitted ones are zero.

    With ``frame`` (MAV_FRAME) it is sent as COMMAND_INT, else as COMMAND_LONG. Latitude and longitude (parameters 5
    and 6) are in degrees in both.
    """

    number: int
    params: tuple[float, ...] = ()
    frame: int | None = None


Storage: TypeAlias = Callable[[float], float]
"""Returns what a vehicle keeps of a value."""
Packing: TypeAlias = Mapping[int, Sequence[Storage]]
"""For a MAV_CMD, the storage of its first four parameters; without an entry they are kept as they are."""


class Role(Enum):
    """Tasks that every autopilot has a mode for, each by another name."""

    HOLD = "hold"
    RETURN = "return"
    LAND = "land"
    TAKEOFF = "takeoff"
    GUIDED = "guided"
    """Flies to positions that the ground station commands."""
    MISSION = "mission"
    TERMINATION = "termination"
    """The flight has ended for good."""


class Phase(Enum):
    """Steps of a takeoff, of a turn or of the start of a mission."""

    GUIDED = "guided"
    ARM = "arm"
    TAKEOFF = "takeoff"
    START = "start"


class Autopilot(NamedTuple):
    """Facts about one autopilot."""

    name: str
    """Stable identifier: ``px4``, ``ardupilot`` or ``generic``."""
    title: str
    """Name in sentences."""
    mode_names: Callable[[int], Mapping[int, str]]
    """Names of the custom modes, for a MAV_TYPE; empty if only the vehicle knows them."""
    selectable: Callable[[int, int], bool]
    """True if a user may select a custom mode, for a MAV_TYPE and the mode."""
    roles: Mapping[Role, str]
    """Name of the mode of each role that has one."""
    aliases: Mapping[str, str]
    """Other names of modes."""
    select_mode: Callable[[int], VehicleCommand]
    """Command that selects a custom mode."""
    takeoff_phases: tuple[Phase, ...]
    takeoff_frame: int | None
    """Frame of the altitude of NAV_TAKEOFF; None: above mean sea level in a COMMAND_LONG."""
    has_takeoff_altitude: bool
    """True if the vehicle has an altitude of its own for a takeoff without one (NaN)."""
    goto_frame: int
    """Frame of the altitude of DO_REPOSITION."""
    goto_keeps_altitude: bool
    """True if an altitude of NaN keeps the present one."""
    yaw: Callable[[float], VehicleCommand]
    """Command that turns to a heading [deg]."""
    yaw_phases: tuple[Phase, ...]
    """Steps before that command."""
    default_speed: float | None
    """Speed in DO_CHANGE_SPEED that restores the default; None: there is no such value."""
    speed_modes: Callable[[int], Sequence[str]]
    """Modes in which the speed can be set, for a MAV_TYPE; empty: any, or unknown."""
    start_phases: tuple[Phase, ...]
    """Steps of the start of a mission on the ground, disarmed."""
    stream_groups_hz: Mapping[int, int]
    """Rates of MAV_DATA_STREAM groups to request, because the vehicle streams nothing until asked; empty: it does."""
    stream_messages_hz: Mapping[int, float]
    """Rates of single messages to request that are in none of those groups."""
    reports_estimator: bool
    """True if the vehicle sends ESTIMATOR_STATUS or EKF_STATUS_REPORT."""
    lacks_messages: frozenset[int]
    """Messages not to request: the vehicle answers each request with a warning, or with a value of a former flight."""
    sends_modes_as_stream: bool
    """True if AVAILABLE_MODES is sent one mode per stream interval, so that its rate must be raised first."""
    refusal_prefixes: tuple[str, ...]
    """Beginnings of the STATUSTEXT that explains a refusal; the reason follows."""
    casts_parameters: bool
    """True if an integer parameter is sent as the float of its value, False if as a float of its bits."""
    mission_begins_with_home: bool
    """True if item 0 of a mission is the home position, and the first command is item 1."""
    replaces_plans_at_once: bool
    """True if an upload that ends early leaves the former plan; False if it overwrites the plan item by item."""
    stores_items_exactly: bool
    """True if a downloaded item equals the uploaded one; False if frames and unused fields may differ."""
    is_silent_without_logs: bool
    """True if LOG_REQUEST_LIST has no answer while the vehicle has no logs."""
    sends_logs_armed: bool
    """True if the vehicle answers requests for logs while it is armed."""
    counters: frozenset[str] = frozenset()
    """Parameters that the vehicle counts itself and does not let others set: a file of parameters is loaded without."""
    packing: Callable[[int], Packing] = lambda _vehicle_type: {}
    """What is kept of the parameters of a mission item, for a MAV_TYPE."""
    log_suffix: str = ".ulg"
    """End of the name of a downloaded log."""

    def mode_name(self, vehicle_type: int, custom_mode: int) -> str | None:
        """Return the name of a custom mode; None if it is unknown."""
        return self.mode_names(vehicle_type).get(custom_mode)

    def role_mode(self, role: Role, vehicle_type: int) -> int | None:
        """Return the custom mode of a role; None if the table has none."""
        return self.mode_number(self.roles.get(role, ""), vehicle_type)

    def mode_number(self, name: str, vehicle_type: int) -> int | None:
        """Return the custom mode of a name in any case, with any signs between its words; None if unknown."""
        wanted = plain_name(name)
        wanted = plain_name(self.aliases.get(wanted, wanted))
        names = self.mode_names(vehicle_type)
        return next((number for number, known in names.items() if plain_name(known) == wanted), None)


def plain_name(name: str) -> str:
    """Return the letters and digits of the name of a mode, in upper case."""
    return "".join(character for character in name.upper() if character.isalnum())
