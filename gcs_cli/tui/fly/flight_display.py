"""Primary flight display: horizon between tapes of speed and altitude, above the heading tape. Pure."""

from __future__ import annotations

import math
from functools import lru_cache

from gcs_cli.charts.canvas import Run, Runs
from gcs_cli.tui.fly.horizon import heading_tape, horizon
from gcs_cli.tui.fly.panels import ground_speed, height_m
from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.field_units import UNKNOWN
from gcs_cli.vehicle.view_types import Euler, VehicleView

_TAPE = 8
"""Columns of a tape."""
_FAST_M_S = 20.0
_TARGETS_FROM_ROWS = 15


def flight_display(view: VehicleView, _now_s: float, width: int, height: int, colours: Palette) -> list[Runs]:
    """Draw the display in ``width`` × ``height`` cells."""
    figures = [_angles(view.attitude, width, colours, f"bold {colours.text}")]
    if height >= _TARGETS_FROM_ROWS:
        figures.append(_angles(view.attitude_target, width, colours, colours.target, "target"))
    rows = max(1, height - 1 - len(figures))
    picture = horizon(view.attitude, max(1, width - 2 * _TAPE), rows, colours)
    speed_m_s, target_m_s = ground_speed(view.velocity_ned_m_s), None
    now_height_m, target_height_m = height_m(view), None
    if view.setpoint is not None:
        target_m_s = ground_speed(view.setpoint.velocity_ned_m_s)
        wanted, now = view.setpoint.position_ned_m, view.position_ned_m
        if wanted is not None and now is not None and now_height_m is not None:
            target_height_m = now_height_m + now.z - wanted.z  # the local origin is not at home
    speeds = _tape(speed_m_s, target_m_s, rows, 0.5 if (speed_m_s or 0.0) < _FAST_M_S else 1.0, colours)
    heights = _tape(now_height_m, target_height_m, rows, 1.0, colours, on_right=True)
    lines = [
        Runs((*left, *middle, *right)) for left, middle, right in zip(speeds, picture, heights, strict=True)
    ]
    yaw_rad = None if view.attitude is None else view.attitude.yaw_rad
    tape = heading_tape(yaw_rad, max(1, width - 2 * _TAPE), colours)
    lines += [Runs([(f"{'m/s':>6}  ", colours.muted), *tape, (f"  {'m':<6}", colours.muted)]), *figures]
    return lines


def _tape(
    value: float | None,
    target: float | None,
    rows: int,
    step: float,
    colours: Palette,
    on_right: bool = False,
) -> list[Runs]:
    """Draw a scale with ``value`` at the middle row, and a mark at ``target``."""
    middle = rows // 2
    if value is None or not abs(value) < 1e6:
        lines = [Runs([(" " * _TAPE, "")])] * rows
        lines[middle] = Runs([(f"{UNKNOWN:^{_TAPE}}", colours.muted)])
        return lines
    base = round(value / step)
    marked = None
    if target is not None and math.isfinite(target):
        marked = min(rows - 1, max(0, middle - round(max(-1e6, min(1e6, (target - value) / step)))))
    lines = []
    for row in range(rows):
        number = base + middle - row
        label = f"{number * step:.0f}" if number % 2 == 0 else ""
        lines.append(_tick(label, row == marked, colours, on_right))
    lines[middle] = _value(f"{round(value, 1) + 0.0:.1f}", middle == marked, colours, on_right)
    return lines


@lru_cache(1000)
def _tick(label: str, is_target: bool, colours: Palette, on_right: bool) -> Runs:
    if on_right:
        mark, style = ("◂", f"bold {colours.target}") if is_target else ("├", colours.muted)
        return Runs([(mark, style), (f" {label:<{_TAPE - 2}}", colours.muted)])
    mark, style = ("▸", f"bold {colours.target}") if is_target else ("┤", colours.muted)
    return Runs([(f"{label:>{_TAPE - 2}} ", colours.muted), (mark, style)])


def _value(text: str, is_target: bool, colours: Palette, on_right: bool) -> Runs:
    box = f"bold {colours.background} on {colours.text}"
    pointer = colours.target if is_target else colours.text
    if on_right:
        return Runs([("◀", pointer), (f" {text:<{_TAPE - 2}}", box)])
    return Runs([(f"{text:>{_TAPE - 2}} ", box), ("▶", pointer)])


def _angles(angles: Euler | None, width: int, colours: Palette, style: str, label: str = "") -> Runs:
    names, gap = (("roll", "pitch", "yaw"), "   ") if width >= 40 else (("R", "P", "Y"), " ")
    runs: list[Run] = [(f"{label}  ", colours.muted)] if label else []
    for index, name in enumerate(names):
        degrees = None if angles is None else math.degrees(angles[index])
        shown = UNKNOWN
        if degrees is not None:
            shown = f"{round(degrees) % 360:03d}°" if index == 2 else f"{round(degrees, 1) + 0.0:+.1f}°"
        runs += [(f"{name} ", colours.muted), (shown, style), (gap if index < 2 else "", "")]
    length = sum(len(text) for text, _ in runs)
    return Runs([(" " * ((width - length) // 2), ""), *runs])
