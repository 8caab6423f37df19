"""Commands that fly the vehicle directly: takeoff, landing, return."""

from __future__ import annotations

import math

from flightstack.commander.transitions import Event
from flightstack.commands.context import DENIED, Answer, Handler, VehicleContext, answer_to
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.services.command_server import Command


def take_off(vehicle: VehicleContext, command: Command) -> Answer:
    """NAV_TAKEOFF: parameter 7 is the altitude above sea level, as PX4 takes it; NaN means MIS_TAKEOFF_ALT."""
    autopilot = vehicle.autopilot
    altitude = command.params[6]
    above_home = None if math.isnan(altitude) else altitude - autopilot.home.altitude_m
    if above_home is not None and not math.isfinite(above_home):
        return Answer(DENIED, "the takeoff altitude is not a number")
    return answer_to(autopilot.happen(Event.SELECT_TAKEOFF, above_home))


def selects(event: Event) -> Handler:
    """Return the handler of a command that only selects a mode."""
    return lambda vehicle, command: answer_to(vehicle.autopilot.happen(event))


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_NAV_TAKEOFF: take_off,
    mavlink.MAV_CMD_NAV_LAND: selects(Event.SELECT_LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: selects(Event.SELECT_RETURN),
}
