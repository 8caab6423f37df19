"""Artificial horizon and heading tape in text. Pure."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from rich.style import Style
from rich.text import Text

from gcs_cli.tui.palette import DARK, Palette
from gcs_cli.vehicle.view_types import Euler

_Codes: TypeAlias = np.ndarray[Any, np.dtype[np.uint8]]

_LINE, _LADDER, _AIRCRAFT, _NO_DATA = "#f4f4f4", "#a9c4e2", "#ffd75f", "#303030"
_SKY_CODE, _GROUND_CODE, _LADDER_CODE, _LINE_CODE, _NO_DATA_CODE = range(5)
_PITCH_SPAN_DEG = 50.0  # from top to bottom
_LADDER_STEP_DEG = 10.0
_SHORT_DEG, _LONG_DEG = 4.5, 8.0
"""Half the length of the ladder's lines, the long ones at multiples of 20°."""
_LABEL_GAP_DEG = 2.0
_COMPASS = {0: "N", 45: "NE", 90: "E", 135: "SE", 180: "S", 225: "SW", 270: "W", 315: "NW"}


def horizon(attitude: Euler | None, width: int, height: int, colours: Palette = DARK) -> list[Text]:
    """Draw the horizon as seen from the vehicle in ``width`` × ``height`` cells, two pixels to a cell."""
    codes = _pixels(attitude, width, 2 * height)
    marks = _marks(attitude, width, height)
    shades = (colours.sky, colours.ground, _LADDER, _LINE, _NO_DATA)
    return [_row(codes[2 * row], codes[2 * row + 1], marks.get(row, {}), shades) for row in range(height)]


def _scale(height: int) -> float:
    """Return the degrees of pitch of a pixel, which is as wide as high."""
    return _PITCH_SPAN_DEG / (2 * height)


def _pixels(attitude: Euler | None, width: int, rows: int) -> _Codes:
    if attitude is None:
        return np.full((rows, width), _NO_DATA_CODE, dtype=np.uint8)
    scale = _PITCH_SPAN_DEG / rows
    right = ((np.arange(width) + 0.5 - width / 2) * scale)[None, :]  # of the aircraft symbol, in degrees
    up = ((rows / 2 - np.arange(rows) - 0.5) * scale)[:, None]
    cos_roll, sin_roll = math.cos(attitude.roll_rad), math.sin(attitude.roll_rad)
    along = np.abs(right * cos_roll + up * sin_roll)
    elevation = up * cos_roll - right * sin_roll + math.degrees(attitude.pitch_rad)
    step = np.round(elevation / _LADDER_STEP_DEG) * _LADDER_STEP_DEG
    near = (elevation - step >= -scale / 2) & (elevation - step < scale / 2)
    codes = np.where(elevation > 0.0, _SKY_CODE, _GROUND_CODE).astype(np.uint8)
    codes[near & (along < np.where(step % 20, _SHORT_DEG, _LONG_DEG))] = _LADDER_CODE
    codes[near & (step == 0.0)] = _LINE_CODE
    return codes


def _marks(attitude: Euler | None, width: int, height: int) -> dict[int, dict[int, tuple[str, str]]]:
    """Return character and colour by row and column: the aircraft symbol, and the ladder's labels."""
    marks: dict[int, dict[int, tuple[str, str]]] = {}
    if attitude is not None and width >= 40:
        for degrees in (-40, -20, 20, 40):
            column, row = _place(attitude, degrees, _LONG_DEG + _LABEL_GAP_DEG, width, height)
            if 0 <= row < height and 0 <= column < width - 1:
                label = f"{abs(degrees)}"
                marks[row] = {column + i: (mark, _LADDER) for i, mark in enumerate(label)}
    middle, centre = height // 2, width // 2
    symbol = {centre + side * k: ("━", _AIRCRAFT) for side in (-1, 1) for k in (3, 4, 5)}
    marks.setdefault(middle, {}).update({centre: ("◆", _AIRCRAFT), **symbol})
    return marks


def _place(
    attitude: Euler, elevation_deg: float, along_deg: float, width: int, height: int
) -> tuple[int, int]:
    scale = _scale(height)
    up = elevation_deg - math.degrees(attitude.pitch_rad)
    cos_roll, sin_roll = math.cos(attitude.roll_rad), math.sin(attitude.roll_rad)
    right, above = along_deg * cos_roll - up * sin_roll, along_deg * sin_roll + up * cos_roll
    return math.floor(width / 2 + right / scale), math.floor((height - above / scale) / 2)


def _row(upper: _Codes, lower: _Codes, marks: dict[int, tuple[str, str]], shades: tuple[str, ...]) -> Text:
    """Join cells of the same colours: runs are drawn faster than cells."""
    text = Text(no_wrap=True, end="")
    pairs = upper.astype(np.int16) * len(shades) + lower
    for column in marks:
        if 0 <= column < len(pairs):
            pairs[column] = -1 - column  # a run of its own
    edges = [0, *(np.flatnonzero(np.diff(pairs)) + 1).tolist(), len(pairs)]
    for start, end in pairwise(edges):
        above, below = int(upper[start]), int(lower[start])
        if start in marks and end == start + 1:
            mark, colour = marks[start]
            text.append(mark, _style(colour, shades[below], bold=True))
        elif above == below:
            text.append(" " * (end - start), _style(shades[above], shades[above]))
        elif above > below:  # the code of the thinner thing is the higher one
            text.append("▀" * (end - start), _style(shades[above], shades[below]))
        else:
            text.append("▄" * (end - start), _style(shades[below], shades[above]))
    return text


@cache
def _style(colour: str, background: str, bold: bool = False) -> Style:
    return Style(color=colour, bgcolor=background, bold=bold)


def heading_tape(yaw_rad: float | None, width: int, colours: Palette = DARK) -> Text:
    """Draw a compass strip, 3° a character, with the heading in figures at its middle."""
    if yaw_rad is None:
        return Text("—".center(width), style=colours.muted, no_wrap=True)
    heading = math.degrees(yaw_rad) % 360
    cells = [" "] * width
    for column in range(width):
        degrees = 3 * (round(heading / 3) + column - width // 2) % 360
        if degrees % 45 == 0:
            label = _COMPASS[degrees]
            cells[column : column + len(label)] = list(label)
        elif degrees % 15 == 0 and cells[column] == " ":
            cells[column] = "·"
    text = Text("".join(cells[:width]), colours.text, no_wrap=True)
    if width < 12:
        text.stylize("bold reverse", width // 2, width // 2 + 1)
        return text
    figures = f" {round(heading) % 360:03d}° "
    start = width // 2 - 3
    strip = text[:start]
    strip.append(figures, f"bold {colours.background} on {colours.accent}")
    strip.append_text(text[start + len(figures) :])
    return strip
