"""Numbers of MAVLink's mission protocol; a test compares them with pymavlink's."""

from __future__ import annotations

from enum import IntEnum

MAX_MISSION_ITEMS = 2000
MAX_FENCE_ITEMS = 200
"""Vertices and circles of a geofence, limited because validation compares all pairs of edges."""
MAX_RALLY_POINTS = 100

UNSET_E7 = 2**31 - 1
"""x or y of an item without latitude or longitude: INT32_MAX, MAVLink's integer for NaN."""

ALSO_UNSET_E7 = -(2**31)
"""Sent for NaN by ground stations that cast it to an integer on x86."""


class Command(IntEnum):
    """MAV_CMD of the supported mission items."""

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
    """MAV_FRAME of mission items. The INT and the plain forms are equivalent for integer x and y."""

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
"""Commands with a position in x, y and z."""

FOREIGN_PLACE_COMMANDS = frozenset({17, 18, 31, 82, 84, 85, 94, 189, 195, 201})
"""Other mission commands of MAVLink with latitude and longitude, which other vehicles fly."""

PLACE_COMMANDS: frozenset[int] = (
    POSITION_COMMANDS | FOREIGN_PLACE_COMMANDS | frozenset(FenceCommand) | {RALLY_POINT}
)
"""Commands with latitude and longitude in x and y."""

OPEN_POSITION_COMMANDS = frozenset({Command.NAV_LAND, Command.NAV_TAKEOFF})
"""Commands whose position is optional: the default is the vehicle's position."""

NAV_COMMANDS = POSITION_COMMANDS | {Command.NAV_RETURN_TO_LAUNCH, Command.NAV_DELAY}
"""Commands that take time; the others complete immediately."""

RELATIVE_FRAMES = frozenset({Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT})
GLOBAL_FRAMES = RELATIVE_FRAMES | {Frame.GLOBAL, Frame.GLOBAL_INT}
TERRAIN_FRAMES = frozenset({10, 11})
"""MAV_FRAME_GLOBAL_TERRAIN_ALT and its INT form: altitude above the terrain, which other vehicles fly."""
SCALED_FRAMES: frozenset[int] = GLOBAL_FRAMES | TERRAIN_FRAMES
"""Frames whose x and y are a latitude and longitude."""


PLAN_NAMES = {
    MissionType.MISSION: "mission",
    MissionType.FENCE: "geofence",
    MissionType.RALLY: "list of rally points",
}
"""Name of each plan type in messages."""


def result_name(result: int) -> str:
    """Return the name of a MAV_MISSION_RESULT; unknown values are valid."""
    try:
        return f"MAV_MISSION_{MissionResult(result).name}"
    except ValueError:
        return f"MAV_MISSION_RESULT {result}"


def command_name(command: int) -> str:
    """Return the name of a command, or its number if unknown."""
    if command == RALLY_POINT:
        return "RALLY_POINT"
    if command in FenceCommand.__members__.values():
        return f"FENCE_{FenceCommand(command).name}"
    try:
        return Command(command).name
    except ValueError:
        return f"command {command}"
