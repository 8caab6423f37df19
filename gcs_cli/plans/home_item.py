"""Home as item 0 of the mission, as ArduPilot stores it.

The items of a plan count from 0 without home. On such a vehicle, item n of the plan has the number n + 1.
"""

from __future__ import annotations

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import Command, Frame, MissionItem
from flightstack.plan.item import integer_coordinate
from gcs_cli.plans.edit import Items, shifted


def with_home_item(items: Items, home: GeoPoint) -> Items:
    """Return the mission as the vehicle stores it: home first."""
    x, y = (integer_coordinate(value, is_global=True) for value in home[:2])
    first = MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL, x=x, y=y, z=home.altitude_m)
    return (first, *(shifted(items, 1)))


def without_home_item(items: Items) -> Items:
    """Return the mission of a vehicle that stores home first."""
    return shifted(items, -1)[1:]
