"""A widget that shows rows of segments, such as those of a canvas."""

from __future__ import annotations

from collections.abc import Sequence

from rich.segment import Segment
from textual.strip import Strip
from textual.widget import Widget


class CanvasWidget(Widget):
    """Shows the rows given to ``draw``; only rows that changed are drawn again."""

    DEFAULT_CSS = "CanvasWidget { width: 1fr; height: 1fr; }"

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._strips: list[Strip] = []

    def draw(self, rows: Sequence[Sequence[Segment]]) -> None:
        """Show ``rows``, from the top."""
        strips = [Strip(row) for row in rows]
        if strips != self._strips:
            self._strips = strips
            self.refresh()

    def render_line(self, y: int) -> Strip:
        """Return a row."""
        strip = self._strips[y] if y < len(self._strips) else Strip([])
        return strip.adjust_cell_length(self.content_size.width).apply_style(self.rich_style)
