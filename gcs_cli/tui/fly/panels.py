"""Panels of the screen Fly, drawn from the vehicle's state, and the formats that they share. Pure."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

from rich.text import Text

from gcs_cli.actions.conditions import distance_home_m
from gcs_cli.tui.palette import DARK, Palette
from gcs_cli.vehicle.field_units import UNKNOWN, number
from gcs_cli.vehicle.view_types import Setpoint, StatusText, Vector, VehicleView

SEVERITIES = ("EMERG", "ALERT", "CRIT", "ERROR", "WARN", "NOTE", "INFO", "DEBUG")
_MISSION_STATES = {1: "no mission", 2: "not started", 3: "active", 4: "paused", 5: "complete"}
_MESSAGE_INDENT = 14
_BLOCKS = "·▏▎▍▌▋▊▉"
_LOW_CHARGE, _CRITICAL_CHARGE = 0.3, 0.15


def clock_text(time_s: float | None) -> str:
    """Format vehicle time as minutes and seconds."""
    if time_s is None:
        return UNKNOWN
    minutes, seconds = divmod(time_s, 60)
    return f"{int(minutes)}:{seconds:04.1f}"


def duration_text(seconds: float) -> str:
    """Format a duration in hours, minutes and seconds, or minutes and seconds."""
    minutes, rest = divmod(round(min(seconds, 359_999.0)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def ground_speed(velocity: Vector | None) -> float | None:
    """Return the horizontal speed [m/s]; None if unknown."""
    return None if velocity is None else math.hypot(velocity.x, velocity.y)


def height_m(view: VehicleView) -> float | None:
    """Return the altitude above home, else above the local origin [m]; None if unknown."""
    if view.geo is not None:
        return view.geo.relative_altitude_m
    return None if view.position_ned_m is None else -view.position_ned_m.z


def bar(fraction: float | None, width: int, style: str, rest: str = DARK.muted) -> Text:
    """Draw a bar with eighths of a cell; an empty one if the value is unknown."""
    full = min(1.0, max(0.0, fraction or 0.0)) * width
    whole = int(full)
    part = _BLOCKS[int((full - whole) * 8)] if whole < width else ""
    text = Text("█" * whole + part, style=style, no_wrap=True)
    text.append("·" * (width - len(text)), style=rest)
    return text


def row_of(label: str, value: str, style: str, colours: Palette, gap: int = 11) -> Text:
    """Return a line of a label and its value."""
    return Text.assemble((f"{label:<{gap}}", colours.muted), (value, style), no_wrap=True)


def position_panel(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Text]:
    """Position and velocity beside the setpoint."""
    position, velocity = view.position_ned_m, view.velocity_ned_m_s
    wanted = view.setpoint or Setpoint()
    rows: list[tuple[str, float | None, float | None, str]] = []
    for axis, name, sign in ((0, "north", 1), (1, "east", 1), (2, "up", -1)):
        now = None if position is None else sign * position[axis]
        target = None if wanted.position_ned_m is None else sign * wanted.position_ned_m[axis]
        rows.append((name, now, target, "m"))
    target_v = wanted.velocity_ned_m_s
    rows.append(("speed", ground_speed(velocity), ground_speed(target_v), "m/s"))
    climb = None if velocity is None else -velocity.z
    rows.append(("climb", climb, None if target_v is None else -target_v.z, "m/s"))
    column = max(8, (width - 11) // 2)
    lines = [
        Text.assemble(
            (f"{name:<6}", colours.muted),
            (f"{number(now):>{column}}", f"bold {colours.text}"),
            (f"{number(target):>{column}}", colours.target),
            (f" {unit}", colours.muted),
            no_wrap=True,
        )
        for name, now, target, unit in rows
    ]
    if height > len(lines):
        head = Text(f"{'':<6}{'now':>{column}}", colours.muted)
        lines.insert(0, head.append(f"{'target':>{column}}", colours.target))
    geo = view.geo
    if geo is not None:
        lines.append(Text(f"{geo.latitude_deg:.6f}° {geo.longitude_deg:.6f}°", colours.muted))
        lines.append(row_of("above sea", f"{geo.altitude_m:.1f} m", colours.text, colours))
    distance_m = distance_home_m(view)
    if distance_m is not None:
        lines.append(row_of("from home", f"{number(distance_m, 1)} m", colours.text, colours))
    return lines[:height]


def power_panel(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Text]:
    """Battery with remaining time, throttle, and rotor speeds as bars."""
    lines = [_battery(view, width, colours)]
    if height >= 7:
        throttle = row_of("throttle", "", "", colours)
        throttle.append_text(bar(view.throttle, max(4, width - 17), colours.accent, colours.muted))
        share = UNKNOWN if view.throttle is None else f"{view.throttle:.0%}"
        lines.append(throttle.append(f" {share:>5}", f"bold {colours.text}"))
    lines += _rotors(view, width, max(1, height - len(lines)), colours)
    return lines[:height]


def _battery(view: VehicleView, width: int, colours: Palette) -> Text:
    battery = view.battery
    if battery is None:
        return row_of("battery", UNKNOWN, f"bold {colours.text}", colours)
    left = battery.remaining
    line = Text("battery ", colours.muted, no_wrap=True, overflow="crop")
    style = colours.text
    if left is not None:
        low, critical = left <= _LOW_CHARGE, left <= _CRITICAL_CHARGE
        style = colours.bad if critical else colours.warning if low else colours.good
        if width >= 46:
            line.append_text(bar(left, width - 38, style, colours.muted)).append(" ")
        line.append(f"{left:.0%} ", f"bold {style}")
    parts = []
    if battery.voltage_v is not None:
        parts.append(f"{battery.voltage_v:.1f} V")
    if battery.current_a is not None:
        parts.append(f"{battery.current_a:.1f} A")
    line.append(" ".join(parts), colours.text)
    if view.battery_time_s is not None:
        left_text = duration_text(view.battery_time_s) + (" left" if width >= 40 else "")
        line.append(f" {left_text}", f"bold {style}")
    return line


def _rotors(view: VehicleView, width: int, rows: int, colours: Palette) -> list[Text]:
    speeds: Sequence[float | None] = view.rotor_rpm or (None,) * 4
    scale = _round_above(view.rotor_peak_rpm)
    columns = math.ceil(len(speeds) / rows)
    share = width // columns
    cells = []
    for index, rpm in enumerate(speeds):
        fraction = None if rpm is None or not scale else abs(rpm) / scale
        cell = Text(f"{index + 1:<2}", colours.muted, no_wrap=True)
        cell.append_text(bar(fraction, max(2, share - 10), colours.good, colours.muted))
        cells.append(cell.append(f"{UNKNOWN if rpm is None else f'{rpm:.0f}':>7} ", f"bold {colours.text}"))
    lines = [Text("", no_wrap=True).join(cells[i : i + columns]) for i in range(0, len(cells), columns)]
    if len(lines) < rows and scale:
        lines.append(Text(f"0 to {scale:.0f} rpm".rjust(width - 1), colours.muted))
    return lines


def _round_above(value: float) -> float:
    if value <= 0:
        return 0.0
    decade = 10.0 ** math.floor(math.log10(value))
    return next(decade * step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10, 20) if decade * step >= value)


def mission_panel(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Text]:
    """Mission progress."""
    mission = view.mission
    total = mission.total
    if not total:
        return [Text("none loaded", colours.muted)]
    done = total if mission.complete else min(total, (mission.current or 0))
    state = _MISSION_STATES.get(mission.state or 0, "")
    if mission.reached is not None and not mission.complete:
        state = f"reached {mission.reached}  {state}"
    label = mission.item_text or f"item {UNKNOWN}"
    style = colours.good if mission.complete else colours.accent
    line = Text(f"{label} ", f"bold {colours.text}", no_wrap=True, overflow="crop")
    line.append_text(bar(done / total, max(3, width - len(label) - len(state) - 3), style, colours.muted))
    line.append(f"  {state}", f"bold {colours.good}" if mission.complete else colours.text)
    return [line]


def messages_panel(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Text]:
    """The latest status texts, newest at the bottom; long ones are wrapped."""
    lines = [line for entry in view.texts[-height:] for line in message_lines(entry, width, colours)]
    if not lines:
        return [Text("none yet", colours.muted)]
    return lines[-max(1, height) :]


def severity_style(severity: int, colours: Palette) -> str:
    """Return the style of a MAV_SEVERITY."""
    bad, normal = colours.bad, colours.text
    styles = (*[f"bold {bad}"] * 3, bad, colours.warning, colours.accent, normal, colours.muted)
    return styles[min(severity, 7)]


def message_lines(entry: StatusText, width: int, colours: Palette = DARK) -> list[Text]:
    """One status text: vehicle time, severity, text; further lines are indented."""
    severity = min(entry.severity, 7)
    style = severity_style(severity, colours)
    head = Text(f"{clock_text(entry.vehicle_time_s):>7} ", style=colours.muted, no_wrap=True)
    head.append(f"{SEVERITIES[severity]:<6}", style=colours.good if severity == 6 else style)
    pieces = textwrap.wrap(entry.text, max(10, width - _MESSAGE_INDENT)) or [""]
    head.append(pieces[0], style=style)
    return [head, *(Text(" " * _MESSAGE_INDENT + piece, style=style, no_wrap=True) for piece in pieces[1:])]
