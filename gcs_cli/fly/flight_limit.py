"""Longest simulated time of a mission: a multiple of the time that its plan needs in still air. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.params.behaviour import Behaviour
from flightstack.plan import Command, MissionItem
from gcs_cli.fly.fly_flags import LONGEST_S

MARGIN = 3.0
"""Ratio of the longest flight to the time that the plan needs."""
EXTRA_S = 60.0
ITEM_S = 3.0
"""Allowance per item for acceleration, braking and settling."""
ENDLESS_S = 3600.0
"""Longest flight of a mission that repeats forever."""


class _FlightTime:
    """Sums the time of items that are flown one after the other from home."""

    def __init__(self, home: GeoPoint, behaviour: Behaviour) -> None:
        self.needed_s = 0.0
        self._home, self._frame, self._behaviour = home, LocalFrame(home), behaviour
        self._north_east = (0.0, 0.0)
        self._altitude_m = 0.0
        self.has_landed = True
        """True if the last item was a landing or a return."""
        self._speed_m_s = behaviour.cruise_speed_m_s

    def add(self, item: MissionItem) -> None:
        """Fly ``item``."""
        b = self._behaviour
        if item.command == Command.DO_CHANGE_SPEED:
            if item.param2 > 0.0:
                self._speed_m_s = min(item.param2, b.max_speed_m_s)
            elif item.param2 == -2.0:
                self._speed_m_s = b.cruise_speed_m_s
        elif item.command == Command.CONDITION_YAW:
            rate_deg_s = min(item.param2, b.yaw_rate_deg_s) if item.param2 > 0.0 else b.yaw_rate_deg_s
            self.needed_s += ITEM_S + (180.0 + abs(item.param1)) / rate_deg_s
        elif item.command == Command.NAV_DELAY:
            self.needed_s += ITEM_S + item.param1
        elif item.command == Command.NAV_RETURN_TO_LAUNCH:
            self.go_home()
        else:
            self._go_to(item)

    def go_home(self) -> None:
        """Return and land."""
        b = self._behaviour
        self._move((0.0, 0.0), max(self._altitude_m, b.return_altitude_m), b.cruise_speed_m_s)
        self._land()

    def _go_to(self, item: MissionItem) -> None:
        position_deg, altitude_m = item.position_deg, self._altitude_m
        target = self._north_east
        if position_deg is not None:
            target = self._frame.to_ned(GeoPoint(*position_deg, self._home.altitude_m))[:2]
        if item.command != Command.NAV_LAND and math.isfinite(item.z):
            altitude_m = item.z if item.altitude_is_relative else item.z - self._home.altitude_m
        self._move(target, altitude_m, self._speed_m_s)
        if item.command == Command.NAV_LAND:
            self._land()
        elif item.command != Command.NAV_TAKEOFF and item.param1 > 0.0:
            self.needed_s += item.param1

    def _move(self, target: tuple[float, float], altitude_m: float, speed_m_s: float) -> None:
        b = self._behaviour
        slowest_m_s = min(b.climb_speed_m_s, b.takeoff_speed_m_s, b.descent_speed_m_s)
        self.needed_s += ITEM_S + math.dist(target, self._north_east) / speed_m_s
        self.needed_s += abs(altitude_m - self._altitude_m) / slowest_m_s
        self._north_east, self._altitude_m, self.has_landed = target, altitude_m, False

    def _land(self) -> None:
        b = self._behaviour
        self.needed_s += ITEM_S + abs(self._altitude_m) / min(b.land_speed_m_s, b.descent_speed_m_s)
        self._altitude_m, self.has_landed = 0.0, True


def flight_limit_s(items: Sequence[MissionItem], home: GeoPoint, behaviour: Behaviour) -> float:
    """Return the simulated time after which a flight of ``items`` from ``home`` is aborted [s]."""
    jumps = [item.param2 if item.command == Command.DO_JUMP else 0.0 for item in items]
    time, seq = _FlightTime(home, behaviour), 0
    while seq < len(items):
        if MARGIN * time.needed_s >= LONGEST_S:
            return ENDLESS_S if min(jumps) < 0.0 else LONGEST_S
        item, jumps_left = items[seq], jumps[seq]
        if jumps_left != 0.0:
            jumps[seq] -= 1.0 if jumps_left > 0.0 else 0.0
        elif item.command != Command.DO_JUMP:
            time.add(item)
        ends = item.command == Command.NAV_RETURN_TO_LAUNCH
        seq = len(items) if ends else int(item.param1) if jumps_left != 0.0 else seq + 1
    if not time.has_landed:
        time.go_home()
    return float(math.ceil(EXTRA_S + MARGIN * time.needed_s))
