"""The plan of the synthetic flight."""

from __future__ import annotations

import math

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.plan import Command, Frame, MissionItem, Plan
from tests.support.synthetic_flight import CORNERS_NED_M, HOME


def item_at(command: Command, ned_m: tuple[float, float, float], acceptance_m: float = 0.0) -> MissionItem:
    """Return an item at a position relative to ``HOME``, rounded to 1e-7 degrees (1 cm)."""
    place = LocalFrame(HOME).to_geo(Vector3(*ned_m))
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT, 0.0, acceptance_m, 0.0, math.nan, x, y, -ned_m[2])


def square_plan() -> Plan:
    """Return the plan with items 0 takeoff, 1 to 4 corners, 5 land."""
    corners = [item_at(Command.NAV_WAYPOINT, corner, 1.0) for corner in CORNERS_NED_M]
    takeoff, land = item_at(Command.NAV_TAKEOFF, (0.0, 0.0, -3.0)), item_at(Command.NAV_LAND, (0.0, 0.0, 0.0))
    return Plan((takeoff, *corners, land), HOME)
