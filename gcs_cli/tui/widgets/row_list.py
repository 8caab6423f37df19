"""A list of rows with a cursor, which draws only the rows on the screen; and the layout of rows in columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple, TypeAlias

from rich.text import Text
from textual.binding import Binding
from textual.events import Click, Resize
from textual.filter import LineFilter
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

from gcs_cli.tui.widgets.drawing import palette_filters, strip_of, watch_app

_GAP = 1


class Column(NamedTuple):
    """A column of a table: title, width in cells, and alignment."""

    title: str
    width: int
    is_right: bool = False


class Cell(NamedTuple):
    """A text and its style."""

    text: str
    style: str = ""


DrawRow: TypeAlias = Callable[[int, int], Text]
"""Draws the row of an index in a width."""


def row_text(columns: Sequence[Column], cells: Sequence[Cell]) -> Text:
    """Return cells in columns; a text that is too long ends with an ellipsis."""
    line = Text(no_wrap=True, end="")
    for column, cell in zip(columns, cells, strict=True):
        text = cell.text
        if len(text) > column.width:
            text = text[: max(0, column.width - 1)] + "…"
        line.append(text.rjust(column.width) if column.is_right else text.ljust(column.width), cell.style)
        line.append(" " * _GAP)
    return line


def title_text(columns: Sequence[Column], style: str) -> Text:
    """Return the titles of columns."""
    return row_text(columns, [Cell(column.title, style) for column in columns])


def stretched(columns: Sequence[Column], width: int, index: int) -> list[Column]:
    """Return columns whose column ``index`` takes the rest of ``width``."""
    rest = width - sum(column.width + _GAP for column in columns)
    return [
        column._replace(width=max(1, column.width + rest)) if number == index else column
        for number, column in enumerate(columns)
    ]


class RowList(ScrollView, can_focus=True):
    """Shows ``count`` rows by a function; the arrow keys, the wheel and a click move the cursor."""

    DEFAULT_CSS = """
    RowList { height: 1fr; background: $background; scrollbar-size-vertical: 1; overflow-x: hidden;
              overflow-y: scroll; }
    """
    ALLOW_SELECT = False
    BINDINGS: ClassVar = [
        Binding("up", "move(-1)", "Up", show=False),
        Binding("down", "move(1)", "Down", show=False),
        Binding("pageup", "page(-1)", "Page up", show=False),
        Binding("pagedown", "page(1)", "Page down", show=False),
        Binding("home", "select(0)", "First", show=False),
        Binding("end", "select(-1)", "Last", show=False),
    ]

    class Selected(Message):
        """Another row was selected."""

    class Chosen(Message):
        """The selected row was clicked again."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.cursor = 0
        self.count = 0
        self._draw: DrawRow | None = None
        self._texts: dict[int, Text] = {}
        """The rows that were drawn, by index."""

    @property
    def is_lit(self) -> bool:
        """True if the cursor is drawn in the accent's colour."""
        return self.has_focus

    def show_rows(self, count: int, draw: DrawRow) -> None:
        """Show the rows 0 to ``count`` - 1; the cursor keeps its row."""
        self._draw = draw
        first, width = self.scroll_offset.y, self.size.width
        if count != self.count:
            self.count = count
            self.virtual_size = Size(width, count)
            self.refresh()
        self.cursor = max(0, min(self.cursor, count - 1))
        visible = range(first, min(count, first + self.size.height))
        texts = {index: draw(index, width) for index in visible}
        for index, text in texts.items():
            if text != self._texts.get(index):
                self.refresh_line(index)
        self._texts = texts

    def select(self, index: int) -> None:
        """Move the cursor to a row, and scroll to it."""
        index = max(0, min(index, self.count - 1))
        if index != self.cursor:
            self.cursor = index
            self.post_message(self.Selected())
        self.scroll_to_region(Region(0, index, 1, 1), animate=False, force=True)
        self.refresh()

    def on_resize(self, _event: Resize) -> None:
        """Keep the cursor on the screen."""
        self._texts.clear()
        self.virtual_size = Size(self.size.width, self.count)
        self.scroll_to_region(Region(0, self.cursor, 1, 1), animate=False, force=True)

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return the filters that the colours of the palette need."""
        return palette_filters(super().get_line_filters())

    def notify_style_update(self) -> None:
        """Draw the rows in the colours of another theme."""
        self._texts.clear()
        super().notify_style_update()

    def render_line(self, y: int) -> Strip:
        """Return a line of the content."""
        index, width = self.scroll_offset.y + y, self.size.width
        base = self.rich_style
        if self._draw is None or index >= self.count:
            return Strip.blank(width, base)
        row = self._texts.get(index)
        if row is None:
            row = self._texts[index] = self._draw(index, width)
        if index == self.cursor:
            colours = watch_app(self).palette
            if self.is_lit:
                chosen = f"bold {colours.background} on {colours.accent}"
                return strip_of(Text(row.plain.ljust(width), chosen), base).crop(0, width)
            row = row.copy()
            row.stylize(f"on {colours.surface}")
        return strip_of(row, base).adjust_cell_length(width, base)

    def on_click(self, event: Click) -> None:
        """Select the row under the mouse; a second click chooses it."""
        index = self.scroll_offset.y + event.y
        if index >= self.count:
            return
        if index == self.cursor and event.chain == 2:
            self.post_message(self.Chosen())
        self.select(index)

    def action_move(self, rows: int) -> None:
        """Move the cursor."""
        self.select(self.cursor + rows)

    def action_page(self, pages: int) -> None:
        """Move the cursor by the visible rows."""
        self.select(self.cursor + pages * max(1, self.size.height - 1))

    def action_select(self, index: int) -> None:
        """Select a row; -1 is the last."""
        self.select(self.count - 1 if index < 0 else index)
