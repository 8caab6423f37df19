"""The screen Messages: status texts and results of actions, by severity, with a search."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.widgets import Input, RichLog

from flightstack.core.enums import Severity
from gcs_cli.tui.fly.panels import message_lines
from gcs_cli.tui.messages.message_log import ENTRIES_KEPT, Entry, selected
from gcs_cli.tui.palette import Palette
from gcs_cli.tui.watch_screen import WatchScreen
from gcs_cli.tui.widgets.drawing import LineWidget, watch_app
from gcs_cli.tui.widgets.line_list import SearchField
from gcs_cli.vehicle.view_types import VehicleView

LEVELS = (
    (Severity.DEBUG, "all"),
    (Severity.INFO, "info and worse"),
    (Severity.WARNING, "warnings and worse"),
    (Severity.ERROR, "errors and worse"),
)


class MessagesScreen(WatchScreen):
    """Newest at the bottom; the list follows new lines while its end is visible."""

    BINDINGS: ClassVar = [
        Binding("s", "next_level", "Severity"),
        Binding("slash", "search", "Search"),
        Binding("escape", "clear", "Clear search"),
        Binding("end", "end", "Newest", show=False),
    ]

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        self._level = 0
        self._words = ""
        self._written = 0

    def compose_body(self) -> ComposeResult:
        """Yield the filter's state, the list, and the search field."""
        yield LineWidget(id="filter")
        yield RichLog(id="texts", wrap=False, max_lines=ENTRIES_KEPT, auto_scroll=False, markup=False)
        yield SearchField("words to search", id="search")

    def show(self, view: VehicleView, now_s: float) -> None:
        """Append the new lines."""
        super().show(view, now_s)
        log = watch_app(self).feed.messages
        if log.count != self._written:
            self._append(log.since(self._written))
            self._written = log.count
            self._show_filter()

    def _append(self, entries: list[Entry]) -> None:
        texts = self.query_one("#texts", RichLog)
        follows = texts.is_vertical_scroll_end
        app = watch_app(self)
        several = len(app.feed.views) > 1
        for entry in selected(entries, LEVELS[self._level][0], self._words):
            for line in _lines(entry, self._words, several, texts.size.width or 80, app.palette):
                texts.write(line, scroll_end=follows)

    def _rewrite(self) -> None:
        self.query_one("#texts", RichLog).clear()
        self._written = 0
        feed = watch_app(self).feed
        self._show_filter()
        self.show(feed.view, feed.now_s)

    def _show_filter(self) -> None:
        entries = watch_app(self).feed.messages.since(0)
        shown = len(selected(entries, LEVELS[self._level][0], self._words))
        text = (
            f"{LEVELS[self._level][1]}: {shown or 'none'} of {len(entries)}" if entries else "no messages yet"
        )
        if self._words:
            text += f", with “{self._words}”"
        self.query_one("#filter", LineWidget).show_line(Text(text))

    def recolour(self) -> None:
        """Write the lines again."""
        self._rewrite()

    def on_resize(self) -> None:
        """Wrap the lines anew."""
        self.call_after_refresh(self._rewrite)

    def action_next_level(self) -> None:
        """Select the next severity."""
        self._level = (self._level + 1) % len(LEVELS)
        self._rewrite()

    def action_search(self) -> None:
        """Open the search field."""
        self.query_one(SearchField).open()

    def action_clear(self) -> None:
        """Close the search field and show all lines."""
        self.query_one(SearchField).close()
        self.set_focus(self.query_one("#texts"))

    def action_end(self) -> None:
        """Scroll to the newest line."""
        self.query_one("#texts", RichLog).scroll_end(animate=False)

    @on(Input.Changed, "#search")
    def _searched(self, event: Input.Changed) -> None:
        self._words = event.value
        self._rewrite()

    @on(Input.Submitted, "#search")
    def _chosen(self) -> None:
        self.set_focus(self.query_one("#texts"))


def _lines(entry: Entry, words: str, several: bool, width: int, colours: Palette) -> list[Text]:
    text = entry.text if not several else f"{entry.system_id}: {entry.text}"
    lines = message_lines(entry.status_text._replace(text=text), width - 1, colours)
    for line in lines:
        if entry.is_own:
            line.stylize(f"italic {colours.accent}", 14)
        for word in words.split():
            line.highlight_words(
                [word], f"bold {colours.background} on {colours.warning}", case_sensitive=False
            )
    return lines
