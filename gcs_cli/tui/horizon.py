"""Artificial horizon and heading tape in text. Pure."""

from __future__ import annotations

import math
from functools import cache
from itertools import groupby
from operator import itemgetter

from rich.style import Style
from rich.text import Text

from gcs_cli.vehicle.view_types import Euler

_SKY, _GROUND = "#1f5fa8", "#7a4a1e"
_LINE, _LADDER, _AIRCRAFT = "#f4f4f4", "#a9c4e2", "#ffd75f"
_NO_DATA = "#303030"
_PITCH_SPAN_DEG = 50.0  # from top to bottom
_LADDER_STEP_DEG = 10.0
_CELL_ASPECT = 1.0  # width over height of half a character cell
_COMPASS = {0: "N", 45: "NE", 90: "E", 135: "SE", 180: "S", 225: "SW", 270: "W", 315: "NW"}


def horizon(attitude: Euler | None, width: int, height: int) -> Text:
    """Draw the horizon as seen from the vehicle in ``width`` × ``height`` cells, two pixels to a cell."""
    text = Text(no_wrap=True)
    for row in range(height):
        cells = [_cell(attitude, column, row, width, height) for column in range(width)]
        for style, run in groupby(cells, key=itemgetter(1)):  # runs are drawn faster than cells
            text.append("".join(mark for mark, _ in run), style)
        if row < height - 1:
            text.append("\n")
    return text


def _cell(attitude: Euler | None, column: int, row: int, width: int, height: int) -> tuple[str, Style]:
    upper = _pixel(attitude, column, 2 * row, width, 2 * height)
    lower = _pixel(attitude, column, 2 * row + 1, width, 2 * height)
    mark = _aircraft(column, row, width, height)
    return (mark, _style(_AIRCRAFT, lower)) if mark else ("▀", _style(upper, lower))


@cache
def _style(colour: str, background: str) -> Style:
    return Style(color=colour, bgcolor=background, bold=colour == _AIRCRAFT)


def _pixel(attitude: Euler | None, column: int, row: int, width: int, height: int) -> str:
    if attitude is None:
        return _NO_DATA
    # right and up of the aircraft symbol, in degrees of pitch
    scale = _PITCH_SPAN_DEG / height
    right = (column + 0.5 - width / 2) * scale * _CELL_ASPECT
    up = (height / 2 - row - 0.5) * scale
    cos_roll, sin_roll = math.cos(attitude.roll_rad), math.sin(attitude.roll_rad)
    along = right * cos_roll + up * sin_roll
    elevation = up * cos_roll - right * sin_roll + math.degrees(attitude.pitch_rad)
    if abs(elevation) < scale / 2:
        return _LINE
    step = round(elevation / _LADDER_STEP_DEG) * _LADDER_STEP_DEG
    if step and abs(elevation - step) < scale / 2 and abs(along) < (4.5 if step % 20 else 8.0):
        return _LADDER
    return _SKY if elevation > 0 else _GROUND


def _aircraft(column: int, row: int, width: int, height: int) -> str:
    if row != height // 2:
        return ""
    offset = column - width // 2
    if offset == 0:
        return "◆"
    return "━" if 3 <= abs(offset) <= 5 else ""


def heading_tape(yaw_rad: float | None, width: int) -> Text:
    """Draw a compass strip, 3° a character, with the heading at its middle."""
    if yaw_rad is None:
        return Text("—".center(width), style="dim", no_wrap=True)
    heading = math.degrees(yaw_rad) % 360
    cells = [" "] * width
    for column in range(width):
        degrees = 3 * (round(heading / 3) + column - width // 2) % 360
        if degrees % 45 == 0:
            label = _COMPASS[degrees]
            cells[column : column + len(label)] = list(label)
        elif degrees % 15 == 0 and cells[column] == " ":
            cells[column] = "·"
    text = Text("".join(cells[:width]), no_wrap=True)
    text.stylize("bold reverse", width // 2, width // 2 + 1)
    return text
