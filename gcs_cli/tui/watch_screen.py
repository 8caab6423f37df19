"""Common parts of all screens: status line, tabs, body and the footer with the keys that work now."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, TypeVar

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Container
from textual.events import Click
from textual.screen import ModalScreen, Screen

from gcs_cli.tui.key_bar import KeyBar
from gcs_cli.tui.palette import Palette
from gcs_cli.tui.screens import SCREENS
from gcs_cli.tui.status_line import status_line
from gcs_cli.tui.widgets.drawing import Drawing, KeepsLines, watch_app
from gcs_cli.vehicle.view_types import VehicleView


class Tabs(KeepsLines):
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


class Body(KeepsLines, Container):
    """The part of the screen between the tabs and the foot."""


R = TypeVar("R")


class LiveDialog(ModalScreen[R]):
    """A dialog that shows what the vehicles send. The screen below it is drawn less often."""

    @abstractmethod
    def follow(self) -> None:
        """Show the state of now; called in each redraw."""


class WatchScreen(KeepsLines, Screen[None]):
    """A screen of the application. A subclass yields its widgets in ``compose_body``.

    ``show`` is called at most five times a second, while the screen is visible and composed.
    """

    DRAWN: ClassVar = "#body > *"
    """Selector of a widget that exists once the screen is composed."""

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
        self._is_composed = False
        self._drawings: list[Drawing] = []

    def on_mount(self) -> None:
        """Find the drawings once: all widgets are mounted now, and stay."""
        self._drawings = list(self.query(Drawing))
        self.app.theme_changed_signal.subscribe(self, lambda _theme: self.call_after_refresh(self.recolour))

    def recolour(self) -> None:
        """Draw anew, in the colours of another theme, what ``show`` draws only after a change; by default nothing."""

    def compose(self) -> ComposeResult:
        """Yield the frame around the body."""
        yield Drawing(self._status, every=1, id="status")
        yield Tabs(id="tabs")
        with Body(id="body"):
            yield from self.compose_body()
        yield KeyBar()

    def _status(
        self, view: VehicleView, now_s: float, width: int, height: int, colours: Palette
    ) -> list[Text]:
        feed = watch_app(self).feed
        vehicles = len(feed.views)
        return status_line(
            view, now_s, width, height, colours, vehicles=vehicles, commands_all=feed.commands_all
        )

    def compose_body(self) -> ComposeResult:
        """Yield the widgets of the screen."""
        yield from ()

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw the state of the selected vehicle; by default in each ``Drawing``."""
        redraw = watch_app(self).redraws
        for drawing in self._drawings or self.query(Drawing):
            if redraw % drawing.every == 0:
                drawing.show(view, now_s)

    @property
    def is_composed(self) -> bool:
        """True if the widgets of the body exist; a screen is resumed and redrawn before."""
        self._is_composed = self._is_composed or bool(self.query(self.DRAWN))
        return self._is_composed

    def on_screen_resume(self) -> None:
        """Draw the state that arrived while another screen was open."""
        app = watch_app(self)
        app.redraws = 0
        if self.is_composed:
            self.show(app.feed.view, app.feed.now_s)
