"""Plans: mission items, their files (``.plan``, ``.waypoints``), and the missions that the vehicle takes."""

from flightstack.plan.check import DEFAULT_LIMITS, Limits, Rejection, check_mission
from flightstack.plan.files import load_plan, save_plan
from flightstack.plan.item import MissionItem
from flightstack.plan.plan import Plan
from flightstack.plan.vocabulary import (
    MAX_MISSION_ITEMS,
    NAV_COMMANDS,
    POSITION_COMMANDS,
    UNSET_E7,
    Command,
    Frame,
    MissionResult,
    MissionType,
    command_name,
    result_name,
)

__all__ = [
    "DEFAULT_LIMITS",
    "MAX_MISSION_ITEMS",
    "NAV_COMMANDS",
    "POSITION_COMMANDS",
    "UNSET_E7",
    "Command",
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
    "result_name",
    "save_plan",
]
