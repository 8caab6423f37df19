"""Text, figures and labels on a picture: time, height, speed, rotor speeds, plan items, north arrow and scale.

The labels are drawn on the finished picture: those of MuJoCo have a fixed size and cover the scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from PIL import Image, ImageDraw, ImageFont

from sim_bridge.render.cameras import View, project
from sim_bridge.render.poses import Moment
from sim_bridge.render.renderer import Picture

Font: TypeAlias = ImageFont.FreeTypeFont | ImageFont.ImageFont
Box: TypeAlias = tuple[float, float, float, float]
Colour: TypeAlias = tuple[int, int, int, int]

_INK, _EDGE, _NORTH = (255, 255, 255, 255), (16, 34, 66, 235), (255, 128, 52, 255)
_LETTER_SHARE = 0.030  # letter height of labels over picture height
_LEAST_PX = 11.0
_ABOVE = 1.05  # letter heights from a point to the middle of its label
_LENGTHS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
_BAR_SHARE = 0.055
"""Smallest length of the scale bar over the width of the picture, unless it is 1 m."""

_PANEL = (14, 20, 28, 178)
_TEXT, _FAINT = (244, 246, 248, 255), (176, 188, 200, 255)
_EMPTY = (58, 68, 80, 255)
_SLOW, _FAST = (120, 176, 226), (255, 116, 40)
_LEAST_UNIT = 0.5  # of the sizes for 1280x720; smaller letters are illegible
_LEAST_WIDTH_PX, _LEAST_HEIGHT_PX = 480, 260
"""Smaller pictures get no figures."""
_LONGEST_TITLE = 40


class Overlay:
    """The overlay of one flight; ``largest_rad_s`` are the rotor speeds of full bars."""

    def __init__(
        self,
        title: str,
        largest_rad_s: Sequence[float],
        width: int,
        height: int,
        labels: Sequence[Label] = (),
    ) -> None:
        self._labels = tuple(labels)
        self._title = title if len(title) <= _LONGEST_TITLE else f"{title[: _LONGEST_TITLE - 1]}…"
        self._largest = tuple(largest_rad_s)
        self._unit = max(_LEAST_UNIT, min(width / 1280.0, height / 720.0))
        self._fits = width >= _LEAST_WIDTH_PX and height >= _LEAST_HEIGHT_PX
        self._font = self._sized(20.0)
        self._small = self._sized(15.0)

    def _sized(self, size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
        return ImageFont.load_default(size=max(9.0, size * self._unit))

    def write(
        self, picture: Picture, moment: Moment, view: View | None = None, scale: bool = False
    ) -> Image.Image:
        """Return the picture with the figures of its moment.

        With its ``view`` also the labels and, with ``scale``, north arrow and scale bar.
        """
        image = Image.fromarray(picture)
        layer = Image.new("RGBA", image.size, (0, 0, 0, 0))
        covered = self._panels(ImageDraw.Draw(layer), image.size, moment) if self._fits else []
        if view is not None:
            draw = ImageDraw.Draw(image)
            draw_labels(draw, view, self._labels, image.size, covered)
            if scale and self._fits:
                draw_scale(draw, view, image.size, self._unit)
        return Image.alpha_composite(image.convert("RGBA"), layer).convert("RGB")

    def _panels(self, draw: ImageDraw.ImageDraw, size: tuple[int, int], moment: Moment) -> list[Box]:
        """Draw all panels; return their boxes."""
        return [self._figures(draw, moment), *self._rotors(draw, size, moment)]

    def _figures(self, draw: ImageDraw.ImageDraw, moment: Moment) -> Box:
        u = self._unit
        heading = round(math.degrees(moment.heading_rad)) % 360
        rows = [
            ("time", f"{moment.time_s:.2f} s"),
            ("height", f"{-moment.position_ned_m[2] + 0.0:.2f} m"),
            ("speed", f"{moment.speed_m_s:.2f} m/s"),
            ("heading", f"{heading:03d}°"),
        ]
        if moment.target_ned_m is not None:
            rows.append(("off target", f"{math.dist(moment.position_ned_m, moment.target_ned_m):.3f} m"))
        title_w = draw.textlength(self._title, font=self._font)
        width, line = max(230.0 * u, title_w + 36.0 * u), 26.0 * u
        left, top = 18.0 * u, 18.0 * u
        bottom = top + line * (len(rows) + bool(self._title)) + 22.0 * u
        draw.rounded_rectangle((left, top, left + width, bottom), 8.0 * u, fill=_PANEL)
        y = top + 10.0 * u
        if self._title:
            draw.text((left + 16.0 * u, y), self._title, font=self._font, fill=_TEXT)
            y += line + 2.0 * u
        for name, value in rows:
            draw.text((left + 16.0 * u, y + 3.0 * u), name, font=self._small, fill=_FAINT)
            draw.text((left + width - 16.0 * u, y), value, font=self._font, fill=_TEXT, anchor="ra")
            y += line
        return left, top, left + width, bottom

    def _rotors(self, draw: ImageDraw.ImageDraw, size: tuple[int, int], moment: Moment) -> list[Box]:
        """Draw a bar for each rotor, full at the largest speed."""
        u, count = self._unit, min(len(self._largest), len(moment.rotor_speed_rad_s))
        if not count:
            return []
        width, line = 250.0 * u, 24.0 * u
        right, bottom = size[0] - 18.0 * u, size[1] - 18.0 * u
        left, top = right - width, bottom - line * count - 40.0 * u
        draw.rounded_rectangle((left, top, right, bottom), 8.0 * u, fill=_PANEL)
        draw.text((left + 16.0 * u, top + 9.0 * u), "rotors, rad/s", font=self._small, fill=_FAINT)
        for index in range(count):
            y = top + 32.0 * u + line * index
            speed = moment.rotor_speed_rad_s[index]
            share = min(max(speed / self._largest[index], 0.0), 1.0) if math.isfinite(speed) else 0.0
            colour = tuple(round(a + (b - a) * share) for a, b in zip(_SLOW, _FAST, strict=True))
            begin, end = left + 40.0 * u, right - 64.0 * u
            draw.text((left + 16.0 * u, y), str(index + 1), font=self._small, fill=_FAINT)
            draw.rectangle((begin, y + 6.0 * u, end, y + 14.0 * u), fill=_EMPTY)
            if share > 0.0:
                draw.rectangle(
                    (begin, y + 6.0 * u, begin + share * (end - begin), y + 14.0 * u), fill=(*colour, 255)
                )
            shown = f"{speed:.0f}" if math.isfinite(speed) else "—"
            draw.text((right - 16.0 * u, y), shown, font=self._small, fill=_TEXT, anchor="ra")
        return [(left, top, right, bottom)]


class Label(NamedTuple):
    """A labelled point of the plan: name, and position NWU [m]."""

    name: str
    at_m: tuple[float, float, float]


def draw_labels(
    draw: ImageDraw.ImageDraw,
    view: View,
    labels: Sequence[Label],
    size: tuple[int, int],
    covered: Sequence[Box] = (),
) -> None:
    """Write each label above its point; labels at the same pixel are joined.

    Labels inside the boxes ``covered`` (left, top, right, bottom) are omitted.
    """
    letters = max(_LEAST_PX, _LETTER_SHARE * size[1])
    spots: list[tuple[list[str], float, float]] = []
    for label in labels:
        at = project(view, label.at_m, size)
        if at is None or not _inside(at, (0.0, 0.0, *size)):
            continue
        for names, x, y in spots:
            if math.hypot(at[0] - x, at[1] - y) < letters:
                names.append(label.name)
                break
        else:
            spots.append(([label.name], *at))
    font = ImageFont.load_default(size=letters)
    for names, x, y in spots:
        at = (x, max(0.6 * letters, y - _ABOVE * letters))
        if not any(_inside(at, box) for box in covered):
            write_text(draw, at, ", ".join(dict.fromkeys(names)), font)


def _inside(at: tuple[float, float], box: Box) -> bool:
    return box[0] <= at[0] < box[2] and box[1] <= at[1] < box[3]


def write_text(
    draw: ImageDraw.ImageDraw, at: tuple[float, float], text: str, font: Font, ink: Colour = _INK
) -> None:
    """Write outlined text centred on a point."""
    draw.text(at, text, font=font, fill=ink, anchor="mm", stroke_width=2, stroke_fill=_EDGE)


def draw_scale(draw: ImageDraw.ImageDraw, view: View, size: tuple[int, int], unit: float) -> None:
    """Draw a north arrow and a scale bar, valid at the look-at point, in the lower left corner."""
    font = ImageFont.load_default(size=max(_LEAST_PX, 17.0 * unit))
    reach, left, bottom = 26.0 * unit, 26.0 * unit, size[1] - 26.0 * unit
    turn = math.radians(view.azimuth_deg)
    ahead = (math.sin(turn), -math.cos(turn))  # in the picture: right, down
    aside = (-ahead[1], ahead[0])
    middle = (left + reach, bottom - reach)
    shape = [
        (middle[0] + reach * (a * ahead[0] + b * aside[0]), middle[1] + reach * (a * ahead[1] + b * aside[1]))
        for a, b in ((0.72, 0.0), (-0.72, -0.42), (-0.42, 0.0), (-0.72, 0.42))
    ]
    draw.polygon(shape, fill=_NORTH, outline=_EDGE)
    write_text(
        draw, (middle[0] + 1.15 * reach * ahead[0], middle[1] + 1.15 * reach * ahead[1]), "N", font, _NORTH
    )
    length_m, pixels = scale_bar(view, size)
    begin = middle[0] + 2.2 * reach
    ends = (begin, bottom), (begin + pixels, bottom)
    tick = 5.0 * unit
    for colour, width in ((_EDGE, 3.0), (_INK, 1.4)):
        wide = max(1, round(2.0 * width * unit))
        draw.line(ends, fill=colour, width=wide)
        for x, y in ends:
            draw.line(((x, y - tick), (x, y + tick)), fill=colour, width=wide)
    write_text(draw, (begin + 0.5 * pixels, bottom - 16.0 * unit), f"{length_m:g} m", font)


def scale_bar(view: View, size: tuple[int, int]) -> tuple[float, float]:
    """Return the length of the scale bar [m], 1 m if possible, and in the picture [px]."""
    metre = 1.0 / view.pixel_m(size[1])
    fitting = [length for length in _LENGTHS_M if length * metre >= _BAR_SHARE * size[0]] or [_LENGTHS_M[-1]]
    length = 1.0 if fitting[0] < 1.0 and metre <= 0.3 * size[0] else fitting[0]
    return length, length * metre
