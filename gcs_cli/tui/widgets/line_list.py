"""A list of lines, and the field at the foot of a screen that searches it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import zip_longest

from rich.segment import Segment
from rich.style import Style
from rich.text import Text
from textual.events import Click
from textual.filter import LineFilter
from textual.geometry import Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widgets import Input

from gcs_cli.tui.widgets.drawing import palette_filters, strip_of, watch_app


class LineList(ScrollView):
    """Shows lines by key; the cursor stays at its key while lines change."""

    ALLOW_SELECT = False
    DEFAULT_CSS = "LineList { height: 1fr; overflow-x: hidden; }"

    class Chosen(Message):
        """The user clicked the line at the cursor."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._keys: list[Hashable] = []
        self._texts: list[Text] = []
        self.cursor = 0

    def set_lines(self, keys: Sequence[Hashable], texts: Sequence[Text]) -> None:
        """Show ``texts``."""
        former, cursor = self._texts, self.cursor
        selected = self._keys[cursor] if cursor < len(self._keys) else None
        self._keys, self._texts = list(keys), list(texts)
        if selected in self._keys:
            self.cursor = self._keys.index(selected)
        self.cursor = max(0, min(self.cursor, len(self._keys) - 1))
        self.virtual_size = Size(self.size.width, len(self._texts))
        for index, (old, new) in enumerate(zip_longest(former, texts)):
            if old != new or (self.cursor != cursor and index in (self.cursor, cursor)):
                self.refresh_line(index)

    def move(self, steps: int) -> None:
        """Move the cursor, and scroll so that it is visible."""
        self.cursor = max(0, min(len(self._keys) - 1, self.cursor + steps))
        height, top = self.scrollable_content_region.height, round(self.scroll_y)
        if self.cursor < top:
            self.scroll_to(y=self.cursor, animate=False)
        elif self.cursor >= top + height:
            self.scroll_to(y=self.cursor - height + 1, animate=False)
        self.refresh()

    @property
    def page(self) -> int:
        """Lines that are visible at once."""
        return max(1, self.scrollable_content_region.height)

    def on_click(self, event: Click) -> None:
        """Move the cursor to the mouse."""
        index = round(self.scroll_y) + event.y
        if index < len(self._keys):
            self.cursor = index
            self.refresh()
            self.post_message(self.Chosen())

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return the filters that the colours of the palette need."""
        return palette_filters(super().get_line_filters())

    def render_line(self, y: int) -> Strip:
        """Return a visible line."""
        index, width = round(self.scroll_y) + y, self.scrollable_content_region.width
        style = self.rich_style
        if index >= len(self._texts):
            return Strip.blank(width, style)
        if index == self.cursor:
            colours = watch_app(self).palette
            cursor = Style(color=colours.background, bgcolor=colours.accent)
            return Strip([Segment(self._texts[index].plain, cursor)]).adjust_cell_length(width, cursor)
        return strip_of(self._texts[index], style).adjust_cell_length(width, style)


class SearchField(Input):
    """An input that its screen opens and closes."""

    DEFAULT_CSS = "SearchField { dock: bottom; height: 1; }"

    def __init__(self, placeholder: str, *, id: str) -> None:
        super().__init__(placeholder=placeholder, id=id, compact=True)
        self.display = False

    def open(self) -> None:
        """Show the field, and type into it."""
        self.display = True
        self.screen.set_focus(self)

    def close(self) -> None:
        """Clear and hide the field."""
        self.value = ""
        self.display = False
