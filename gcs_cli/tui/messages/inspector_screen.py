"""The screen Inspector: every message on the link, its fields, and requests for other rates."""

from __future__ import annotations

from typing import ClassVar

from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.widgets import Input

from gcs_cli.actions import on_vehicle
from gcs_cli.tui.fly.history import StreamKey
from gcs_cli.tui.messages.inspector_lines import (
    Line,
    MessageRow,
    filtered,
    header,
    lines,
    message_rows,
    summary,
)
from gcs_cli.tui.orders.form import OrderForm
from gcs_cli.tui.orders.orders import Field, Order
from gcs_cli.tui.plot.fields import MOST_FIELDS
from gcs_cli.tui.watch_screen import WatchScreen
from gcs_cli.tui.widgets.drawing import LineWidget, watch_app
from gcs_cli.tui.widgets.line_list import LineList, SearchField
from gcs_cli.vehicle.view_types import VehicleView

_EVERY = 2
"""Drawn in one of so many redraws: faster figures cannot be read."""


class InspectorScreen(WatchScreen):
    """Messages of all sources; Enter shows the fields of one."""

    BINDINGS: ClassVar = [
        Binding("enter", "expand", "Fields"),
        Binding("slash", "search", "Search"),
        Binding("r", "rate", "Rate"),
        Binding("p", "plot", "Plot"),
        Binding("space", "pause", "Pause", show=False),
        Binding("escape", "clear", "Clear search", show=False),
        Binding("up,k", "move(-1)", "Up", show=False),
        Binding("down,j", "move(1)", "Down", show=False),
        Binding("pageup", "move_page(-1)", "Page up", show=False),
        Binding("pagedown", "move_page(1)", "Page down", show=False),
        Binding("home", "move(-100000)", "First", show=False),
        Binding("end", "move(100000)", "Last", show=False),
    ]

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        self._rows: list[MessageRow] = []
        self.lines_shown: list[Line] = []
        self._expanded: frozenset[StreamKey] = frozenset()
        self._words = ""
        self._is_paused = False

    def compose_body(self) -> ComposeResult:
        """Yield the summary, the titles, the list and the search field."""
        yield LineWidget(id="summary")
        yield LineWidget(id="header")
        yield LineList(id="messages")
        yield SearchField("words of a message, field or source", id="search")

    @property
    def line_list(self) -> LineList:
        """The list of messages."""
        return self.query_one(LineList)

    @property
    def selected(self) -> Line | None:
        """The line at the cursor."""
        return (
            self.lines_shown[self.line_list.cursor] if self.line_list.cursor < len(self.lines_shown) else None
        )

    def show(self, view: VehicleView, now_s: float) -> None:
        """Read the messages, unless paused."""
        super().show(view, now_s)
        if not self._is_paused and watch_app(self).redraws % _EVERY == 0:
            self._rows = message_rows(watch_app(self).feed.history, now_s)
            self._redraw()

    def _redraw(self) -> None:
        app, width = watch_app(self), self.line_list.size.width - self.line_list.scrollbar_size_vertical
        rows = filtered(self._rows, self._words)
        self.lines_shown = lines(rows, self._expanded, app.plot_fields.names, max(20, width), app.palette)
        self.line_list.set_lines(
            [line.key for line in self.lines_shown], [line.text for line in self.lines_shown]
        )
        state = summary(self._rows, len(rows), self._words, self._is_paused, app.palette)
        self.query_one("#summary", LineWidget).show_line(state)
        self.query_one("#header", LineWidget).show_line(header(max(20, width), app.palette))

    def on_resize(self) -> None:
        """Draw in the new size."""
        self.call_after_refresh(self._redraw)

    def action_move(self, steps: int) -> None:
        """Move the cursor."""
        self.line_list.move(steps)

    def action_move_page(self, pages: int) -> None:
        """Move the cursor by the height of the list."""
        self.line_list.move(pages * self.line_list.page)

    def action_expand(self) -> None:
        """Show or hide the fields of the message at the cursor."""
        line = self.selected
        if line is not None:
            self._expanded ^= {line.row.key}
            self._redraw()

    def on_line_list_chosen(self) -> None:
        """Show or hide the fields of a message that was clicked."""
        if self.selected is not None and self.selected.field is None:
            self.action_expand()

    def action_pause(self) -> None:
        """Stop or continue; the fields of a paused message can be opened."""
        self._is_paused = not self._is_paused
        self._redraw()

    def action_plot(self) -> None:
        """Add the field at the cursor to the plot, or remove it."""
        line = self.selected
        if line is None or line.plot_name is None:
            self.notify("select a numeric field: Enter shows the fields of a message", severity="warning")
            return
        fields = watch_app(self).plot_fields
        if fields.colour(line.plot_name):
            fields.remove(line.plot_name)
            self.notify(f"{line.plot_name} is no longer plotted")
        elif fields.add(line.plot_name):
            self.notify(f"{line.plot_name} is plotted on screen 4")
        else:
            self.notify(f"at most {MOST_FIELDS} fields are plotted: remove one first", severity="warning")
        self._redraw()

    @work(exclusive=True, group="order")
    async def action_rate(self) -> None:
        """Ask for another rate of the message at the cursor, and request it."""
        line = self.selected
        app = watch_app(self)
        identity = app.feed.view.identity
        if line is None or identity is None:
            return
        if line.row.key.system_id != identity.system_id:
            self.notify(f"select vehicle {line.row.key.system_id} first: v", severity="warning")
            return
        number, name = line.row.key.message_id, line.row.message.get_type()
        order = Order(
            "rate",
            "r",
            f"Rate of {name}",
            "0 stops it, empty: the default",
            lambda rate: on_vehicle.set_message_rate(number, name, rate),
            (Field("rate", "Hz", smallest=0.0, largest=1000.0, is_optional=lambda _view: True),),
        )
        values = await self.app.push_screen_wait(OrderForm(order, app.feed.view))
        if values is not None:
            app.feed.keep_rate(number, values[0])
            app.feed.act(order.make(*values), identity.system_id)

    def action_search(self) -> None:
        """Open the search field."""
        self.query_one(SearchField).open()

    def action_clear(self) -> None:
        """Close the search field and show all messages."""
        self.query_one(SearchField).close()
        self.set_focus(None)

    @on(Input.Changed, "#search")
    def _searched(self, event: Input.Changed) -> None:
        self._words = event.value
        self._redraw()

    @on(Input.Submitted, "#search")
    def _search_ended(self) -> None:
        self.set_focus(None)
