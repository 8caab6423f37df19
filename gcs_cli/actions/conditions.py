"""Conditions on a vehicle as a user writes them: ``disarmed``, ``mode=HOLD``, ``altitude>9.5``. Pure."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

from gcs_cli.actions.on_vehicle import find_mode
from gcs_cli.actions.progress import horizontal_m
from gcs_cli.vehicle.view_types import GeoPosition, VehicleView

COMPLETE = "complete"
POSITION_RADIUS_M = 2.0
"""Radius of ``position=`` without one."""


class ConditionError(ValueError):
    """A condition that is not understood; one sentence."""


class ViewCondition(NamedTuple):
    """A condition with the text that the user wrote."""

    text: str
    holds: Callable[[VehicleView], bool]
    value: Callable[[VehicleView], str]
    """The present value as text."""
    mode: str = ""
    """Name of the mode that it needs."""


class _Quantity(NamedTuple):
    read: Callable[[VehicleView], float | None]
    unit: str = ""


def _battery_percent(view: VehicleView) -> float | None:
    remaining = None if view.battery is None else view.battery.remaining
    return None if remaining is None else remaining * 100.0


def distance_home_m(view: VehicleView) -> float | None:
    """Return the horizontal distance from home [m]; None if unknown."""
    if view.home is None or view.geo is None:
        return None
    return horizontal_m(view.geo, view.home)


def _heading_deg(view: VehicleView) -> float | None:
    if view.attitude is None:
        return view.heading_deg
    return math.degrees(view.attitude.yaw_rad) % 360.0


QUANTITIES: Mapping[str, _Quantity] = {
    "altitude": _Quantity(lambda view: view.relative_altitude_m, "m"),
    "speed": _Quantity(lambda view: view.ground_speed_m_s, "m/s"),
    "heading": _Quantity(_heading_deg, "deg"),
    "distance": _Quantity(distance_home_m, "m"),
    "battery": _Quantity(_battery_percent, "%"),
    "item": _Quantity(lambda view: view.mission.current),
    "reached": _Quantity(lambda view: view.mission.reached),
    "satellites": _Quantity(lambda view: None if view.gnss is None else view.gnss.satellites),
    "time": _Quantity(lambda view: view.time_s, "s"),
}
"""Numbers that can be compared: altitude above home, ground speed, heading, distance from home, remaining battery,
current and last reached mission item, satellites, and the time of the vehicle's clock."""

_COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    ">": operator.gt,
    "<": operator.lt,
    ">=": operator.ge,
    "<=": operator.le,
    "=": operator.eq,
}


def _armed_text(view: VehicleView) -> str:
    return "armed" if view.armed else "disarmed"


def _landed_text(view: VehicleView) -> str:
    names = {1: "on the ground", 2: "in the air", 3: "taking off", 4: "landing"}
    return names.get(view.landed_state, "landed state unknown")


def _ready_text(view: VehicleView) -> str:
    check = {None: "not reported", True: "passed", False: "failed"}[view.can_arm]
    return f"pre-arm check {check}, position {'known' if view.has_position else 'unknown'}"


def _mission_text(view: VehicleView) -> str:
    text = view.mission.item_text or "no mission"
    unknown = view.mission.current is not None and view.mission.state is None
    return f"{text}, the vehicle does not report the state of its mission" if unknown else text


def is_ready(view: VehicleView) -> bool:
    """Return True if the vehicle can be armed and flown: its pre-arm check passes, and it has a position.

    ArduCopter's check needs no position in STABILIZE. Without a check, the sensors must be healthy.
    """
    return view.has_position and bool(view.healthy if view.can_arm is None else view.can_arm)


STATES: Mapping[str, tuple[Callable[[VehicleView], bool], Callable[[VehicleView], str]]] = {
    "armed": (lambda view: view.armed, _armed_text),
    "disarmed": (lambda view: not view.armed, _armed_text),
    "landed": (lambda view: view.on_ground is True, _landed_text),
    "in-air": (lambda view: view.landed_state == 2, _landed_text),
    "ready": (is_ready, _ready_text),
    COMPLETE: (lambda view: view.mission.is_flown, _mission_text),
}
"""Conditions of one word."""


def parse_condition(text: str) -> ViewCondition:
    """Return a condition; raise ConditionError."""
    words = text.strip()
    if words in STATES:
        return ViewCondition(words, *STATES[words])
    match = re.fullmatch(r"([a-z-]+)\s*(>=|<=|>|<|=)\s*(.+)", words)
    if match is None:
        raise ConditionError(f"{text}: not a condition; give {choices()}")
    name, sign, value = match.groups()
    if name == "mode" and sign == "=":
        return _mode_condition(words, value)
    if name == "position" and sign == "=":
        return _position_condition(words, value)
    if name not in QUANTITIES:
        raise ConditionError(f"{text}: not a condition; give {choices()}")
    return _comparison(words, QUANTITIES[name], sign, _number(text, value))


def choices() -> str:
    """Return the conditions as text."""
    return (
        f"{', '.join(STATES)}, mode=NAME, position=LAT,LON[,RADIUS], or one of {', '.join(QUANTITIES)} "
        "with >, <, >=, <= or = and a number"
    )


def _number(text: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ConditionError(f"{text}: {value} is not a number")
    return number


def _comparison(text: str, quantity: _Quantity, sign: str, wanted: float) -> ViewCondition:
    compare = _COMPARISONS[sign]

    def holds(view: VehicleView) -> bool:
        now = quantity.read(view)
        return now is not None and compare(now, wanted)

    def value(view: VehicleView) -> str:
        now = quantity.read(view)
        return "unknown" if now is None else f"{now:.4g} {quantity.unit}".rstrip()

    return ViewCondition(text, holds, value)


def _mode_condition(text: str, name: str) -> ViewCondition:
    def holds(view: VehicleView) -> bool:
        return view.identity is not None and view.custom_mode == find_mode(view, name)

    return ViewCondition(text, holds, lambda view: f"mode {view.mode}", name)


def _position_condition(text: str, value: str) -> ViewCondition:
    numbers = [_number(text, part) for part in value.split(",")]
    if len(numbers) not in (2, 3):
        raise ConditionError(
            f"{text}: give position=LATITUDE,LONGITUDE or position=LATITUDE,LONGITUDE,RADIUS"
        )
    target = GeoPosition(numbers[0], numbers[1], 0.0, 0.0)
    radius_m = numbers[2] if len(numbers) == 3 else POSITION_RADIUS_M

    def away_m(view: VehicleView) -> float:
        return math.inf if view.geo is None else horizontal_m(view.geo, target)

    def words(view: VehicleView) -> str:
        return "position unknown" if view.geo is None else f"{away_m(view):.1f} m away"

    return ViewCondition(text, lambda view: away_m(view) <= radius_m, words)
