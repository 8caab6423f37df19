"""Handlers of the MAVLink commands, in one table by command number. Pure."""

from __future__ import annotations

from flightstack.services.commands import guided, mission, modes, system
from flightstack.services.commands.command_server import Command
from flightstack.services.commands.context import UNSUPPORTED, Answer, Handler, VehicleContext

__all__ = ["HANDLERS", "Answer", "Command", "Handler", "VehicleContext", "execute"]

HANDLERS: dict[int, Handler] = {
    **modes.HANDLERS,
    **guided.HANDLERS,
    **mission.HANDLERS,
    **system.HANDLERS,
}


def execute(vehicle: VehicleContext, command: Command) -> Answer:
    """Execute a vehicle command. ``LinkCommands`` executes the commands of a link."""
    handler = HANDLERS.get(command.command)
    return Answer(UNSUPPORTED) if handler is None else handler(vehicle, command)
