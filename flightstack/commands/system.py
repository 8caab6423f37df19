"""Commands to the vehicle as a system: its end."""

from __future__ import annotations

from flightstack.commands.context import ACCEPTED, DENIED, UNSUPPORTED, Answer, Handler, VehicleContext
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.services.command_server import Command

DO_NOTHING, REBOOT, SHUT_DOWN = 0.0, 1.0, 2.0


def reboot_or_shut_down(vehicle: VehicleContext, command: Command) -> Answer:
    """PREFLIGHT_REBOOT_SHUTDOWN: parameter 1 is 1 to reboot, 2 to shut down; neither while flying."""
    wanted = command.params[0]
    if wanted == DO_NOTHING:
        return Answer(ACCEPTED)
    if wanted not in (REBOOT, SHUT_DOWN):
        return Answer(UNSUPPORTED)
    now = vehicle.autopilot.now
    if now.status.armed and not now.landed:
        return Answer(DENIED, "the vehicle is in the air")
    vehicle.shutdown_requested = wanted == SHUT_DOWN
    vehicle.reboot_requested = wanted == REBOOT
    return Answer(ACCEPTED)


HANDLERS: dict[int, Handler] = {mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: reboot_or_shut_down}
