"""Validation of values in plan files of both formats. Errors name file, item and field."""

from __future__ import annotations

import math
from typing import Any

from flightstack.core.errors import ConfigError
from flightstack.core.float32 import as_float32
from flightstack.core.geodesy import GeoPoint
from flightstack.plan.commands import (
    MAX_MISSION_ITEMS,
    OPEN_POSITION_COMMANDS,
    POSITION_COMMANDS,
    SCALED_FRAMES,
    TERRAIN_FRAMES,
    Frame,
    command_name,
)
from flightstack.plan.item import MissionItem, integer_coordinate

_FIELDS = ("param 1", "param 2", "param 3", "param 4", "latitude", "longitude", "altitude")
_PLAIN_FIELDS = (*_FIELDS[:4], "param 5", "param 6", "param 7")
_RANGE_DEG = {4: 90.0, 5: 180.0}


def check_count(file: object, count: int) -> None:
    """Raise ConfigError for too many items."""
    if count > MAX_MISSION_ITEMS:
        problem = f"has {count} items, and at most {MAX_MISSION_ITEMS} are allowed"
        raise ConfigError(file, "mission", problem)


def number(file: object, key: str, value: Any) -> float:
    """Return a JSON number within float32 range; NaN for null."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(file, key, f"{value!r:.40} must be a number or null")
    try:
        result = float(value)
    except OverflowError:  # an integer beyond the range of float
        result = math.inf
    if math.isinf(as_float32(result)):
        raise ConfigError(file, key, f"{result:g} must be a finite 32-bit number")
    return result


def integer(file: object, key: str, value: Any, high: int) -> int:
    """Return a whole number from 0 to ``high``."""
    if value is None:
        raise ConfigError(file, key, f"is missing; it must be a whole number from 0 to {high}")
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= high:
        raise ConfigError(file, key, f"{value!r:.40} must be a whole number from 0 to {high}")
    return value


def command(file: object, key: str, value: Any) -> int:
    """Return a MAV_CMD: files hold the commands of any vehicle, and the vehicle refuses those that it does not know."""
    return integer(file, key, value, 65535)


def frame(file: object, key: str, value: Any) -> int:
    """Return a frame of MISSION_ITEM_INT in which coordinates are degrees or plain numbers."""
    code = integer(file, key, value, 255)
    if code not in SCALED_FRAMES and code != Frame.MISSION:
        names = {
            **{int(known): known.name for known in Frame},
            **dict.fromkeys(TERRAIN_FRAMES, "GLOBAL_TERRAIN_ALT"),
        }
        allowed = ", ".join(f"{number} {name}" for number, name in sorted(names.items()))
        raise ConfigError(file, key, f"{code} is not supported; supported are {allowed}")
    return code


def mission_item(
    file: object, where: str, code: int, frame_code: int, values: list[float], *, autocontinue: bool
) -> MissionItem:
    """Return the item with these seven parameters; raise ConfigError for a bad position."""
    is_global = frame_code in SCALED_FRAMES
    for index, limit_deg in _RANGE_DEG.items() if is_global else ():
        value = values[index]
        if math.isnan(value):
            if code in POSITION_COMMANDS - OPEN_POSITION_COMMANDS:
                problem = f"is NaN (null), and a {command_name(code)} needs -{limit_deg:g} to {limit_deg:g}"
                raise ConfigError(file, f"{where}, {_FIELDS[index]}", problem)
        elif not abs(value) <= limit_deg:
            problem = f"{value:.9g} is outside the allowed range -{limit_deg:g} to {limit_deg:g}"
            raise ConfigError(file, f"{where}, {_FIELDS[index]}", problem)
    x, y = (integer_coordinate(values[index], is_global) for index in (4, 5))
    param1, param2, param3, param4 = values[:4]
    return MissionItem(
        int(code), int(frame_code), param1, param2, param3, param4, x, y, values[6], autocontinue
    )


def field_name(index: int, is_global: bool) -> str:
    """Return the name of a parameter (0 to 6) in error messages."""
    return (_FIELDS if is_global else _PLAIN_FIELDS)[index]


def home_position(file: object, key: str, values: list[float]) -> GeoPoint:
    """Return the home position of latitude, longitude [deg] and altitude [m]."""
    for index, name in enumerate(("latitude", "longitude", "altitude")):
        if not math.isfinite(values[index]):
            raise ConfigError(file, key, f"{name} {values[index]} must be a finite number")
    for index, (name, limit_deg) in enumerate((("latitude", 90.0), ("longitude", 180.0))):
        if abs(values[index]) > limit_deg:
            allowed = f"the allowed range -{limit_deg:g} to {limit_deg:g}"
            raise ConfigError(file, key, f"{name} {values[index]:.9g} is outside {allowed}")
    return GeoPoint(*values)
