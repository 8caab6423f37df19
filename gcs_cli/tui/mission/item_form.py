"""The texts of a form that edits a mission item, and the item of such texts. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from flightstack.mavlink.dialect import mavlink
from flightstack.plan import Command, Frame, MissionItem, command_name
from flightstack.plan.item import float_coordinate
from gcs_cli.plans import edit
from gcs_cli.plans.names import any_command_name, command_number
from gcs_cli.tui.widgets.entry_form import Entry

_FRAMES = {
    "home": Frame.GLOBAL_RELATIVE_ALT_INT,
    "sea": Frame.GLOBAL_INT,
    "terrain": int(mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT),
}
_FRAME_WORDS = {
    **{int(frame): word for word, frame in _FRAMES.items()},
    int(Frame.GLOBAL): "sea",
    int(Frame.GLOBAL_RELATIVE_ALT): "home",
    int(mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT): "terrain",
    int(Frame.MISSION): "none",
}
_PARAMETERS = {
    Command.NAV_WAYPOINT: ("hold [s]", "acceptance radius [m]", "pass radius [m]", "heading [°]"),
    Command.NAV_LOITER_TIME: ("time [s]", "parameter 2", "parameter 3", "parameter 4"),
    Command.NAV_TAKEOFF: ("pitch [°]", "parameter 2", "parameter 3", "heading [°]"),
    Command.NAV_LAND: ("abort altitude [m]", "parameter 2", "parameter 3", "heading [°]"),
    Command.NAV_DELAY: ("delay [s]", "parameter 2", "parameter 3", "parameter 4"),
    Command.CONDITION_YAW: ("heading [°]", "rate [°/s]", "direction (1, -1)", "relative (0, 1)"),
    Command.DO_JUMP: ("item", "repetitions", "parameter 3", "parameter 4"),
    Command.DO_CHANGE_SPEED: ("kind (1: ground)", "speed [m/s]", "throttle [%]", "parameter 4"),
}


def item_entries(item: MissionItem) -> list[Entry]:
    """Return the fields of an item as texts; an empty one is unset."""
    x, y = (
        "" if not item.is_global else _text(float_coordinate(value, is_global=True), 7)
        for value in (item.x, item.y)
    )
    names = _PARAMETERS.get(
        Command(item.command) if item.command in list(Command) else Command.NAV_RETURN_TO_LAUNCH,
        tuple(f"parameter {number}" for number in range(1, 5)),
    )
    frame = _FRAME_WORDS.get(item.frame, str(item.frame))
    return [
        Entry("command", any_command_name(item.command), [command_name(command) for command in Command]),
        Entry("latitude [°]", x),
        Entry("longitude [°]", y),
        Entry("altitude [m]", _text(item.z)),
        Entry("altitude above", frame, [*_FRAMES, "none"]),
        *(Entry(name, _text(value)) for name, value in zip(names, item.params, strict=True)),
    ]


def item_of_texts(item: MissionItem, texts: Sequence[str]) -> MissionItem:
    """Return ``item`` with the fields of a form; raise ValueError with the field that is not valid."""
    name, latitude, longitude, altitude, frame_word, *params = texts
    command = command_number(name) or command_number(f"NAV_{name}")
    if command is None:
        raise ValueError(f"{name or 'nothing'} is not a command: {', '.join(map(command_name, Command))}, …")
    frame = _frame(frame_word, item)
    changed = replace(item, command=command, frame=frame)
    values = {
        "z": _number("altitude", altitude),
        **{f"param{index}": _number(f"parameter {index}", text) for index, text in enumerate(params, 1)},
    }
    if changed.is_global:
        values |= {"latitude": _number("latitude", latitude), "longitude": _number("longitude", longitude)}
        if changed.command in (Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME) and (
            math.isnan(values["latitude"]) or math.isnan(values["longitude"])
        ):
            raise ValueError(f"{any_command_name(command)} needs latitude and longitude")
    return edit.change((changed,), 0, **values)[0]


def new_item(place_deg: tuple[float, float] | None, altitude_m: float) -> MissionItem:
    """Return a waypoint at a place, above home."""
    item = MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT_INT, param4=math.nan, z=altitude_m)
    latitude, longitude = place_deg or (math.nan, math.nan)
    return edit.change((item,), 0, latitude=latitude, longitude=longitude)[0]


def _frame(word: str, item: MissionItem) -> int:
    """Return the frame of a word; the item's own if it means the same."""
    word = word.lower()
    if word == _FRAME_WORDS.get(item.frame, str(item.frame)):
        return item.frame
    if word == "none":
        return Frame.MISSION
    if word not in _FRAMES:
        raise ValueError(f"altitude above {word or 'nothing'}: choose one of {', '.join(_FRAMES)}, none")
    return _FRAMES[word]


def _number(name: str, text: str) -> float:
    if not text:
        return math.nan
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f"{name}: {text} is not a number") from None
    if math.isinf(number):
        raise ValueError(f"{name}: give a finite number")
    return number


def _text(value: float, digits: int = 6) -> str:
    if math.isnan(value):
        return ""
    return f"{value:.{digits}f}" if digits == 7 else f"{value:g}"
