"""Commands about all parameters at once."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from flightstack.services.commands.command_server import Command
from flightstack.services.commands.context import (
    ACCEPTED,
    DENIED,
    UNSUPPORTED,
    Answer,
    Handler,
    VehicleContext,
)

_WRITE, _RESET, _FACTORY_RESET = 1.0, 2.0, 4.0


def storage(vehicle: VehicleContext, command: Command) -> Answer:
    """PREFLIGHT_STORAGE: parameter 1 is 1 to write (that is done anyway), 2 or 4 to reset all parameters."""
    wanted = command.params[0]
    if wanted not in (_WRITE, _RESET, _FACTORY_RESET):
        return Answer(UNSUPPORTED)
    if wanted != _WRITE:
        if vehicle.now.status.armed:
            return Answer(DENIED, "the vehicle is armed")
        vehicle.params.reset()
    return Answer(ACCEPTED)


HANDLERS: dict[int, Handler] = {mavlink.MAV_CMD_PREFLIGHT_STORAGE: storage}
