"""Commands that arm and disarm."""

from __future__ import annotations

from flightstack.commander.transitions import Event
from flightstack.mavlink.dialect import mavlink
from flightstack.services.commands.command_server import Command
from flightstack.services.commands.context import ACCEPTED, DENIED, Answer, Handler, VehicleContext, answer_to

FORCE_MAGIC = 21196.0
"""Second parameter of COMPONENT_ARM_DISARM that overrides the checks."""


def arm_or_disarm(vehicle: VehicleContext, command: Command) -> Answer:
    """COMPONENT_ARM_DISARM: parameter 1 arms (1) or disarms (0), parameter 2 forces."""
    armed, requests = vehicle.now.status.armed, vehicle.requests
    if command.params[0] == 1.0:
        return Answer(ACCEPTED) if armed else answer_to(requests.request(Event.ARM))
    if command.params[0] == 0.0:
        if not armed:
            return Answer(ACCEPTED)
        force = command.params[1] == FORCE_MAGIC
        return answer_to(requests.request(Event.FORCE_DISARM if force else Event.DISARM))
    return Answer(DENIED, "parameter 1 must be 0 (disarm) or 1 (arm)")


HANDLERS: dict[int, Handler] = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM: arm_or_disarm}
