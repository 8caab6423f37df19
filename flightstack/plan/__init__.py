"""Plans: missions, geofences and rally points, their files (``.plan``, ``.waypoints``) and their validation.

The checks of geofences (``plan.fence``) and rally points (``plan.rally``) are not imported here: they need NumPy, and
a ground station that only sends a plan does not.
"""

from flightstack.plan.check import DEFAULT_LIMITS, Limits, check_mission, mission_rejections
from flightstack.plan.commands import (
    MAX_FENCE_ITEMS,
    MAX_MISSION_ITEMS,
    MAX_RALLY_POINTS,
    NAV_COMMANDS,
    PLAN_NAMES,
    POSITION_COMMANDS,
    RALLY_POINT,
    UNSET_E7,
    Command,
    FenceCommand,
    Frame,
    MissionResult,
    MissionType,
    command_name,
    result_name,
)
from flightstack.plan.files import load_plan, save_plan
from flightstack.plan.item import MissionItem, Plan
from flightstack.plan.rejection import Rejection

__all__ = [
    "DEFAULT_LIMITS",
    "MAX_FENCE_ITEMS",
    "MAX_MISSION_ITEMS",
    "MAX_RALLY_POINTS",
    "NAV_COMMANDS",
    "PLAN_NAMES",
    "POSITION_COMMANDS",
    "RALLY_POINT",
    "UNSET_E7",
    "Command",
    "FenceCommand",
    "Frame",
    "Limits",
    "MissionItem",
    "MissionResult",
    "MissionType",
    "Plan",
    "Rejection",
    "check_mission",
    "command_name",
    "load_plan",
    "mission_rejections",
    "result_name",
    "save_plan",
]
