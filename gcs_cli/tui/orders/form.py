"""Questions and forms over a screen: a confirmation, and the values of an order."""

from __future__ import annotations

from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen
from textual.suggester import SuggestFromList
from textual.widgets import Button, Input, Label

from gcs_cli.tui.orders.orders import Field, FieldError, Order
from gcs_cli.vehicle.view_types import VehicleView


class OrderForm(ModalScreen[list[Any] | None]):
    """Asks for the values of ``order``; the result is None if the user cancels."""

    DEFAULT_CSS = """
    OrderForm { align: center middle; }
    OrderForm > Vertical { width: 60; max-width: 90%; height: auto; border: round $accent; padding: 0 2;
                           background: $surface; }
    OrderForm Input { margin-bottom: 1; }
    OrderForm Label { width: 100%; }
    OrderForm .title { text-style: bold; color: $accent; margin-bottom: 1; }
    OrderForm #problem { color: $error; }
    """
    BINDINGS: ClassVar = [
        Binding("escape", "cancel", "Cancel"),
        Binding("down", "app.focus_next", show=False),
        Binding("up", "app.focus_previous", show=False),
    ]

    def __init__(self, order: Order, view: VehicleView) -> None:
        super().__init__()
        self._order, self._view = order, view

    def compose(self) -> ComposeResult:
        """Yield a field per value."""
        with Vertical():
            yield Label(f"{self._order.title}: {self._order.help}", classes="title", markup=False)
            for field in self._order.fields:
                yield Label(_title(field, self._view), markup=False)
                words = None if field.choices is None else list(field.choices(self._view))
                suggester = None if words is None else SuggestFromList(words, case_sensitive=False)
                yield Input(field.default, suggester=suggester, compact=True, id=f"field-{field.name}")
            yield Label("", id="problem", markup=False)
            yield Label("Enter sends, Escape cancels", markup=False)

    def on_mount(self) -> None:
        """Put the cursor into the first field."""
        self.set_focus(self.query(Input).first())

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Go to the next field; after the last one end with the values, or show the error."""
        inputs = list(self.query(Input))
        if event.input is not inputs[-1]:
            self.focus_next()
            return
        values = []
        for field, entered in zip(self._order.fields, inputs, strict=True):
            try:
                values.append(field.parse(entered.value, self._view))
            except FieldError as error:
                self.query_one("#problem", Label).update(str(error))
                self.set_focus(entered)
                return
        self.dismiss(values)

    def action_cancel(self) -> None:
        """End without values."""
        self.dismiss(None)


def _title(field: Field, view: VehicleView) -> str:
    parts = [field.name]
    if field.unit:
        parts.append(f"[{field.unit}]")
    if field.choices is not None:
        parts.append(f"({', '.join(field.choices(view))})")
    if field.is_optional(view):
        parts.append(f"(empty: {field.omitted})" if field.omitted else "(optional)")
    return " ".join(parts)


class Confirm(ModalScreen[bool]):
    """Asks ``question``; the result is True if the user agrees. Without an answer nothing is sent."""

    DEFAULT_CSS = """
    Confirm { align: center middle; }
    Confirm > Vertical { width: auto; max-width: 90%; height: auto; border: round $warning; padding: 1 2;
                         background: $surface; }
    Confirm Label { width: auto; max-width: 100%; margin-bottom: 1; }
    Confirm Horizontal { width: auto; height: auto; }
    Confirm Button { margin-right: 2; }
    """
    BINDINGS: ClassVar = [
        Binding("y", "answer(True)", "Yes"),
        Binding("n,escape", "answer(False)", "No"),
        Binding("left,right", "app.focus_next", show=False),
    ]

    def __init__(self, question: str, yes: str) -> None:
        super().__init__()
        self._question, self._yes = question, yes

    def compose(self) -> ComposeResult:
        """Yield the question and the buttons."""
        with Vertical():
            yield Label(self._question, markup=False)
            with Horizontal():
                yield Button(f"{self._yes} (y)", variant="warning", id="yes")
                yield Button("Cancel (n)", id="no")

    def on_mount(self) -> None:
        """Select the harmless answer."""
        self.set_focus(self.query_one("#no"))

    def on_button_pressed(self, event: Button.Pressed) -> None:
        """End with the answer."""
        self.dismiss(event.button.id == "yes")

    def action_answer(self, yes: bool) -> None:
        """End with the answer."""
        self.dismiss(yes)
