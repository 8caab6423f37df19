"""Plans: missions, geofences and rally points, their files (``.plan``, ``.waypoints``) and their validation."""

from flightstack.plan.check import DEFAULT_LIMITS, Limits, check_mission, mission_rejections
from flightstack.plan.fence import check_fence, fence_shape
from flightstack.plan.fence_shape import FenceShape
from flightstack.plan.files import load_plan, save_plan
from flightstack.plan.item import MissionItem, Plan
from flightstack.plan.rally import check_rally
from flightstack.plan.rejection import Rejection
from flightstack.plan.vocabulary import (
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
    "FenceShape",
    "Frame",
    "Limits",
    "MissionItem",
    "MissionResult",
    "MissionType",
    "Plan",
    "Rejection",
    "check_fence",
    "check_mission",
    "check_rally",
    "command_name",
    "fence_shape",
    "load_plan",
    "mission_rejections",
    "result_name",
    "save_plan",
]
