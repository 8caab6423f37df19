"""The vehicle's state for a window that is too small for panels, and the wait for a vehicle. Pure."""

from __future__ import annotations

from rich.text import Text

from gcs_cli.tui.fly.panels import ground_speed, height_m, message_lines
from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.field_units import UNKNOWN, number
from gcs_cli.vehicle.view_types import VehicleView


def compact(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Text]:
    """Draw the most important figures first, then the newest messages."""
    mission = view.mission
    item = (mission.item_text or f"item {UNKNOWN}") if mission.total else "none loaded"
    battery = None if view.battery is None else view.battery.remaining
    rows = [
        ("altitude", f"{number(height_m(view), 1)} m"),
        ("speed", f"{number(ground_speed(view.velocity_ned_m_s), 1)} m/s"),
        ("battery", UNKNOWN if battery is None else f"{battery:.0%}"),
        ("mission", item),
    ]
    lines = [Text.assemble((f"{name:<9}", colours.muted), value, no_wrap=True) for name, value in rows]
    if view.in_failsafe:
        lines.insert(0, Text("failsafe active", f"bold {colours.bad}"))
    room = max(0, height - len(lines))
    texts = [line for entry in view.texts[-room:] for line in message_lines(entry, width, colours)]
    return (lines + (texts[-room:] if room else []))[:height]


def waiting(link_name: str, width: int, height: int, colours: Palette) -> list[Text]:
    """Say that no vehicle was found yet on ``link_name``, in the middle."""
    lines = [
        Text("Waiting for a vehicle's heartbeat", f"bold {colours.text}"),
        Text(f"on {link_name}", colours.accent),
    ]
    for line in lines:
        line.truncate(width)
        line.pad_left(max(0, (width - len(line)) // 2))
    blank = [Text()] * max(0, (height - len(lines)) // 2)
    return [*blank, *lines][:height]
