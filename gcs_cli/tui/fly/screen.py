"""The screen Fly: attitude, position, power, health, mission, loop timing and the newest messages.

A module of its own, as each screen.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical

from gcs_cli.tui.fly.compact import compact, waiting
from gcs_cli.tui.fly.flight_display import flight_display
from gcs_cli.tui.fly.health_panels import health_panel, link_panel
from gcs_cli.tui.fly.panels import messages_panel, mission_panel, position_panel, power_panel
from gcs_cli.tui.fly.timing_panels import timing_panel
from gcs_cli.tui.fly.trends import trends_panel
from gcs_cli.tui.orders.orders import ORDERS
from gcs_cli.tui.palette import Palette
from gcs_cli.tui.watch_screen import WatchScreen
from gcs_cli.tui.widgets.drawing import Drawing, watch_app
from gcs_cli.vehicle.view_types import VehicleView


class FlyScreen(WatchScreen):
    """The state of the vehicle at a glance."""

    BINDINGS: ClassVar = [  # they work on every screen; here the footer shows them
        Binding(order.key, f"app.order('{order.name}')", order.title) for order in ORDERS if order.in_footer
    ]

    def compose_body(self) -> ComposeResult:
        """Yield the drawings; the window's size selects which are shown."""
        yield Drawing(self._small, id="small")
        with Horizontal(id="fly"):
            with Vertical(id="flight"):
                yield Drawing(flight_display, every=1, id="display")
                yield Drawing(mission_panel, "Mission", id="mission")
                yield Drawing(messages_panel, "Messages", id="messages")
            with Vertical(id="state"):
                yield Drawing(position_panel, "Position", id="position")
                yield Drawing(power_panel, "Power", id="power")
                yield Drawing(health_panel, "Health", id="health")
                yield Drawing(timing_panel, "Loops", every=2, id="loops")
                yield Drawing(link_panel, "Link", id="link")
            with Vertical(id="past"):
                yield Drawing(self._trends, "Last 2 minutes", every=5, id="trends")

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw the state, or the wait for a vehicle."""
        self.set_class(view.identity is None, "-waiting")
        super().show(view, now_s)

    def _small(
        self, view: VehicleView, now_s: float, width: int, height: int, colours: Palette
    ) -> list[Text]:
        if view.identity is None:
            return waiting(watch_app(self).feed.link_name, width, height, colours)
        return compact(view, now_s, width, height, colours)

    def _trends(
        self, view: VehicleView, now_s: float, width: int, height: int, colours: Palette
    ) -> list[Text]:
        system_id = None if view.identity is None else view.identity.system_id
        series = partial(watch_app(self).feed.history.series, system_id=system_id)
        return trends_panel(series, now_s, width, height, colours)
