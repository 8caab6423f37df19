"""Panels of the terminal view, drawn from the vehicle's state. Pure."""

from __future__ import annotations

import math
import textwrap

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from gcs_cli.tui.horizon import heading_tape, horizon
from gcs_cli.vehicle.view_types import Euler, Setpoint, StatusText, VehicleView

UNKNOWN = "—"
SEVERITIES = ("EMERG", "ALERT", "CRIT", "ERROR", "WARN", "NOTE", "INFO", "DEBUG")
_SEVERITY_STYLES = ("bold red", "bold red", "bold red", "red", "yellow", "cyan", "", "dim")
_MISSION_STATES = {1: "no mission", 2: "not started", 3: "active", 4: "paused", 5: "complete"}
_MESSAGE_INDENT = 14
_BLOCKS = "·▏▎▍▌▋▊▉"


def number(value: float | None, digits: int = 2, unit: str = "") -> str:
    """Format a number; a dash if unknown."""
    if value is None:
        return UNKNOWN
    if abs(value) >= 1e7:
        return f"{value:.1e}{unit}"
    return f"{round(value, digits) + 0.0:.{digits}f}{unit}"  # + 0.0: no -0.00


def framed(title: str, content: RenderableType, style: str = "bright_black") -> Panel:
    """Return a panel with a frame around ``content``."""
    heading = Text(title, style="bold cyan")
    return Panel(content, title=heading, title_align="left", border_style=style, padding=(0, 1))


def bar(fraction: float | None, width: int, style: str) -> Text:
    """Draw a bar with eighths of a cell; an empty one if the value is unknown."""
    full = min(1.0, max(0.0, fraction or 0.0)) * width
    whole = int(full)
    part = _BLOCKS[int((full - whole) * 8)] if whole < width else ""
    text = Text("█" * whole + part, style=style)
    text.append("·" * (width - len(text)), style="bright_black")
    return text


def attitude_panel(view: VehicleView, width: int, height: int) -> Panel:
    """Artificial horizon, heading tape, the angles and, if there is room, their setpoints."""
    inner, room_for_targets = width - 4, height >= 14
    angles = view.attitude
    figures = [_angles(angles, inner, "bold")]
    if room_for_targets:
        figures.append(_angles(view.attitude_target, inner, "magenta", "target"))
    picture = horizon(angles, inner, height - 3 - len(figures))
    tape = heading_tape(None if angles is None else angles.yaw_rad, inner)
    return framed("Attitude", Group(picture, tape, *figures))


def _angles(angles: Euler | None, width: int, style: str, label: str = "") -> Text:
    names, gap = (("roll", "pitch", "yaw"), "  ") if width >= 40 else (("R", "P", "Y"), " ")
    text = Text(no_wrap=True, overflow="crop", justify="center")
    if label:
        text.append(f"{label}  ", style="bright_black")
    for index, name in enumerate(names):
        degrees = None if angles is None else math.degrees(angles[index])
        shown = UNKNOWN
        if degrees is not None:
            shown = f"{round(degrees) % 360:03d}°" if index == 2 else f"{degrees:+.1f}°"
        text.append(f"{name} ", style="bright_black")
        text.append(shown, style=style)
        text.append(gap if index < 2 else "")
    return text


def position_panel(view: VehicleView) -> Panel:
    """Position and velocity beside the setpoint."""
    grid = Table.grid(padding=(0, 1), expand=True)
    grid.add_column(style="bright_black")
    for style in ("bold", "magenta"):
        grid.add_column(justify="right", style=style, no_wrap=True)
    grid.add_column(style="bright_black")
    grid.add_row("", Text("now", style="bright_black"), Text("target", style="bright_black"), "")
    position, velocity = view.position_ned_m, view.velocity_ned_m_s
    wanted = view.setpoint or Setpoint()
    for axis, name, sign in ((0, "north", 1), (1, "east", 1), (2, "up", -1)):
        now = None if position is None else sign * position[axis]
        target = None if wanted.position_ned_m is None else sign * wanted.position_ned_m[axis]
        grid.add_row(name, number(now), number(target), "m")
    speed = None if velocity is None else math.hypot(velocity.x, velocity.y)
    wanted_v = wanted.velocity_ned_m_s
    wanted_speed = None if wanted_v is None else math.hypot(wanted_v.x, wanted_v.y)
    grid.add_row("speed", number(speed), number(wanted_speed), "m/s")
    climb = None if velocity is None else -velocity.z
    grid.add_row("climb", number(climb), number(None if wanted_v is None else -wanted_v.z), "m/s")
    geo = view.geo
    place = Text(no_wrap=True, overflow="ellipsis", style="bright_black")
    place.append(UNKNOWN if geo is None else f"{geo.latitude_deg:.6f}° {geo.longitude_deg:.6f}°")
    return framed("Position", Group(grid, place))


