"""The screen Fly: attitude, position, rotors, mission, timing and the newest messages."""

from __future__ import annotations

from rich.text import Text
from textual.app import ComposeResult

from gcs_cli.tui.horizon import horizon
from gcs_cli.tui.palette import Palette
from gcs_cli.tui.watch_screen import Drawing, WatchScreen
from gcs_cli.vehicle.view_types import VehicleView


class FlyScreen(WatchScreen):
    """The state of the vehicle at a glance."""

    def compose_body(self) -> ComposeResult:
        """Yield the drawings."""
        yield Drawing(_attitude, "Attitude")


def _attitude(view: VehicleView, _now_s: float, width: int, height: int, _colours: Palette) -> Text:
    return horizon(view.attitude, width, height)
