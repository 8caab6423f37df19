"""A widget that shows lines drawn by a pure function of the vehicle's state."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import zip_longest
from typing import TYPE_CHECKING, TypeAlias, cast

from rich.segment import Segment
from rich.style import Style
from rich.text import Text
from textual.events import Resize
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from gcs_cli.tui.palette import Palette
from gcs_cli.vehicle.view_types import VehicleView

if TYPE_CHECKING:
    from gcs_cli.tui.app import WatchApp

Draw: TypeAlias = Callable[[VehicleView, float, int, int, Palette], list[Text]]
"""Draws a vehicle's state as of a time [s] in a number of columns and rows."""


class Drawing(Widget):
    """Shows the lines of ``draw``; a line is sent to the terminal only if it changed.

    ``every``: draw in one of so many redraws of the screen; figures that change faster cannot be read.
    """

    ALLOW_SELECT = False

    def __init__(self, draw: Draw, title: str = "", *, every: int = 2, id: str | None = None) -> None:
        super().__init__(id=id)
        self.every = every
        self._draw = draw
        self._lines: list[Text] = []
        self._strips: list[Strip] = []
        self.border_title = title or None

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw ``view``."""
        width, height = self.content_size
        if width <= 0 or height <= 0:
            return
        lines = self._draw(view, now_s, width, height, watch_app(self).palette)
        strips = []
        changed = []
        for y, (new, old) in enumerate(zip_longest(lines, self._lines)):
            if new is not None and new == old and self._strips[y].cell_length == width:
                strips.append(self._strips[y])
                continue
            changed.append(Region(0, y, width, 1))
            if new is not None:
                strips.append(strip_of(new).adjust_cell_length(width))
        self._lines, self._strips = lines, strips
        if changed:
            self.refresh(*changed)

    def on_resize(self, _event: Resize) -> None:
        """Draw in the new size."""
        feed = watch_app(self).feed
        self.show(feed.view, feed.now_s)

    def render_line(self, y: int) -> Strip:
        """Return a line of the content."""
        return self._strips[y] if y < len(self._strips) else Strip.blank(self.content_size.width)


def strip_of(line: Text) -> Strip:
    """Return the segments of a line, whose spans are in order and do not overlap, as ``append`` makes them."""
    plain, base = line.plain, style_of(line.style)
    segments, at = [], 0
    for start, end, style in line.spans:
        if start > at:
            segments.append(Segment(plain[at:start], base))
        segments.append(Segment(plain[max(at, start) : end], base + style_of(style)))
        at = max(at, end)
    if at < len(plain):
        segments.append(Segment(plain[at:], base))
    return Strip([segment for segment in segments if segment.text])


@cache
def style_of(style: str | Style) -> Style:
    """Return rich's style of a description such as ``bold red``."""
    return Style.parse(style) if isinstance(style, str) else style


def watch_app(node: Widget) -> WatchApp:
    """Return the application of a widget."""
    return cast("WatchApp", node.app)
