"""What ArduPilot keeps of a mission item's parameters: it packs an item into 15 bytes.

Read in AP_Mission.cpp and AP_Mission.h (90700977), ``mavlink_int_to_mission_cmd`` and back. Commands without an entry
count as kept as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from flightstack.mavlink.dialect import mavlink
from gcs_cli.autopilots.autopilot import Packing, Storage


def _byte(value: float) -> float:
    return float(min(255, math.trunc(value)))


def _radius(value: float) -> float:
    """Whole metres up to 255 m, else tens of metres up to 2550 m."""
    size = abs(value)
    return math.copysign(_byte(size) if size <= 255.0 else 10.0 * _byte(size * 0.1), value)


def _turns(value: float) -> float:
    """Whole turns, or 256ths of one turn."""
    return math.trunc(value * 256.0) / 256.0 if 0.0 < value < 1.0 else _byte(value)


_STORAGE: Mapping[str, Storage] = {
    "-": lambda _: 0.0,
    "=": lambda value: value,
    "w": lambda value: float(math.trunc(value)),
    "b": _byte,
    "c": lambda value: math.trunc(value * 100.0) * 0.01,
    "s": lambda value: -1.0 if value < 0.0 else 1.0,
    "f": lambda value: 1.0 if value > 0.0 else 0.0,
    "r": _radius,
    "t": _turns,
}
"""Nothing, all, a whole number, a byte, whole centimetres, the sign, a flag, a radius, turns."""
_KEPT = {
    "NAV_WAYPOINT": "w---", "NAV_LOITER_UNLIM": "--w-", "NAV_LOITER_TURNS": "t-rf", "NAV_LOITER_TIME": "w-sf",
    "NAV_RETURN_TO_LAUNCH": "----", "NAV_LAND": "w--s", "NAV_TAKEOFF": "w---",
    "NAV_CONTINUE_AND_CHANGE_ALT": "w---", "NAV_LOITER_TO_ALT": "-w-f", "NAV_SPLINE_WAYPOINT": "w---",
    "NAV_GUIDED_ENABLE": "w---", "NAV_DELAY": "=www", "NAV_VTOL_TAKEOFF": "----", "NAV_VTOL_LAND": "w---",
    "NAV_PAYLOAD_PLACE": "c---", "NAV_SET_YAW_SPEED": "==b-", "CONDITION_DELAY": "=---",
    "CONDITION_DISTANCE": "=---", "CONDITION_YAW": "==ww", "DO_JUMP": "ww--", "DO_CHANGE_SPEED": "b==-",
    "DO_SET_HOME": "w---", "DO_SET_RELAY": "bb--", "DO_REPEAT_RELAY": "bw=-", "DO_SET_SERVO": "bw--",
    "DO_REPEAT_SERVO": "bww=", "DO_LAND_START": "----", "DO_SET_ROI_LOCATION": "w---", "DO_SET_ROI_NONE": "w---",
    "DO_SET_ROI": "w---", "DO_MOUNT_CONTROL": "===-", "DO_SET_CAM_TRIGG_DIST": "=-b-", "DO_FENCE_ENABLE": "w---",
    "DO_PARACHUTE": "w---", "DO_GRIPPER": "bb--", "DO_GUIDED_LIMITS": "w===", "DO_AUTOTUNE_ENABLE": "w---",
    "DO_VTOL_TRANSITION": "b---", "DO_PAUSE_CONTINUE": "w---",
}  # fmt: skip
"""Storage of the four parameters of each command, for copters and rovers: they drop the radius of a waypoint."""
_KEPT_BY_PLANES = {**_KEPT, "NAV_WAYPOINT": "-bb-"}
"""Planes keep whole metres of that radius, and no hold."""


def _packing(kept: Mapping[str, str]) -> Packing:
    return {
        int(getattr(mavlink, f"MAV_CMD_{name}")): tuple(_STORAGE[kind] for kind in kinds)
        for name, kinds in kept.items()
    }


PACKED, PACKED_BY_PLANES = _packing(_KEPT), _packing(_KEPT_BY_PLANES)
