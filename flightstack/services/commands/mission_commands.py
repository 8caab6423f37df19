"""Commands that start a mission and set its current item."""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from flightstack.services.commands.context import (
    ACCEPTED,
    DENIED,
    Answer,
    Command,
    Handler,
    VehicleContext,
    answer_to,
)


def start_mission(vehicle: VehicleContext, command: Command) -> Answer:
    """MISSION_START: select MISSION mode and arm, as PX4 does; parameter 1 is the first item.

    A refused command changes nothing.
    """
    first = command.params[0]
    has_first = math.isfinite(first) and first > 0.0
    refusal = vehicle.mission.item_refusal(int(first)) if has_first else None
    if refusal is not None:
        return Answer(DENIED, refusal)
    return answer_to(vehicle.requests.start_mission(int(first) if has_first else None))


def set_current(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_SET_MISSION_CURRENT: parameter 1 is the item (−1 keeps it); parameter 2 is 1 to restart the mission.

    A denied command changes nothing.
    """
    mission = vehicle.mission
    seq, reset = command.params[0], command.params[1]
    has_item = not math.isnan(seq) and seq != -1.0
    if has_item:
        if not math.isfinite(seq) or seq != int(seq):
            return Answer(DENIED, "the item is not a whole number")
        refusal = mission.item_refusal(int(seq))
        if refusal is not None:
            return Answer(DENIED, refusal)
    if reset == 1.0:
        mission.restart()
    if has_item:
        mission.set_current(int(seq))
    return Answer(ACCEPTED)


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_MISSION_START: start_mission,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: set_current,
}
