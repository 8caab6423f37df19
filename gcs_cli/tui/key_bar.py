"""The line at the foot of each screen: the keys that work now."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rich.text import Text
from textual.events import Click
from textual.screen import Screen

from gcs_cli.tui.palette import Palette
from gcs_cli.tui.widgets.drawing import KeepsLines, watch_app

_MORE = " …"


class ShownKey(NamedTuple):
    """A key as it is shown; ``is_own`` if it belongs to the screen, not to all."""

    key: str
    display: str
    title: str
    is_own: bool

    @property
    def width(self) -> int:
        """Cells that it takes."""
        return len(self.display) + len(self.title) + 3


def fitting(keys: Sequence[ShownKey], width: int) -> list[tuple[str, ShownKey]]:
    """Return the keys that ``width`` holds, each with the mark before it of keys left out.

    They are the keys of all screens, and before them the first ones of this screen.
    """
    common = [key for key in keys if not key.is_own]
    room = width - sum(key.width for key in common)
    own = [key for key in keys if key.is_own]
    if sum(key.width for key in own) > room:
        room -= len(_MORE)
        while own and sum(key.width for key in own) > room:
            own.pop()
    shown = own + common
    is_cut = len(shown) < len(keys)
    return [(_MORE if is_cut and place == len(own) else "", key) for place, key in enumerate(shown)]


class KeyBar(KeepsLines):
    """One line: Textual's footer makes a widget of each key anew whenever another key works."""

    DEFAULT_CSS = "KeyBar { dock: bottom; height: 1; width: 100%; background: $surface; }"
    ALLOW_SELECT = False

    def __init__(self) -> None:
        super().__init__()
        self._keys: tuple[ShownKey, ...] = ()

    def on_mount(self) -> None:
        """Follow the keys of the screen."""
        self.screen.bindings_updated_signal.subscribe(self, self._update)
        self._update(self.screen)

    def _update(self, screen: Screen[object]) -> None:
        keys = tuple(self._shown(screen))
        if keys != self._keys:
            self._keys = keys
            self.refresh()

    def _shown(self, screen: Screen[object]) -> Iterable[ShownKey]:
        actions = set()
        for node, binding, enabled, _ in screen.active_bindings.values():
            if binding.show and enabled and binding.action not in actions:
                actions.add(binding.action)
                display = self.app.get_key_display(binding)
                yield ShownKey(binding.key, display, binding.description, node is not self.app)

    def render(self) -> Text:
        """Return the line."""
        return self._line(watch_app(self).palette)

    def _line(self, colours: Palette) -> Text:
        text = Text(no_wrap=True, overflow="crop", end="")
        for more, key in fitting(self._keys, self.size.width):
            text.append(more, colours.muted)
            text.append(f" {key.display}", f"bold {colours.accent}")
            text.append(f" {key.title} ", colours.text)
        return text

    def on_click(self, event: Click) -> None:
        """Press the key under the mouse."""
        end = 0
        for more, key in fitting(self._keys, self.size.width):
            end += len(more) + key.width
            if event.x < end:
                self.app.simulate_key(key.key)
                return
