"""A search field at the foot of a screen, which is hidden until it is opened."""

from __future__ import annotations

from textual.widgets import Input


class SearchField(Input):
    """An input that its screen opens and closes."""

    DEFAULT_CSS = "SearchField { dock: bottom; height: 1; }"

    def __init__(self, placeholder: str, *, id: str) -> None:
        super().__init__(placeholder=placeholder, id=id, compact=True)
        self.display = False

    def open(self) -> None:
        """Show the field, and type into it."""
        self.display = True
        self.screen.set_focus(self)

    def close(self) -> None:
        """Clear and hide the field."""
        self.value = ""
        self.display = False
