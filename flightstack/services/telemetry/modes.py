"""Messages of MAVLink's standard modes protocol."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from flightstack.core.enums import CUSTOM_MODE, Mode
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.vehicle.status import VehicleStatus

ADVANCED, NOT_SELECTABLE, AUTOMATIC = 1, 2, 4
"""MAV_MODE_PROPERTY."""


class ModeEntry(NamedTuple):
    """Entry of AVAILABLE_MODES."""

    mode: Mode
    name: str
    standard: int
    properties: int


_S = mavlink
MODES = (
    ModeEntry(Mode.HOLD, "Hold", _S.MAV_STANDARD_MODE_NON_STANDARD, AUTOMATIC),
    ModeEntry(Mode.TAKEOFF, "Takeoff", _S.MAV_STANDARD_MODE_TAKEOFF, AUTOMATIC),
    ModeEntry(Mode.MISSION, "Mission", _S.MAV_STANDARD_MODE_MISSION, AUTOMATIC),
    ModeEntry(Mode.RETURN, "Return", _S.MAV_STANDARD_MODE_SAFE_RECOVERY, AUTOMATIC),
    ModeEntry(Mode.LAND, "Land", _S.MAV_STANDARD_MODE_LAND, AUTOMATIC),
    ModeEntry(Mode.POSITION, "Position", _S.MAV_STANDARD_MODE_POSITION_HOLD, 0),
    ModeEntry(Mode.ALTITUDE, "Altitude", _S.MAV_STANDARD_MODE_ALTITUDE_HOLD, 0),
    ModeEntry(Mode.OFFBOARD, "Offboard", _S.MAV_STANDARD_MODE_NON_STANDARD, ADVANCED),
    ModeEntry(Mode.TERMINATION, "Termination", _S.MAV_STANDARD_MODE_NON_STANDARD, NOT_SELECTABLE),
)
_STANDARD = {entry.mode: entry.standard for entry in MODES}


def current_mode(f: VehicleStatus) -> Message:
    """CURRENT_MODE. A mode is entered at once or refused, so the intended mode is the current one."""
    number = CUSTOM_MODE[f.mode]
    return mavlink.MAVLink_current_mode_message(_STANDARD[f.mode], number, number)


def available_modes_monitor(_f: VehicleStatus) -> Message:
    """AVAILABLE_MODES_MONITOR. The list of modes never changes."""
    return mavlink.MAVLink_available_modes_monitor_message(0)


def available_modes(index: float) -> Iterator[Message]:
    """AVAILABLE_MODES: all modes for index 0, else the mode at the index from 1; nothing if it does not exist."""
    if index == 0.0 or not math.isfinite(index):
        wanted = range(1, len(MODES) + 1)
    else:
        wanted = range(int(index), int(index) + 1) if 1 <= index <= len(MODES) else range(0)
    for number in wanted:
        entry = MODES[number - 1]
        yield mavlink.MAVLink_available_modes_message(
            len(MODES), number, entry.standard, CUSTOM_MODE[entry.mode], entry.properties, entry.name.encode()
        )
