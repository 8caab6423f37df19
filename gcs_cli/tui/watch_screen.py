"""What all screens share: status line, tabs, body and the footer with the keys that work now."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias, cast

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Container
from textual.events import Click, Resize
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import Footer

from gcs_cli.tui.palette import Palette
from gcs_cli.tui.screens import SCREENS
from gcs_cli.tui.status_line import status_line
from gcs_cli.vehicle.view_types import VehicleView

if TYPE_CHECKING:
    from gcs_cli.tui.app import WatchApp

Draw: TypeAlias = Callable[[VehicleView, float, int, int, Palette], Text]
"""Draws a vehicle's state as of a time [s] in a number of columns and rows."""


class Drawing(Widget):
    """A widget whose content is a pure function of the vehicle's state; drawn again only if it changes."""

    def __init__(self, draw: Draw, title: str = "", *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._draw = draw
        self._content = Text()
        self.border_title = title or None

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw ``view``."""
        width, height = self.content_size
        if width <= 0 or height <= 0:
            return
        content = self._draw(view, now_s, width, height, watch_app(self).palette)
        if content != self._content:
            self._content = content
            self.refresh()

    def on_resize(self, _event: Resize) -> None:
        """Draw in the new size."""
        feed = watch_app(self).feed
        self.show(feed.view, feed.now_s)

    def render(self) -> Text:
        """Return the content."""
        return self._content


class Tabs(Widget):
    """The titles of the screens with their keys; a click opens one."""

    def _labels(self) -> list[str]:
        full = [f" {entry.key} {entry.title} " for entry in SCREENS]
        if sum(map(len, full)) <= self.size.width:
            return full
        mode = self.app.current_mode
        return [
            label if entry.mode == mode else f" {entry.key} "
            for label, entry in zip(full, SCREENS, strict=True)
        ]

    def render(self) -> Text:
        """Return the line of titles."""
        palette = watch_app(self).palette
        text = Text(no_wrap=True, overflow="crop")
        for label, entry in zip(self._labels(), SCREENS, strict=True):
            is_open = entry.mode == self.app.current_mode
            text.append(label, f"bold {palette.background} on {palette.accent}" if is_open else palette.muted)
        return text

    def on_click(self, event: Click) -> None:
        """Open the screen under the mouse."""
        end = 0
        for label, entry in zip(self._labels(), SCREENS, strict=True):
            end += len(label)
            if event.x < end:
                self.app.switch_mode(entry.mode)
                return


class WatchScreen(Screen[None]):
    """A screen of the application. A subclass yields its widgets in ``compose_body``.

    ``show`` is called at most 8 times a second, while the screen is visible.
    """

    HORIZONTAL_BREAKPOINTS = [  # noqa: RUF012  # an instance variable of the base
        (0, "-narrow"),
        (72, "-standard"),
        (110, "-wide"),
        (160, "-very-wide"),
    ]
    VERTICAL_BREAKPOINTS = [  # noqa: RUF012
        (0, "-tiny"),
        (12, "-short"),
        (20, "-medium"),
        (32, "-tall"),
    ]

    def __init__(self, mode: str) -> None:
        super().__init__()
        self.mode = mode

    def compose(self) -> ComposeResult:
        """Yield the frame around the body."""
        yield Drawing(status_line, id="status")
        yield Tabs(id="tabs")
        with Container(id="body"):
            yield from self.compose_body()
        yield Footer(show_command_palette=False)

    def compose_body(self) -> ComposeResult:
        """Yield the widgets of the screen."""
        yield from ()

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw the state of the selected vehicle; by default in each ``Drawing``."""
        for drawing in self.query(Drawing):
            drawing.show(view, now_s)

    def on_screen_resume(self) -> None:
        """Draw the state that arrived while another screen was open."""
        feed = watch_app(self).feed
        self.show(feed.view, feed.now_s)


def watch_app(node: Widget) -> WatchApp:
    """Return the application of a widget."""
    return cast("WatchApp", node.app)
