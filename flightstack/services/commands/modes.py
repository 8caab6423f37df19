"""Commands that arm, disarm and select a mode by its number."""

from __future__ import annotations

import math

from flightstack.commander.transitions import Event
from flightstack.core.enums import MODE_OF_CUSTOM, Mode
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
from flightstack.vehicle.requests import FlightRequests

FORCE_MAGIC = 21196.0
"""Second parameter of COMPONENT_ARM_DISARM that overrides the checks."""
SELECT: dict[Mode, Event] = {
    Mode.HOLD: Event.SELECT_HOLD,
    Mode.TAKEOFF: Event.SELECT_TAKEOFF,
    Mode.MISSION: Event.SELECT_MISSION,
    Mode.RETURN: Event.SELECT_RETURN,
    Mode.LAND: Event.SELECT_LAND,
    Mode.POSITION: Event.SELECT_POSITION,
    Mode.ALTITUDE: Event.SELECT_ALTITUDE,
    Mode.OFFBOARD: Event.SELECT_OFFBOARD,
}


def arm_or_disarm(vehicle: VehicleContext, command: Command) -> Answer:
    """COMPONENT_ARM_DISARM: parameter 1 arms (1) or disarms (0); parameter 2 forces."""
    armed, requests = vehicle.now.status.armed, vehicle.requests
    if command.params[0] == 1.0:
        return Answer(ACCEPTED) if armed else answer_to(requests.request(Event.ARM))
    if command.params[0] == 0.0:
        if not armed:
            return Answer(ACCEPTED)
        force = command.params[1] == FORCE_MAGIC
        return answer_to(requests.request(Event.FORCE_DISARM if force else Event.DISARM))
    return Answer(DENIED, "parameter 1 must be 0 (disarm) or 1 (arm)")


def set_mode(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_SET_MODE: parameter 1 is the base mode with the custom bit, 2 and 3 are PX4's main and sub mode."""
    base, main, sub = command.params[0], command.params[1], command.params[2]
    if not all(math.isfinite(value) and 0.0 <= value < 256.0 for value in (base, main, sub)):
        return Answer(DENIED, "mode numbers must be 0 to 255")
    if not int(base) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return Answer(DENIED, "only custom modes can be selected")
    return select_custom_mode(vehicle.requests, int(main) << 16 | int(sub) << 24)


def select_custom_mode(requests: FlightRequests, custom_mode: int) -> Answer:
    """Select a mode by PX4's custom mode number."""
    mode = MODE_OF_CUSTOM.get(custom_mode)
    if mode is None or mode not in SELECT:
        return Answer(DENIED, "this vehicle has no such mode")
    return answer_to(requests.request(SELECT[mode]))


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: arm_or_disarm,
    mavlink.MAV_CMD_DO_SET_MODE: set_mode,
}
