"""The screen Plot: telemetry fields over time."""

from __future__ import annotations

import math
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.events import Leave, MouseMove, MouseScrollDown, MouseScrollUp, Resize

from gcs_cli.charts.canvas import Canvas
from gcs_cli.tui.plot.drawing import Curve, Span, cell_time, draw_plot, gutter_of
from gcs_cli.tui.plot.field_picker import Choice, FieldPicker
from gcs_cli.tui.plot.fields import MOST_FIELDS, PlotFields, field_choices
from gcs_cli.tui.watch_screen import WatchScreen
from gcs_cli.tui.widgets.drawing import CanvasWidget, watch_app
from gcs_cli.vehicle.view_types import VehicleView

_SPANS_S = (5.0, 10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0)

_EVERY = 2
"""Drawn in one of so many redraws, and at once when the user moves the cursor."""

_LONGEST_STEP_S = 1.0


class PlotWidget(CanvasWidget):
    """The curves; the mouse moves the cursor, the wheel changes the time span."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.curves: list[Curve] = []
        self.end_s = 0.0
        self.span_index = _SPANS_S.index(60.0)
        self.cursor_column: int | None = None

    @property
    def span(self) -> Span:
        """The visible time and the cursor."""
        span = Span(self.end_s - _SPANS_S[self.span_index], self.end_s)
        if self.cursor_column is None:
            return span
        gutter = gutter_of(self.curves, span, self.size.height)
        return span._replace(cursor_s=cell_time(self.cursor_column, span, gutter, self.size.width))

    def step_end(self, now_s: float) -> float:
        """Return the last whole step of the time axis: curves move by whole cells, so that they do not flicker."""
        step_s = min(_LONGEST_STEP_S, _SPANS_S[self.span_index] / max(1, self.size.width))
        return math.ceil(now_s / step_s) * step_s

    def redraw(self) -> None:
        """Draw the curves."""
        colours = watch_app(self).palette
        if self.curves:
            canvas = draw_plot(self.curves, self.span, self.size.width, self.size.height, colours)
        else:
            canvas = Canvas(self.size.width, self.size.height)
            canvas.label(2, 1, "nothing is plotted: press Enter to add fields", colours.muted)
        self.draw(canvas)

    def zoom(self, steps: int) -> None:
        """Show a longer (positive) or shorter time."""
        self.span_index = max(0, min(len(_SPANS_S) - 1, self.span_index + steps))
        self.redraw()

    def move_cursor(self, columns: int) -> None:
        """Move the cursor; it starts at the right edge."""
        start = self.size.width - 1 if self.cursor_column is None else self.cursor_column
        self.cursor_column = max(0, min(self.size.width - 1, start + columns))
        self.redraw()

    def hide_cursor(self) -> None:
        """Show the newest values."""
        self.cursor_column = None
        self.redraw()

    def on_resize(self, _event: Resize) -> None:
        """Draw in the new size."""
        self.hide_cursor()

    def on_mouse_move(self, event: MouseMove) -> None:
        """Move the cursor."""
        self.cursor_column = event.x
        self.redraw()

    def on_leave(self, _event: Leave) -> None:
        """Hide the cursor."""
        self.hide_cursor()

    def on_mouse_scroll_up(self, event: MouseScrollUp) -> None:
        """Show a shorter time."""
        event.stop()
        self.zoom(-1)

    def on_mouse_scroll_down(self, event: MouseScrollDown) -> None:
        """Show a longer time."""
        event.stop()
        self.zoom(1)


class PlotScreen(WatchScreen):
    """Curves of the selected vehicle; a pause keeps the samples while others arrive."""

    BINDINGS: ClassVar = [
        Binding("enter", "pick", "Fields"),
        Binding("space", "pause", "Pause"),
        Binding("plus,equals_sign", "zoom(-1)", "Zoom", key_display="+ -"),
        Binding("minus", "zoom(1)", "Longer time", show=False),
        Binding("left", "cursor(-1)", "Cursor", key_display="← →"),
        Binding("right", "cursor(1)", "Cursor right", show=False),
        Binding("shift+left", "cursor(-10)", "Cursor far left", show=False),
        Binding("shift+right", "cursor(10)", "Cursor far right", show=False),
        Binding("escape", "hide_cursor", "Hide cursor", show=False),
        Binding("c", "clear", "Clear", show=False),
    ]

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        self._is_paused = False

    def compose_body(self) -> ComposeResult:
        """Yield the plot."""
        yield PlotWidget(id="plot")

    @property
    def plot(self) -> PlotWidget:
        """The plot."""
        return self.query_one(PlotWidget)

    @property
    def fields(self) -> PlotFields:
        """The plotted fields."""
        return watch_app(self).plot_fields

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw the curves up to now, unless paused."""
        super().show(view, now_s)
        if self._is_paused or watch_app(self).redraws % _EVERY:
            return
        if self.plot.step_end(now_s) > self.plot.end_s or watch_app(self).redraws == 0:
            self._load()

    def _load(self) -> None:
        feed = watch_app(self).feed
        identity = feed.view.identity
        if not self._is_paused:
            self.plot.end_s = max(self.plot.end_s, self.plot.step_end(feed.now_s))
        self.plot.curves = self.fields.curves(feed.history, None if identity is None else identity.system_id)
        self.plot.redraw()

    def action_pause(self) -> None:
        """Stop or continue."""
        self._is_paused = not self._is_paused
        self.sub_title = "paused" if self._is_paused else ""
        self._load()
        self.notify("paused: the space bar continues" if self._is_paused else "live")

    def action_zoom(self, steps: int) -> None:
        """Change the time span."""
        self.plot.zoom(steps)

    def action_cursor(self, columns: int) -> None:
        """Move the cursor."""
        self.plot.move_cursor(columns)

    def action_hide_cursor(self) -> None:
        """Show the newest values."""
        self.plot.hide_cursor()

    def action_clear(self) -> None:
        """Remove all curves."""
        self.fields.clear()
        self._load()

    def action_pick(self) -> None:
        """Open the list of fields."""
        self.app.push_screen(FieldPicker("Plot", self._choices, self.toggle))

    def _choices(self) -> list[Choice]:
        feed = watch_app(self).feed
        identity = feed.view.identity
        return field_choices(feed.history, None if identity is None else identity.system_id, self.fields)

    def toggle(self, name: str) -> str | None:
        """Plot a field, or remove it from the plot; return why it cannot be added, or None."""
        reason = None
        if self.fields.colour(name):
            self.fields.remove(name)
        elif not self.fields.add(name):
            reason = f"at most {MOST_FIELDS} fields are plotted: remove one first"
        self._load()
        return reason
