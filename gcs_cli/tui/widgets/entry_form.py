"""A form over a screen: some texts with labels, checked together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen
from textual.suggester import Suggester, SuggestFromList
from textual.widgets import Input, Label


class Entry(NamedTuple):
    """A text that the user edits; ``words`` complete it."""

    title: str
    value: str = ""
    words: Sequence[str] | Suggester = ()


class PathSuggester(Suggester):
    """Completes the path of a file; with suffixes only files of these."""

    def __init__(self, suffixes: Sequence[str] = ()) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._suffixes = tuple(suffixes)

    async def get_suggestion(self, value: str) -> str | None:
        """Return the first file or folder that begins with ``value``."""
        folder, _, start = value.rpartition("/")
        try:
            found = sorted(Path(f"{folder}/" if "/" in value else ".").expanduser().iterdir())
        except OSError:
            return None
        for path in found:
            is_folder = path.is_dir()
            if path.name.startswith(start) and (is_folder or path.name.endswith(self._suffixes or ("",))):
                return value + path.name[len(start) :] + ("/" if is_folder else "")
        return None


class EntryForm(ModalScreen[Any]):
    """Asks for texts; the result is that of ``parse``, or None if the user cancels.

    ``parse`` raises ValueError with one sentence for texts that are not valid; the form stays open with it.
    """

    DEFAULT_CSS = """
    EntryForm { align: center middle; }
    EntryForm > Vertical { width: 76; max-width: 95%; height: auto; max-height: 95%; border: round $accent;
                           padding: 0 2; background: $surface; }
    EntryForm Horizontal { height: 1; }
    EntryForm .label { width: 28; color: $foreground 80%; text-overflow: ellipsis; text-wrap: nowrap; }
    EntryForm Input { width: 1fr; background: $background; }
    EntryForm .title { text-style: bold; color: $accent; margin-bottom: 1; width: 100%; }
    EntryForm #problem { color: $error; width: 100%; }
    EntryForm .keys { color: $foreground 60%; }
    """
    BINDINGS: ClassVar = [
        Binding("escape", "cancel", "Cancel"),
        Binding("down", "app.focus_next", show=False),
        Binding("up", "app.focus_previous", show=False),
    ]

    def __init__(
        self, title: str, entries: Sequence[Entry], parse: Callable[[list[str]], Any], first: int = 0
    ) -> None:
        super().__init__()
        self._title, self._entries, self._parse, self._first = title, entries, parse, first

    def compose(self) -> ComposeResult:
        """Yield a line per text."""
        with Vertical():
            yield Label(self._title, classes="title", markup=False)
            for entry in self._entries:
                with Horizontal():
                    yield Label(entry.title, classes="label", markup=False)
                    words: Suggester | None = None
                    if isinstance(entry.words, Suggester):
                        words = entry.words
                    elif entry.words:
                        words = SuggestFromList(entry.words, case_sensitive=False)
                    yield Input(entry.value, suggester=words, compact=True)
            yield Label("", id="problem", markup=False)
            keys = "Enter accepts, Escape cancels"
            yield Label(f"↑↓ field, {keys}" if len(self._entries) > 1 else keys, classes="keys", markup=False)

    def on_mount(self) -> None:
        """Put the cursor into a field."""
        self.set_focus(list(self.query(Input))[self._first])

    def on_input_submitted(self) -> None:
        """End with the result, or show the problem."""
        try:
            result = self._parse([entered.value.strip() for entered in self.query(Input)])
        except ValueError as error:
            self.query_one("#problem", Label).update(str(error))
            return
        self.dismiss(result)

    def action_cancel(self) -> None:
        """End without a result."""
        self.dismiss(None)
