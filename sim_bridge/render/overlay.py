"""Words and figures on a picture: what flies, when, how high, how fast, and what its rotors do."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from sim_bridge.render.cameras import View
from sim_bridge.render.labels import Box, Place, draw_numbers, draw_scale
from sim_bridge.render.poses import Moment
from sim_bridge.render.renderer import Picture

_PANEL = (14, 20, 28, 178)
_TEXT, _FAINT = (244, 246, 248, 255), (176, 188, 200, 255)
_EMPTY = (58, 68, 80, 255)
_SLOW, _FAST = (120, 176, 226), (255, 116, 40)
_LEAST_UNIT = 0.5  # of the sizes for 1280x720: smaller letters cannot be read
_LEAST_WIDTH_PX, _LEAST_HEIGHT_PX = 480, 260
"""A picture narrower or lower than this has no room for figures."""
_LONGEST_TITLE = 40


class Overlay:
    """Writes on the pictures of one flight; ``largest_rad_s`` are the speeds of full bars."""

    def __init__(
        self,
        title: str,
        largest_rad_s: Sequence[float],
        width: int,
        height: int,
        places: Sequence[Place] = (),
    ) -> None:
        self._places = tuple(places)
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

        With the view that it was taken from it gets the numbers of the places, and if wanted a scale.
        """
        image = Image.fromarray(picture)
        layer = Image.new("RGBA", image.size, (0, 0, 0, 0))
        covered = self._panels(ImageDraw.Draw(layer), image.size, moment) if self._fits else []
        if view is not None:
            draw = ImageDraw.Draw(image)
            draw_numbers(draw, view, self._places, image.size, covered)
            if scale and self._fits:
                draw_scale(draw, view, image.size, self._unit)
        return Image.alpha_composite(image.convert("RGBA"), layer).convert("RGB")

    def _panels(self, draw: ImageDraw.ImageDraw, size: tuple[int, int], moment: Moment) -> list[Box]:
        """Draw all panels; return where they are."""
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
        """A bar for each rotor, full at the largest speed."""
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
