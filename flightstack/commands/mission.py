"""Commands that start a mission and choose its current item."""

from __future__ import annotations

import math

from flightstack.commander.transitions import Event
from flightstack.commands.context import ACCEPTED, DENIED, Answer, Handler, VehicleContext, answer_to
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.services.command_server import Command


def start_mission(vehicle: VehicleContext, command: Command) -> Answer:
    """MISSION_START: selects the mode and arms, as PX4 does; parameter 1 is the first item."""
    autopilot = vehicle.autopilot
    first = command.params[0]
    if math.isfinite(first) and first > 0.0:
        refusal = autopilot.set_current_item(int(first))
        if refusal is not None:
            return Answer(DENIED, refusal)
    refusal = autopilot.happen(Event.SELECT_MISSION)
    if refusal is None and not autopilot.now.status.armed:
        refusal = autopilot.happen(Event.ARM)
    return answer_to(refusal)


def set_current(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_SET_MISSION_CURRENT: parameter 1 is the item (-1: leave it), parameter 2 restarts the mission."""
    autopilot = vehicle.autopilot
    seq, reset = command.params[0], command.params[1]
    if reset == 1.0:
        autopilot.restart_mission()
    if math.isnan(seq) or seq == -1.0:
        return Answer(ACCEPTED)
    if not math.isfinite(seq) or seq != int(seq):
        return Answer(DENIED, "the item is not a whole number")
    refusal = autopilot.set_current_item(int(seq))
    return Answer(ACCEPTED) if refusal is None else Answer(DENIED, refusal)


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_MISSION_START: start_mission,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: set_current,
}