def rotors_panel(view: VehicleView, width: int) -> Panel:
    """Rotor speeds as bars scaled to a round number above the largest, throttle and battery."""
    scale = _round_above(view.rotor_peak_rpm)
    rows: list[RenderableType] = []
    for index, rpm in enumerate(view.rotor_rpm or (None,) * 4):
        fraction = None if rpm is None or not scale else abs(rpm) / scale
        row = Text(f"{index + 1} ", style="bright_black", no_wrap=True)
        row.append_text(bar(fraction, max(4, width - 12), "green"))
        row.append(f"{UNKNOWN if rpm is None else f'{rpm:.0f}':>6}", style="bold")
        rows.append(row)
    throttle = Text("throttle ", style="bright_black", no_wrap=True)
    throttle.append(UNKNOWN if view.throttle is None else f"{view.throttle:.0%}", style="bold")
    title = f"Rotors 0–{scale:.0f} rpm" if scale else "Rotors rpm"
    return framed(title, Group(*rows, Text(), throttle, _battery(view)))


def _battery(view: VehicleView) -> Text:
    line = Text("battery  ", style="bright_black", no_wrap=True)
    battery = view.battery
    if battery is None:
        line.append(UNKNOWN, style="bold")
        return line
    left = battery.remaining
    if left is not None:
        line.append(f"{left:.0%} ", style="bold green" if left > 0.3 else "bold red")
    line.append(" ".join(filter(None, (_unit(battery.voltage_v, "V"), _unit(battery.current_a, "A")))))
    return line


def _unit(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.1f} {unit}"


def _round_above(value: float) -> float:
    if value <= 0:
        return 0.0
    decade = 10.0 ** math.floor(math.log10(value))
    return next(decade * step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10, 20) if decade * step >= value)


def mission_panel(view: VehicleView) -> Panel:
    """Mission progress."""
    mission = view.mission
    total = mission.total
    if not total:
        return framed("Mission", Text("none loaded", style="bright_black"))
    done = total if mission.complete else min(total, (mission.current or 0))
    grid = Table.grid(padding=(0, 2), expand=True)
    grid.add_column(no_wrap=True)
    grid.add_column(ratio=1)
    grid.add_column(no_wrap=True, justify="right")
    label = Text(mission.item_text or f"item {UNKNOWN}", style="bold")
    state = _MISSION_STATES.get(mission.state or 0, "")
    if mission.reached is not None and not mission.complete:
        state = f"reached {mission.reached}  {state}"
    grid.add_row(
        label,
        ProgressBar(total=total, completed=done, complete_style="green", finished_style="bold green"),
        Text(state, style="bold green" if mission.complete else ""),
    )
    return framed("Mission", grid)


def messages_panel(view: VehicleView, width: int, lines: int) -> Panel:
    """The latest status texts, newest at the bottom; long ones are wrapped."""
    shown = [line for entry in view.texts for line in message_lines(entry, width - 4)]
    last = shown[-max(1, lines) :]
    return framed("Messages", Group(*last) if last else Text("none yet", style="bright_black"))


def message_lines(entry: StatusText, width: int) -> list[Text]:
    """One status text: vehicle time, severity, text; further lines are indented."""
    severity = min(entry.severity, 7)
    style = _SEVERITY_STYLES[severity]
    head = Text(f"{clock_text(entry.vehicle_time_s):>7} ", style="bright_black", no_wrap=True)
    head.append(f"{SEVERITIES[severity]:<6}", style=style or "green")
    pieces = textwrap.wrap(entry.text, max(10, width - _MESSAGE_INDENT)) or [""]
    head.append(pieces[0], style=style)
    return [head, *(Text(" " * _MESSAGE_INDENT + piece, style=style, no_wrap=True) for piece in pieces[1:])]


def clock_text(time_s: float | None) -> str:
    """Format vehicle time as minutes and seconds."""
    if time_s is None:
        return UNKNOWN
    minutes, seconds = divmod(time_s, 60)
    return f"{int(minutes)}:{seconds:04.1f}"
