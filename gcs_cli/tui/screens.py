"""The screens of ``gcs watch``: a new one is a module and a row here.

A module of its own: it imports no screen before it is shown.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple, cast

if TYPE_CHECKING:
    from gcs_cli.tui.watch_screen import WatchScreen


class ScreenEntry(NamedTuple):
    """A screen: its mode in the application, key, title and class, which is imported when first shown."""

    mode: str
    key: str
    title: str
    location: str
    summary: str

    def load(self) -> WatchScreen:
        """Import and make the screen."""
        module, _, name = self.location.partition(":")
        return cast("WatchScreen", getattr(import_module(module), name)(self.mode))


SCREENS = (
    ScreenEntry("fly", "1", "Fly", "gcs_cli.tui.fly.screen:FlyScreen", "attitude, position, battery, link"),
    ScreenEntry("map", "2", "Map", "gcs_cli.tui.map.screen:MapScreen", "plan, track and vehicles from above"),
    ScreenEntry(
        "mission",
        "3",
        "Mission",
        "gcs_cli.tui.mission.screen:MissionScreen",
        "items, edits, upload, progress",
    ),
    ScreenEntry("plot", "4", "Plot", "gcs_cli.tui.plot.screen:PlotScreen", "telemetry fields over time"),
    ScreenEntry(
        "messages",
        "5",
        "Messages",
        "gcs_cli.tui.messages.messages_screen:MessagesScreen",
        "texts of the vehicle",
    ),
    ScreenEntry(
        "inspector",
        "6",
        "Inspector",
        "gcs_cli.tui.messages.inspector_screen:InspectorScreen",
        "every message with its fields",
    ),
    ScreenEntry(
        "parameters",
        "7",
        "Parameters",
        "gcs_cli.tui.params.screen:ParamScreen",
        "search, edit, compare, save",
    ),
)
