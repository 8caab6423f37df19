"""``QGC WPL 110``, the text format of Mission Planner, MAVProxy and older QGroundControl.

The first row is the planned home, followed by the mission. Items are numbered from 1 in the file and from 0 in MAVLink,
so that targets of DO_JUMP shift by one, as in QGroundControl.
"""

from __future__ import annotations

import math
from dataclasses import replace

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import values
from flightstack.plan.commands import Command
from flightstack.plan.item import MissionItem, Plan, float_coordinate

WAYPOINTS_HEADER = "QGC WPL 110"
_COLUMNS = 12
_UNSET_HOME = GeoPoint(0.0, 0.0, 0.0)  # written by ground stations without a home


def read_waypoints(text: str, file: object) -> Plan:
    """Parse a waypoint file; raise ConfigError with ``file`` as its name."""
    lines = text.splitlines()
    if lines[0].strip() != WAYPOINTS_HEADER:
        problem = f"{lines[0].strip()!r:.40} must be {WAYPOINTS_HEADER!r}; other versions are not supported"
        raise ConfigError(file, "line 1", problem)
    rows: list[tuple[int, list[str]]] = []
    comments: list[tuple[int, str]] = []
    for line_number, line in enumerate(lines[1:], start=2):
        if line.startswith("#"):
            comments.append((len(rows), line[1:].strip()))
        elif line.strip():
            rows.append((line_number, line.split()))
    values.check_count(file, len(rows) - 1)
    home = _home(file, *rows[0]) if rows else None
    items = tuple(_item(file, row, *rows[row], len(rows)) for row in range(1, len(rows)))
    return Plan(items, home, comments=tuple(comments))


def _columns(file: object, line_number: int, columns: list[str]) -> list[float]:
    where = f"line {line_number}"
    if len(columns) != _COLUMNS:
        raise ConfigError(file, where, f"has {len(columns)} values and must have {_COLUMNS}")
    numbers = []
    for text in columns:
        try:
            parsed = float(text)
        except ValueError:
            raise ConfigError(file, where, f"{text!r:.40} is not a number") from None
        numbers.append(values.number(file, where, parsed))
    return numbers


def _home(file: object, line_number: int, columns: list[str]) -> GeoPoint | None:
    numbers = _columns(file, line_number, columns)
    where = f"line {line_number} (home)"
    if numbers[3] not in (0.0, float(Command.NAV_WAYPOINT)):  # Mission Planner writes command 0
        problem = f"the first line is the home position and must have command 16, not {numbers[3]:g}"
        raise ConfigError(file, where, problem)
    home = values.home_position(file, where, numbers[8:11])
    return None if home == _UNSET_HOME else home


def _item(file: object, row: int, line_number: int, columns: list[str], rows: int) -> MissionItem:
    numbers = _columns(file, line_number, columns)
    where = f"line {line_number}, item {row - 1}"
    code = values.command(file, f"{where}, command", numbers[3])
    frame = values.frame(file, f"{where}, frame", numbers[2])
    item = values.mission_item(file, where, code, frame, numbers[4:11], autocontinue=numbers[11] != 0.0)
    if code != Command.DO_JUMP:
        return item
    if not 1.0 <= item.param1 < rows or not item.param1.is_integer():
        problem = f"is {item.param1:g}, and the first column of the file's items has 1 to {rows - 1}"
        raise ConfigError(file, f"{where}, param 1 (DO_JUMP)", problem)
    return replace(item, param1=item.param1 - 1.0)


def plan_to_waypoints(plan: Plan, file: object) -> str:
    """Return the text of a waypoint file; raise ConfigError for a plan with geofence or rally points."""
    if plan.has_fence_or_rally:
        raise ConfigError(file, "", "this format has no geofence and rally points: save as .plan")
    home = plan.home or _UNSET_HOME
    rows = ["\t".join(("0", "1", "0", "16", "0", "0", "0", "0", *(_text(value) for value in home), "1"))]
    rows += [_row(index, item) for index, item in enumerate(plan.items, start=1)]
    lines = [WAYPOINTS_HEADER]
    for index, row in enumerate(rows):
        lines += [f"# {text}" for before, text in plan.comments if before == index]
        lines.append(row)
    lines += [f"# {text}" for before, text in plan.comments if before >= len(rows)]
    return "\n".join(lines) + "\n"


def _row(index: int, item: MissionItem) -> str:
    shift = 1.0 if item.command == Command.DO_JUMP else 0.0
    numbers = (
        item.param1 + shift, item.param2, item.param3, item.param4,
        float_coordinate(item.x, item.is_global), float_coordinate(item.y, item.is_global), item.z,
    )  # fmt: skip
    head = (str(index), "0", str(item.frame), str(item.command))
    return "\t".join((*head, *(_text(value) for value in numbers), str(int(item.autocontinue))))


def _text(value: float) -> str:
    """Return the shortest text that reads back as the same float."""
    if math.isfinite(value) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return repr(value)
