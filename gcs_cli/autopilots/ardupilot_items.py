"""What ArduPilot keeps of a mission item's parameters: it packs an item into 15 bytes.

Read in AP_Mission.cpp (90700977), ``mavlink_int_to_mission_cmd`` and back. Commands without an entry keep what they
are sent.
"""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from gcs_cli.autopilots.autopilot import Packing


def _none(_: float) -> float:
    return 0.0


def _whole(value: float) -> float:
    return float(math.trunc(value))


def _byte(value: float) -> float:
    return min(255.0, _whole(value))


def _sign(value: float) -> float:
    return -1.0 if value < 0.0 else 1.0


def _flag(value: float) -> float:
    return 1.0 if value > 0.0 else 0.0


def _radius(value: float) -> float:
    """Whole metres up to 255 m, else tens of metres up to 2550 m."""
    size = abs(value)
    stored = _whole(size) if size <= 255.0 else 10.0 * _byte(size * 0.1)
    return math.copysign(stored, value)


def _turns(value: float) -> float:
    """Whole turns, or 256ths of one turn."""
    return _whole(value * 256.0) / 256.0 if 0.0 < value < 1.0 else _byte(value)


_WHOLE_FIRST = (_whole, _none, _none, _none)
PACKED: Packing = {
    mavlink.MAV_CMD_NAV_WAYPOINT: _WHOLE_FIRST,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: (_none, _none, _whole, _none),
    mavlink.MAV_CMD_NAV_LOITER_TURNS: (_turns, _none, _radius, _flag),
    mavlink.MAV_CMD_NAV_LOITER_TIME: (_whole, _none, _sign, _flag),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: (_none, _none, _none, _none),
    mavlink.MAV_CMD_NAV_LAND: (_whole, _none, _none, _sign),
    mavlink.MAV_CMD_NAV_TAKEOFF: _WHOLE_FIRST,
    mavlink.MAV_CMD_NAV_LOITER_TO_ALT: (_none, _whole, _none, _flag),
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT: _WHOLE_FIRST,
}
"""Copters and rovers drop the radius of a waypoint."""
PACKED_BY_PLANES: Packing = {**PACKED, mavlink.MAV_CMD_NAV_WAYPOINT: (_none, _byte, _byte, _none)}
"""Planes keep whole metres of it, and no hold."""
