"""The numbers of MAVLink's mission vocabulary that this project uses (a test holds them to pymavlink's)."""

from __future__ import annotations

from enum import IntEnum

MAX_MISSION_ITEMS = 2000
MAX_FENCE_ITEMS = 200
"""Vertices and circles of a geofence. Its check compares every pair of edges."""
MAX_RALLY_POINTS = 100

UNSET_E7 = 2**31 - 1
"""x or y of an item that leaves its latitude or longitude open: NaN, which an integer cannot hold."""

ALSO_UNSET_E7 = -(2**31)
"""What a NaN becomes in ground stations that cast it to an integer on x86."""


class Command(IntEnum):
    """MAV_CMD of the mission items that the vehicle flies."""

    NAV_WAYPOINT = 16
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_DELAY = 93
    CONDITION_YAW = 115
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178


class FenceCommand(IntEnum):
    """MAV_CMD of the items of a geofence."""

    RETURN_POINT = 5000
    POLYGON_VERTEX_INCLUSION = 5001
    POLYGON_VERTEX_EXCLUSION = 5002
    CIRCLE_INCLUSION = 5003
    CIRCLE_EXCLUSION = 5004


RALLY_POINT = 5100
"""MAV_CMD_NAV_RALLY_POINT, the only item of a list of rally points."""


class Frame(IntEnum):
    """MAV_FRAME of mission items. With an integer x and y, the INT and the plain form mean the same."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6


class MissionType(IntEnum):
    """MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2
    ALL = 255


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15


POSITION_COMMANDS = frozenset(
    {Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME, Command.NAV_LAND, Command.NAV_TAKEOFF}
)
"""Commands whose x, y and z are a position."""

PLACE_COMMANDS: frozenset[int] = POSITION_COMMANDS | frozenset(FenceCommand) | {RALLY_POINT}
"""Commands whose x and y are a latitude and longitude."""

OPEN_POSITION_COMMANDS = frozenset({Command.NAV_LAND, Command.NAV_TAKEOFF})
"""Commands that may leave their position open: the vehicle's own is meant."""

NAV_COMMANDS = POSITION_COMMANDS | {Command.NAV_RETURN_TO_LAUNCH, Command.NAV_DELAY}
"""Commands that take time to fly; the others are done at once."""

RELATIVE_FRAMES = frozenset({Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT})
GLOBAL_FRAMES = RELATIVE_FRAMES | {Frame.GLOBAL, Frame.GLOBAL_INT}


PLAN_NAMES = {
    MissionType.MISSION: "mission",
    MissionType.FENCE: "geofence",
    MissionType.RALLY: "list of rally points",
}
"""What a user calls the plan of each type."""


def result_name(result: int) -> str:
    """Return the name of a MAV_MISSION_RESULT, whatever its value on the wire."""
    try:
        return f"MAV_MISSION_{MissionResult(result).name}"
    except ValueError:
        return f"MAV_MISSION_RESULT {result}"


def command_name(command: int) -> str:
    """Return the name of a command, or its number when it is not one of ours."""
    if command == RALLY_POINT:
        return "RALLY_POINT"
    if command in FenceCommand.__members__.values():
        return f"FENCE_{FenceCommand(command).name}"
    try:
        return Command(command).name
    except ValueError:
        return f"command {command}"
