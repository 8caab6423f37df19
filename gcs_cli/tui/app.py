"""The application of ``gcs watch``: screens by key, redrawing, and the thread of the link."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, ClassVar

from textual.app import App, SystemCommand
from textual.binding import Binding
from textual.screen import Screen

from gcs_cli.tui.feed import Feed
from gcs_cli.tui.palette import Palette, palette_of
from gcs_cli.tui.screens import SCREENS
from gcs_cli.tui.themes import THEMES
from gcs_cli.tui.watch_screen import WatchScreen

REDRAWS_HZ = 8.0


class WatchApp(App[None]):
    """Shows the vehicle of ``feed`` until the user quits."""

    TITLE = "gcs watch"
    CSS_PATH = "watch.tcss"
    MODES: ClassVar[dict[str, str | Callable[[], Screen[Any]]]] = {
        entry.mode: entry.load for entry in SCREENS
    }
    DEFAULT_MODE = SCREENS[0].mode
    AUTO_FOCUS = None
    BINDINGS: ClassVar = [
        *(
            Binding(entry.key, f"app.switch_mode('{entry.mode}')", entry.title, show=False)
            for entry in SCREENS
        ),
        Binding("ctrl+p", "command_palette", "Commands", priority=True),
        Binding("q", "quit", "Quit"),
    ]

    def __init__(self, feed: Feed) -> None:
        super().__init__()
        self.feed = feed
        self.redraws = 0
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = THEMES[0].name
        self._palette: tuple[str, Palette] | None = None

    @property
    def palette(self) -> Palette:
        """Colours of the current theme."""
        if self._palette is None or self._palette[0] != self.theme:
            colours = palette_of(self.theme_variables, self.current_theme.dark)
            self._palette = (self.theme, colours)
        return self._palette[1]

    def on_mount(self) -> None:
        """Start the link and the redrawing."""
        self.feed.start()
        self.set_interval(1 / REDRAWS_HZ, self.redraw)

    def on_unmount(self) -> None:
        """End the thread of the link."""
        self.feed.stop()

    def redraw(self) -> None:
        """Draw the newest state on the visible screen; raise the error that ended the link."""
        if self.feed.error is not None:
            raise self.feed.error
        screen = self.screen_stack[0]
        if isinstance(screen, WatchScreen):
            screen.show(self.feed.view, self.feed.now_s)
            self.redraws += 1

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """Yield the entries of the command palette."""
        for entry in SCREENS:
            yield SystemCommand(
                f"Show {entry.title}", f"{entry.summary} ({entry.key})", lambda m=entry.mode: self._open(m)
            )
        yield from super().get_system_commands(screen)

    def _open(self, mode: str) -> None:
        self.switch_mode(mode)
