"""Numbers at the planned places, and in a corner where north is and how long a metre: drawn on a finished picture.

MuJoCo's own labels have one size, whatever the picture's, and hide what is behind them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from PIL import ImageDraw, ImageFont

from sim_bridge.render.cameras import View, project

Font: TypeAlias = ImageFont.FreeTypeFont | ImageFont.ImageFont
Box: TypeAlias = tuple[float, float, float, float]
Colour: TypeAlias = tuple[int, int, int, int]

_INK, _EDGE, _NORTH = (255, 255, 255, 255), (16, 34, 66, 235), (255, 128, 52, 255)
_SHARE = 0.030  # of the picture's height: letters of the numbers
_LEAST_PX = 11.0
_ABOVE = 1.05  # letters, from the place to the middle of its number
_LENGTHS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
_BAR_SHARE = 0.055
"""The bar is 1 m long, or the next length that is at least so much of the picture's width."""


class Place(NamedTuple):
    """A planned place: what it is called, and where it is in the scene [m]."""

    name: str
    at_m: tuple[float, float, float]


def draw_numbers(
    draw: ImageDraw.ImageDraw,
    view: View,
    places: Sequence[Place],
    size: tuple[int, int],
    covered: Sequence[Box] = (),
) -> None:
    """Write the name of each place above it; those that fall on one spot share it.

    ``covered`` are boxes (left, top, right, bottom) that something else will be drawn on.
    """
    letters = max(_LEAST_PX, _SHARE * size[1])
    spots: list[tuple[list[str], float, float]] = []
    for place in places:
        seen = project(view, place.at_m, size)
        if seen is None or not _inside(seen, (0.0, 0.0, *size)):
            continue
        for names, x, y in spots:
            if math.hypot(seen[0] - x, seen[1] - y) < letters:
                names.append(place.name)
                break
        else:
            spots.append(([place.name], *seen))
    font = ImageFont.load_default(size=letters)
    for names, x, y in spots:
        at = (x, max(0.6 * letters, y - _ABOVE * letters))
        if not any(_inside(at, box) for box in covered):
            write(draw, at, ", ".join(dict.fromkeys(names)), font)


def _inside(at: tuple[float, float], box: Box) -> bool:
    return box[0] <= at[0] < box[2] and box[1] <= at[1] < box[3]


def write(
    draw: ImageDraw.ImageDraw, at: tuple[float, float], text: str, font: Font, ink: Colour = _INK
) -> None:
    """Write words around a point with an edge that holds on any ground."""
    draw.text(at, text, font=font, fill=ink, anchor="mm", stroke_width=2, stroke_fill=_EDGE)


def draw_scale(draw: ImageDraw.ImageDraw, view: View, size: tuple[int, int], unit: float) -> None:
    """Draw in the lower left corner an arrow to the north and a length, as they are where the camera looks at."""
    font = ImageFont.load_default(size=max(_LEAST_PX, 17.0 * unit))
    reach, left, bottom = 26.0 * unit, 26.0 * unit, size[1] - 26.0 * unit
    turn = math.radians(view.azimuth_deg)
    ahead = (math.sin(turn), -math.cos(turn))  # of the picture: right, down
    aside = (-ahead[1], ahead[0])
    middle = (left + reach, bottom - reach)
    shape = [
        (middle[0] + reach * (a * ahead[0] + b * aside[0]), middle[1] + reach * (a * ahead[1] + b * aside[1]))
        for a, b in ((0.72, 0.0), (-0.72, -0.42), (-0.42, 0.0), (-0.72, 0.42))
    ]
    draw.polygon(shape, fill=_NORTH, outline=_EDGE)
    write(draw, (middle[0] + 1.15 * reach * ahead[0], middle[1] + 1.15 * reach * ahead[1]), "N", font, _NORTH)
    length_m, pixels = bar(view, size)
    begin = middle[0] + 2.2 * reach
    ends = (begin, bottom), (begin + pixels, bottom)
    tick = 5.0 * unit
    for colour, width in ((_EDGE, 3.0), (_INK, 1.4)):
        wide = max(1, round(2.0 * width * unit))
        draw.line(ends, fill=colour, width=wide)
        for x, y in ends:
            draw.line(((x, y - tick), (x, y + tick)), fill=colour, width=wide)
    write(draw, (begin + 0.5 * pixels, bottom - 16.0 * unit), f"{length_m:g} m", font)


def bar(view: View, size: tuple[int, int]) -> tuple[float, float]:
    """Return a length [m] that can be shown, 1 m if possible, and how long it is in the picture [px]."""
    metre = 1.0 / view.pixel_m(size[1])
    fitting = [length for length in _LENGTHS_M if length * metre >= _BAR_SHARE * size[0]] or [_LENGTHS_M[-1]]
    length = 1.0 if fitting[0] < 1.0 and metre <= 0.3 * size[0] else fitting[0]
    return length, length * metre
