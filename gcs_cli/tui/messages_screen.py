"""The screen Messages: the vehicle's status texts."""

from __future__ import annotations

from rich.text import Text
from textual.app import ComposeResult

from gcs_cli.tui.palette import Palette
from gcs_cli.tui.panels import message_lines
from gcs_cli.tui.watch_screen import Drawing, WatchScreen
from gcs_cli.vehicle.view_types import VehicleView


class MessagesScreen(WatchScreen):
    """Status texts, newest at the bottom."""

    def compose_body(self) -> ComposeResult:
        """Yield the list."""
        yield Drawing(_texts, "Messages")


def _texts(view: VehicleView, _now_s: float, width: int, height: int, _colours: Palette) -> Text:
    lines = [line for entry in view.texts for line in message_lines(entry, width)]
    return Text("\n").join(lines[-height:])
