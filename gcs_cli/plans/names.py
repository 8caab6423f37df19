"""Names of the commands of any vehicle's plans."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from flightstack.plan import command_name


def any_command_name(command: int) -> str:
    """Return the name of a MAV_CMD without its prefix, or its number if MAVLink does not define it."""
    name = command_name(command)
    entry = mavlink.enums["MAV_CMD"].get(command)
    if entry is None or not name.startswith("command "):
        return name
    return str(entry.name).removeprefix("MAV_CMD_")


def command_number(name: str) -> int | None:
    """Return the MAV_CMD of a name as ``any_command_name`` returns it, or of a number; None if there is none."""
    text = name.strip().upper().removeprefix("MAV_CMD_").removeprefix("COMMAND ")
    if text.isdecimal():
        return int(text)
    for number, entry in mavlink.enums["MAV_CMD"].items():
        if text in (str(entry.name).removeprefix("MAV_CMD_"), command_name(number)):
            return int(number)
    return None
