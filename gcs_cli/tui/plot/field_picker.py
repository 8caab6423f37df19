"""A list of names with fuzzy search, over a screen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input, Label, OptionList
from textual.widgets.option_list import Option

from gcs_cli.tui.widgets.fuzzy import Match, search

_MOST_SHOWN = 200


class Choice(NamedTuple):
    """A name that can be chosen, what is said beside it, and the colour of its mark if it is chosen."""

    name: str
    note: str = ""
    colour: str | None = None


class FieldPicker(ModalScreen[None]):
    """Enter toggles the selected name; the list stays open until Escape.

    ``choices`` returns the names now, ``toggle`` adds or removes one and returns a reason if it cannot.
    """

    DEFAULT_CSS = """
    FieldPicker { align: center middle; }
    FieldPicker > Vertical { width: 80%; max-width: 90; height: 80%; border: round $accent; background: $surface; }
    FieldPicker OptionList { height: 1fr; border: none; background: $surface; }
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
        self._shown: list[str] = []

    def compose(self) -> ComposeResult:
        """Yield the input, the list and a line of help."""
        with Vertical() as box:
            box.border_title = self._title
            yield Input(placeholder="letters of the name, in order")
            yield OptionList(markup=False)
            yield Label("Enter adds or removes, Escape closes", markup=False)

    def on_mount(self) -> None:
        """Show all names."""
        self.query_one(OptionList).can_focus = False
        self.set_focus(self.query_one(Input))
        self._search("")

    def on_input_changed(self, event: Input.Changed) -> None:
        """Show the names that match."""
        self._search(event.value)

    def on_input_submitted(self) -> None:
        """Toggle the selected name."""
        index = self.query_one(OptionList).highlighted
        if index is not None:
            self._choose(index)

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Toggle the name that was clicked."""
        self._choose(event.option_index)

    def action_move(self, steps: int) -> None:
        """Move the selection."""
        options = self.query_one(OptionList)
        if self._shown:
            options.highlighted = max(0, min(len(self._shown) - 1, (options.highlighted or 0) + steps))

    def _choose(self, index: int) -> None:
        reason = self._toggle(self._shown[index])
        if reason:
            self.notify(reason, severity="warning")
        self._search(self.query_one(Input).value, index)

    def _search(self, query: str, highlighted: int = 0) -> None:
        choices = {choice.name: choice for choice in self._choices()}
        matches = search(query, choices)[:_MOST_SHOWN]
        self._shown = [match.name for match in matches]
        options = self.query_one(OptionList)
        options.clear_options()
        width = max(map(len, self._shown), default=0)
        options.add_options([Option(_line(match, choices[match.name], width)) for match in matches])
        if matches:
            options.highlighted = min(highlighted, len(matches) - 1)


def _line(match: Match, choice: Choice, width: int) -> Text:
    line = Text("● " if choice.colour else "  ", choice.colour or "", no_wrap=True)
    name = Text(match.name)
    for position in match.positions:
        name.stylize("bold underline", position, position + 1)
    line.append_text(name)
    line.append(" " * (width - len(match.name) + 2))
    return line.append(choice.note, "dim")
