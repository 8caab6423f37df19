"""What each MAVLink command does to the vehicle: one table, read by the command service. Pure."""

from __future__ import annotations

from flightstack.services.commands import arming, guided, mission, modes, parameters, system
from flightstack.services.commands.command_server import Command
from flightstack.services.commands.context import UNSUPPORTED, Answer, Handler, VehicleContext

__all__ = ["HANDLERS", "Answer", "Command", "Handler", "VehicleContext", "execute"]

HANDLERS: dict[int, Handler] = {
    **arming.HANDLERS,
    **modes.HANDLERS,
    **guided.HANDLERS,
    **mission.HANDLERS,
    **parameters.HANDLERS,
    **system.HANDLERS,
}


def execute(vehicle: VehicleContext, command: Command) -> Answer:
    """Carry out a command of the vehicle; commands of a link are the link's own matter."""
    handler = HANDLERS.get(command.command)
    return Answer(UNSUPPORTED) if handler is None else handler(vehicle, command)
