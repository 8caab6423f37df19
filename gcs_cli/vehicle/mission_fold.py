"""Fold the messages about the mission into a ``VehicleView``: its progress, and its end. Pure.

A vehicle may report no state of its mission (PX4 before MISSION_STATE), and PX4 never reports a final return as
reached: it changes to its return mode as soon as that item is the current one. The end of such a mission is known only
from a flight that was observed.
"""

from __future__ import annotations

from typing import Any

from flightstack.mavlink.dialect import mavlink
from gcs_cli.autopilots.autopilot import Role
from gcs_cli.vehicle.view_types import MISSION_ACTIVE, MISSION_COMPLETE, Mission, VehicleView

_NO_NUMBER = 65535  # MISSION_CURRENT.total without a mission; ArduPilot: no item is reached yet


def after_heartbeat(view: VehicleView, mode: str, armed: bool) -> Mission:
    """Return the mission of ``view``, the state before a heartbeat with this mode."""
    mission, roles = view.mission, view.autopilot.roles
    if armed and not view.armed:
        mission = mission._replace(reached=None, has_begun=False, has_ended=False, has_returned=False)
    if armed and mode == roles.get(Role.MISSION):
        return mission._replace(has_begun=True, has_returned=False)
    if armed and mode == roles.get(Role.RETURN):
        begins = view.armed and view.mode == roles.get(Role.MISSION) and mission.is_at_last
        return mission._replace(has_returned=mission.has_returned or begins)
    # a return that is left in the air, or ends there, is not complete
    return mission._replace(has_returned=mission.has_returned and view.on_ground is True)


def after_current(view: VehicleView, message: Any) -> Mission:
    """Return the mission of ``view`` after MISSION_CURRENT."""
    mission = view.mission
    if mission.mission_id not in (None, message.mission_id):
        mission = mission._replace(reached=None, has_ended=False, has_returned=False)
    mission = mission._replace(
        current=_plan_number(view, message.seq) or 0,
        total=None if message.total == _NO_NUMBER else message.total,
        state=message.mission_state or None,
        mission_id=message.mission_id,
    )
    if mission.total is not None and mission.reached is not None and mission.reached >= mission.total:
        mission = mission._replace(reached=None)  # of a former mission
    if mission.state == MISSION_COMPLETE:
        return mission._replace(has_ended=True)
    left_last = mission.state is None and view.armed and not mission.is_at_last
    runs = left_last or mission.state == MISSION_ACTIVE
    if runs and (mission.has_ended or mission.has_returned):  # begun again
        mission = mission._replace(reached=None, has_ended=False, has_returned=False)
    return mission


def after_reached(view: VehicleView, message: Any) -> Mission:
    """Return the mission of ``view`` after MISSION_ITEM_REACHED, which PX4 repeats for 10 s: into the next flight."""
    number, total = _plan_number(view, message.seq), view.mission.total
    if message.seq == _NO_NUMBER or (number is not None and total is not None and number >= total):
        return view.mission  # none yet, or one of a former mission
    mission = view.mission._replace(reached=number)
    is_last = mission.is_at_last and mission.reached == mission.current
    ends = is_last and mission.has_begun and mission.state is None
    return mission._replace(has_ended=mission.has_ended or ends)


def after_count(view: VehicleView, message: Any) -> Mission:
    """Return the mission of ``view`` after MISSION_COUNT, with which the vehicle begins to send its items."""
    if message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
        return view.mission
    return view.mission._replace(items_id=message.opaque_id, return_item=None)


def after_item(view: VehicleView, message: Any) -> Mission:
    """Return the mission of ``view`` after an item that the vehicle sends."""
    is_return = message.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
    if message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION or not is_return:
        return view.mission
    return view.mission._replace(return_item=_plan_number(view, message.seq))


def _plan_number(view: VehicleView, seq: int) -> int | None:
    """Return the number in the plan of an item of the vehicle's mission; None for the home of ArduPilot."""
    number = seq - view.autopilot.mission_begins_with_home
    return number if number >= 0 else None
