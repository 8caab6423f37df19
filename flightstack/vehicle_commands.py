"""What each MAVLink command does to the vehicle: one table, read by the command service. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from flightstack.autopilot import Autopilot
from flightstack.commander.transitions import Event
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.services.command_server import Command
from flightstack.modes import MODE_OF_CUSTOM, Mode

FORCE_MAGIC = 21196.0
"""Second parameter of COMPONENT_ARM_DISARM that overrides the checks."""

ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
DENIED = int(mavlink.MAV_RESULT_DENIED)
REJECTED = int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)

SELECT: dict[Mode, Event] = {
    Mode.HOLD: Event.SELECT_HOLD,
    Mode.TAKEOFF: Event.SELECT_TAKEOFF,
    Mode.MISSION: Event.SELECT_MISSION,
    Mode.RETURN: Event.SELECT_RETURN,
    Mode.LAND: Event.SELECT_LAND,
}


class Answer(NamedTuple):
    """Result of a command, and why it was refused."""

    result: int
    reason: str = ""


def _answer(refusal: str | None) -> Answer:
    return Answer(ACCEPTED) if refusal is None else Answer(REJECTED, refusal)


def _arm(autopilot: Autopilot, command: Command) -> Answer:
    if command.params[0] == 1.0:
        return Answer(ACCEPTED) if autopilot.now.status.armed else _answer(autopilot.happen(Event.ARM))
    if command.params[0] == 0.0:
        if not autopilot.now.status.armed:
            return Answer(ACCEPTED)
        force = command.params[1] == FORCE_MAGIC
        return _answer(autopilot.happen(Event.FORCE_DISARM if force else Event.DISARM))
    return Answer(DENIED, "parameter 1 must be 0 (disarm) or 1 (arm)")


def _takeoff(autopilot: Autopilot, command: Command) -> Answer:
    """NAV_TAKEOFF: parameter 7 is the altitude above sea level, as PX4 takes it; NaN means MIS_TAKEOFF_ALT."""
    altitude = command.params[6]
    above_home = None if math.isnan(altitude) else altitude - autopilot.home.altitude_m
    if above_home is not None and not math.isfinite(above_home):
        return Answer(DENIED, "the takeoff altitude is not a number")
    return _answer(autopilot.happen(Event.SELECT_TAKEOFF, above_home))


def _start_mission(autopilot: Autopilot, command: Command) -> Answer:
    """MISSION_START: selects the mode and arms, as PX4 does; parameter 1 is the first item."""
    first = command.params[0]
    if math.isfinite(first) and first > 0.0:
        refusal = autopilot.set_current_item(int(first))
        if refusal is not None:
            return Answer(DENIED, refusal)
    refusal = autopilot.happen(Event.SELECT_MISSION)
    if refusal is None and not autopilot.now.status.armed:
        refusal = autopilot.happen(Event.ARM)
    return _answer(refusal)


def _set_mode(autopilot: Autopilot, command: Command) -> Answer:
    """DO_SET_MODE: base mode with the custom bit, then PX4's main and sub mode."""
    base, main, sub = command.params[0], command.params[1], command.params[2]
    if not all(math.isfinite(value) and 0.0 <= value < 256.0 for value in (base, main, sub)):
        return Answer(DENIED, "mode numbers must be 0 to 255")
    if not int(base) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return Answer(DENIED, "only custom modes can be selected")
    return select_custom_mode(autopilot, int(main) << 16 | int(sub) << 24)


def select_custom_mode(autopilot: Autopilot, custom_mode: int) -> Answer:
    """Select a mode by PX4's custom mode number."""
    mode = MODE_OF_CUSTOM.get(custom_mode)
    if mode is None:
        return Answer(DENIED, "this vehicle has no such mode")
    return _answer(autopilot.happen(SELECT[mode]))


def _selects(event: Event) -> Callable[[Autopilot, Command], Answer]:
    return lambda autopilot, command: _answer(autopilot.happen(event))


HANDLERS: dict[int, Callable[[Autopilot, Command], Answer]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mavlink.MAV_CMD_NAV_LAND: _selects(Event.SELECT_LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _selects(Event.SELECT_RETURN),
    mavlink.MAV_CMD_MISSION_START: _start_mission,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
}


def execute(autopilot: Autopilot, command: Command) -> Answer:
    """Carry out a command of the vehicle; commands of a link are the link's own matter."""
    handler = HANDLERS.get(command.command)
    return Answer(UNSUPPORTED) if handler is None else handler(autopilot, command)
