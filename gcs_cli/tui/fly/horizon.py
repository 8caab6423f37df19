"""Artificial horizon and heading tape in text. Pure."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise, product
from typing import Any, TypeAlias

import numpy as np
from rich.style import Style

from gcs_cli.charts.canvas import Run, Runs
from gcs_cli.tui.palette import DARK, Palette
from gcs_cli.vehicle.view_types import Euler

_Codes: TypeAlias = np.ndarray[Any, np.dtype[np.uint8]]

_LINE, _LADDER, _AIRCRAFT, _NO_DATA = "#f4f4f4", "#a9c4e2", "#ffd75f", "#303030"
SKY_CODE, _GROUND_CODE, _LADDER_CODE, _LINE_CODE, _NO_DATA_CODE = range(5)
_PITCH_SPAN_DEG = 50.0  # from top to bottom
_LADDER_STEP_DEG = 10.0
_SHORT_DEG, _LONG_DEG = 4.5, 8.0
"""Half the length of the ladder's lines, the long ones at multiples of 20°."""
_LABEL_GAP_DEG = 2.0
_COMPASS = {0: "N", 45: "NE", 90: "E", 135: "SE", 180: "S", 225: "SW", 270: "W", 315: "NW"}


def horizon(attitude: Euler | None, width: int, height: int, colours: Palette = DARK) -> list[Runs]:
    """Draw the horizon as seen from the vehicle in ``width`` × ``height`` cells, two pixels to a cell.

    Cells of the same colours are joined: runs are drawn faster than cells.
    """
    codes = sky_pixels(attitude, width, 2 * height)
    shades = (colours.sky, colours.ground, _LADDER, _LINE, _NO_DATA)
    lower = codes[1::2]
    pairs = codes[::2].astype(np.int16) * len(shades) + lower
    marks = {
        (row, column): mark
        for row, of_row in _marks(attitude, width, height).items()
        for column, mark in of_row.items()
        if 0 <= column < width
    }
    for row, column in marks:
        pairs[row, column] = -1 - column  # a run of its own
    is_start = np.ones(pairs.shape, dtype=np.bool_)
    is_start[:, 1:] = pairs[:, 1:] != pairs[:, :-1]
    starts = np.flatnonzero(is_start)
    rows: list[list[Run]] = [[] for _ in range(height)]
    looks = _looks(shades)
    edges = [*starts.tolist(), pairs.size]
    for (start, end), pair in zip(pairwise(edges), pairs.ravel()[starts].tolist(), strict=True):
        row, column = divmod(start, width)
        if pair < 0:
            mark, colour = marks[row, column]
            rows[row].append((mark, _style(colour, shades[lower[row, column]], bold=True)))
        else:
            block, style = looks[pair]
            rows[row].append((block * (end - start), style))
    return [Runs(row) for row in rows]


def _scale(height: int) -> float:
    """Return the degrees of pitch of a pixel, which is as wide as high."""
    return _PITCH_SPAN_DEG / (2 * height)


def sky_pixels(attitude: Euler | None, width: int, rows: int) -> _Codes:
    """Return the code of each pixel of the horizon, shape (rows, width)."""
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
    codes = np.where(elevation > 0.0, SKY_CODE, _GROUND_CODE).astype(np.uint8)
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


@cache
def _looks(shades: tuple[str, ...]) -> list[tuple[str, Style]]:
    """Return character and style of each pair of an upper and a lower code."""
    looks = []
    for above, below in product(range(len(shades)), repeat=2):
        block = " " if above == below else "▀" if above > below else "▄"
        thin, wide = max(above, below), min(above, below)  # the code of the thinner thing is the higher one
        looks.append((block, _style(shades[thin], shades[wide])))
    return looks


@cache
def _style(colour: str, background: str, bold: bool = False) -> Style:
    return Style(color=colour, bgcolor=background, bold=bold)


def heading_tape(yaw_rad: float | None, width: int, colours: Palette = DARK) -> Runs:
    """Draw a compass strip, 3° a character, with the heading in figures at its middle."""
    if yaw_rad is None:
        return Runs([("—".center(width), colours.muted)])
    heading = math.degrees(yaw_rad) % 360
    cells = [" "] * width
    for column in range(width):
        degrees = 3 * (round(heading / 3) + column - width // 2) % 360
        if degrees % 45 == 0:
            label = _COMPASS[degrees]
            cells[column : column + len(label)] = list(label)
        elif degrees % 15 == 0 and cells[column] == " ":
            cells[column] = "·"
    strip = "".join(cells[:width])
    if width < 12:
        start, figures, style = width // 2, strip[width // 2], f"bold reverse {colours.text}"
    else:
        start, figures = width // 2 - 3, f" {round(heading) % 360:03d}° "
        style = f"bold {colours.background} on {colours.accent}"
    left, right = strip[:start], strip[start + len(figures) :]
    return Runs([(left, colours.text), (figures, style), (right, colours.text)])
