"""Distances, headings and times of a mission in still air. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.plan import Command, MissionItem

MOST_VISITS = 100_000
"""Items after which the flight of a mission with jumps is not followed further."""
_LAST_NAVIGATION = 95  # MAV_CMD_NAV_LAST: larger numbers are no places to fly to
_ARRIVED = frozenset({Command.NAV_LAND, Command.NAV_RETURN_TO_LAUNCH})


class Speeds(NamedTuple):
    """Speeds of the vehicle [m/s]; the defaults are those of MPC_XY_CRUISE, MPC_Z_VEL_MAX_UP and _DN."""

    cruise_m_s: float = 4.0
    climb_m_s: float = 2.5
    descent_m_s: float = 1.5


DEFAULT_SPEEDS = Speeds()


class Stop(NamedTuple):
    """An item as it is first reached."""

    seq: int
    item: MissionItem
    place_ne_m: tuple[float, float] | None
    """North and east of home; None if the vehicle does not move horizontally for this item."""
    altitude_m: float
    """Above home, at the end of the item."""
    leg_m: float
    """Horizontal distance from the place before."""
    heading_deg: float | None
    """Direction of that leg; None without one."""
    distance_m: float
    """Horizontal distance from the start of the mission."""
    time_s: float
    """Time from the start of the mission to the end of the item."""


class Itinerary(NamedTuple):
    """The whole mission."""

    stops: tuple[Stop, ...]
    """The items that are reached, in the order of their numbers."""
    distance_m: float
    """With all repetitions; infinite for a mission that repeats for ever."""
    time_s: float
    highest_m: float
    farthest_m: float


def home_of_items(items: Sequence[MissionItem], home: GeoPoint | None) -> GeoPoint:
    """Return home, or if it is not known the first place of the mission at sea level."""
    first = next((item.position_deg for item in items if item.position_deg is not None), (0.0, 0.0))
    return home or GeoPoint(*first, 0.0)


def itinerary(items: Sequence[MissionItem], home: GeoPoint, speeds: Speeds = DEFAULT_SPEEDS) -> Itinerary:
    """Return the itinerary of ``items`` from ``home``."""
    frame = LocalFrame(home)
    stops: dict[int, Stop] = {}
    here, altitude_m, speed_m_s = (0.0, 0.0), 0.0, speeds.cruise_m_s
    distance_m = time_s = highest_m = farthest_m = 0.0
    for seq in flown_order(items):
        if seq is None:
            distance_m = time_s = math.inf
            break
        item = items[seq]
        there, to_m = _target(item, frame, altitude_m)
        place = here if there is None else there
        leg_m = math.dist(here, place)
        rise_m = to_m - altitude_m
        vertical_s = rise_m / speeds.climb_m_s if rise_m > 0.0 else -rise_m / speeds.descent_m_s
        time_s += max(leg_m / speed_m_s, vertical_s) + _hold_s(item)
        distance_m += leg_m
        if item.command == Command.DO_CHANGE_SPEED and item.param2 != -1.0:
            speed_m_s = item.param2 if item.param2 > 0.0 else speeds.cruise_m_s
        if seq not in stops:
            heading_deg = None if leg_m < 0.05 else _heading_deg(here, place)
            stops[seq] = Stop(seq, item, there, to_m, leg_m, heading_deg, distance_m, time_s)
        here, altitude_m = place, to_m
        highest_m, farthest_m = max(highest_m, to_m), max(farthest_m, math.hypot(*here))
    ordered = tuple(stops[seq] for seq in sorted(stops))
    return Itinerary(ordered, distance_m, time_s, highest_m, farthest_m)


def flown_order(items: Sequence[MissionItem]) -> Iterator[int | None]:
    """Yield the numbers of the items in flying order, with jumps; at the end None if the mission does not end."""
    left = [item.param2 if item.command == Command.DO_JUMP else 0.0 for item in items]
    seq, visits = 0, 0
    while seq < len(items):
        visits += 1
        if visits > MOST_VISITS or (left[seq] < 0.0 and visits > 2 * len(items)):
            yield None
            return
        jumps = left[seq] != 0.0 and 0 <= items[seq].param1 < len(items)
        if jumps:
            left[seq] -= left[seq] > 0.0
            seq = int(items[seq].param1)
            continue
        if items[seq].command != Command.DO_JUMP:
            yield seq
        if items[seq].command == Command.NAV_RETURN_TO_LAUNCH:
            return
        seq += 1


def _target(
    item: MissionItem, frame: LocalFrame, altitude_m: float
) -> tuple[tuple[float, float] | None, float]:
    """Return the place of an item, None if it has none, and its altitude above home."""
    if item.command == Command.NAV_RETURN_TO_LAUNCH:
        return (0.0, 0.0), 0.0
    if item.command >= _LAST_NAVIGATION:
        return None, altitude_m
    place = None
    if item.position_deg is not None:
        there = frame.to_ned(GeoPoint(*item.position_deg, frame.origin.altitude_m))
        place = there.x, there.y
    if item.command in _ARRIVED:
        return place, 0.0
    if (place is None and item.command != Command.NAV_TAKEOFF) or not math.isfinite(item.z):
        return place, altitude_m
    return place, above_home_m(item, frame.origin)


def above_home_m(item: MissionItem, home: GeoPoint) -> float:
    """Return the altitude of an item above home; terrain altitudes count as such."""
    return item.z - home.altitude_m if item.frame in (0, 5) else item.z


def _hold_s(item: MissionItem) -> float:
    holds = item.command in (Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME, Command.NAV_DELAY)
    return item.param1 if holds and item.param1 > 0.0 else 0.0


def _heading_deg(here: tuple[float, float], there: tuple[float, float]) -> float:
    return math.degrees(math.atan2(there[1] - here[1], there[0] - here[0])) % 360.0
