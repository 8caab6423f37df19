"""A list of names with fuzzy search, over a screen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar, NamedTuple

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.events import Click
from textual.widgets import Input, Label

from gcs_cli.tui.watch_screen import LiveDialog
from gcs_cli.tui.widgets.drawing import watch_app
from gcs_cli.tui.widgets.fuzzy import Match, search
from gcs_cli.tui.widgets.row_list import RowList

_EVERY = 2
"""Followed in one of so many redraws: faster figures cannot be read."""


class Choice(NamedTuple):
    """A name that can be chosen, the text beside it, and the colour of its mark if it is chosen.

    ``note`` is called for the visible names only: a link has more than a thousand fields.
    """

    name: str
    note: Callable[[], str]
    colour: str | None = None


class _Names(RowList, can_focus=False):
    """The found names; the keys go to the input, so the cursor is drawn as if the list had the focus."""

    @property
    def is_lit(self) -> bool:
        """Always true."""
        return True

    def on_click(self, event: Click) -> None:
        """Choose the name under the mouse."""
        index = self.scroll_offset.y + event.y
        event.prevent_default()
        if index < self.count:
            self.select(index)
            self.post_message(self.Chosen())


class FieldPicker(LiveDialog[None]):
    """Enter toggles the selected name; the list stays open until Escape.

    ``choices`` returns the names now, ``toggle`` adds or removes one and returns a reason if it cannot.
    """

    DEFAULT_CSS = """
    FieldPicker { align: center middle; }
    FieldPicker > Vertical { width: 80%; max-width: 90; height: 80%; border: round $accent; background: $surface; }
    FieldPicker RowList { background: $surface; }
    FieldPicker Label { color: $foreground 60%; }
    """
    BINDINGS: ClassVar = [
        Binding("escape", "dismiss", "Close", priority=True),
        Binding("down", "move(1)", "Next", priority=True, show=False),
        Binding("up", "move(-1)", "Previous", priority=True, show=False),
        Binding("pagedown", "move(10)", "Next page", priority=True, show=False),
        Binding("pageup", "move(-10)", "Previous page", priority=True, show=False),
    ]

    def __init__(
        self, title: str, choices: Callable[[], Sequence[Choice]], toggle: Callable[[str], str | None]
    ) -> None:
        super().__init__()
        self._title, self._choices, self._toggle = title, choices, toggle
        self._known: dict[str, Choice] = {}
        self._query = ""
        self._found: list[Match] = []

    def compose(self) -> ComposeResult:
        """Yield the input, the list and a line of help."""
        with Vertical() as box:
            box.border_title = self._title
            yield Input(placeholder="letters of the name, in order")
            yield _Names()
            yield Label("Enter adds or removes, Escape closes", markup=False)

    def on_mount(self) -> None:
        """Show all names."""
        self.set_focus(self.query_one(Input))
        self._load()

    @property
    def shown(self) -> list[str]:
        """The names that match, best first."""
        return [match.name for match in self._found]

    def follow(self) -> None:
        """Show the names and values of now; the selected name stays selected."""
        if not self.is_mounted or watch_app(self).redraws % _EVERY:  # opened just now, or too soon
            return
        rows = self.query_one(_Names)
        before = self._found[rows.cursor].name if self._found else ""
        self._load()
        if before in self.shown and self.shown[rows.cursor] != before:
            rows.select(self.shown.index(before))

    def on_input_changed(self, event: Input.Changed) -> None:
        """Show the names that match."""
        before, self._query = self._query, event.value
        among = self.shown if self._query.startswith(before) else self._known
        self._search(among)
        self.query_one(_Names).select(0)

    def on_input_submitted(self) -> None:
        """Toggle the selected name."""
        self._choose()

    def on_row_list_chosen(self) -> None:
        """Toggle the name that was clicked."""
        self._choose()

    def on_resize(self) -> None:
        """Draw the rows in the new width."""
        self.call_after_refresh(self._draw)

    def action_move(self, steps: int) -> None:
        """Move the selection."""
        if self._found:
            self.query_one(_Names).action_move(steps)

    def _choose(self) -> None:
        if not self._found:
            return
        reason = self._toggle(self._found[self.query_one(_Names).cursor].name)
        if reason:
            self.notify(reason, severity="warning")
        self._load()

    def _load(self) -> None:
        self._known = {choice.name: choice for choice in self._choices()}
        self._search(self._known)

    def _search(self, among: Iterable[str]) -> None:
        self._found = search(self._query, among)
        self._draw()

    def _draw(self) -> None:
        names = max((len(match.name) for match in self._found), default=0)

        def row(index: int, _width: int) -> Text:
            match = self._found[index]
            return _line(match, self._known[match.name], names)

        self.query_one(_Names).show_rows(len(self._found), row)


def _line(match: Match, choice: Choice, width: int) -> Text:
    line = Text("● " if choice.colour else "  ", choice.colour or "", no_wrap=True)
    name = Text(match.name)
    for position in match.positions:
        name.stylize("bold underline", position, position + 1)
    line.append_text(name)
    line.append(" " * (width - len(match.name) + 2))
    return line.append(choice.note(), "dim")
