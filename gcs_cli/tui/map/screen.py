"""The screen Map: plan, track and vehicles from above, north up."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual import work
from textual.app import ComposeResult
from textual.binding import Binding

from flightstack.core.contract import Vector3
from gcs_cli.actions import in_flight
from gcs_cli.tui.map.drawing import legend, place_text
from gcs_cli.tui.map.model import MapModel
from gcs_cli.tui.map.widget import MapWidget
from gcs_cli.tui.mission.plan_fetcher import PlanFetcher
from gcs_cli.tui.orders.orders import order_named, vehicle_name
from gcs_cli.tui.watch_screen import WatchScreen
from gcs_cli.tui.widgets.drawing import LineWidget, watch_app
from gcs_cli.vehicle.view_types import VehicleView

_EVERY = 2
"""Drawn in one of so many redraws, and at once when the user moves the map."""


class MapScreen(WatchScreen):
    """The map, and below it the legend and the place under the cursor."""

    BINDINGS: ClassVar = [
        Binding("g", "goto", "Go here"),
        Binding("f", "map('follow')", "Follow"),
        Binding("a", "map('fit')", "All"),
        Binding("plus,equals_sign", "zoom(1)", "Zoom", key_display="+ -"),
        Binding("minus", "zoom(-1)", "Zoom out", show=False),
        Binding("left,h", "pan(-1,0)", "Pan", key_display="←↓↑→"),
        Binding("right,l", "pan(1,0)", "Pan right", show=False),
        Binding("up,k", "pan(0,-1)", "Pan up", show=False),
        Binding("down,j", "pan(0,1)", "Pan down", show=False),
        Binding("r", "map('toggle_grid')", "Grid", show=False),
        Binding("c", "clear_track", "Clear track", show=False),
        Binding("u", "reload", "Update plan", show=False),
    ]

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        self._model = MapModel()

    def compose_body(self) -> ComposeResult:
        """Yield the map and the line below."""
        yield MapWidget(id="map")
        yield LineWidget(id="place")

    @property
    def map(self) -> MapWidget:
        """The map."""
        return self.query_one(MapWidget)

    @property
    def plans(self) -> PlanFetcher:
        """The plans of the vehicle."""
        return watch_app(self).plans

    def show(self, view: VehicleView, now_s: float) -> None:
        """Draw the map, and download the plans if they changed."""
        super().show(view, now_s)
        if watch_app(self).redraws % _EVERY:
            return
        feed = watch_app(self).feed
        history = feed.history
        system_id = None if view.identity is None else view.identity.system_id
        current = [stream.last for stream in history.streams(system_id) if stream.name == "MISSION_CURRENT"]
        self.plans.update(view, current[0] if current else None)
        aircraft = feed.traffic.aircraft(now_s)
        self.map.show_scene(self._model.scene(view, history, self.plans.plan, aircraft))
        self._show_place()

    def on_map_widget_moved(self) -> None:
        """Show the place under the cursor."""
        self._show_place()

    def _show_place(self) -> None:
        colours = watch_app(self).palette
        line = self.query_one("#place", LineWidget)
        width = line.size.width
        place = Text(no_wrap=True, end="")
        if self._model.frame is None:
            place.append("the vehicle has no position yet", colours.warning)
        elif self.map.cursor_place is not None:
            place.append(
                place_text(self._model.frame, self.map.cursor_place, self.map.scene.home), colours.text
            )
        problem = self.plans.problem or self.map.scene.plan.problem
        left = legend(self.map.scene, colours, width - len(place) - 1)
        if problem:
            left = Text(problem, colours.bad, no_wrap=True, end="")
            left.truncate(max(0, width - len(place) - 1), overflow="ellipsis")
        elif self.plans.loading:
            left = Text(f"downloading the {self.plans.loading}", colours.muted, no_wrap=True, end="")
        left.append(" " * max(1, width - len(left) - len(place)))
        left.append_text(place)
        line.show_line(left)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return False for keys that have no effect now."""
        return action != "goto" or any(map(order_named("goto").applies, watch_app(self).feed.targets))

    def action_map(self, method: str) -> None:
        """Call a method of the map without arguments."""
        {"follow": self.map.follow, "fit": self.map.fit, "toggle_grid": self.map.toggle_grid}[method]()

    def action_zoom(self, steps: int) -> None:
        """Zoom in or out."""
        self.map.zoom(steps)

    def action_pan(self, columns: int, rows: int) -> None:
        """Move the view."""
        self.map.pan(columns, rows)

    def action_clear_track(self) -> None:
        """Drop the track."""
        self._model.clear_track()

    def action_reload(self) -> None:
        """Download the plans again."""
        self.plans.reload()

    def on_map_widget_picked(self) -> None:
        """Ask to fly to the place that was clicked."""
        self.action_goto()

    @work(exclusive=True)
    async def action_goto(self) -> None:
        """Ask, and fly to the place under the cursor at the current altitude."""
        app, frame, place = watch_app(self), self._model.frame, self.map.cursor_place
        targets = [view for view in app.feed.targets if order_named("goto").applies(view)]
        if frame is None or place is None or not targets:
            reason = "the vehicle is disarmed: take off first" if place is not None else ""
            reason = reason or "move the map or the mouse to a place"
            self.notify("the vehicle has no position yet" if frame is None else reason, severity="warning")
            return
        target = frame.to_geo(Vector3(*place, 0.0))
        where = f"{place_text(frame, place, self.map.scene.home)}\nat the current altitude"
        await app.perform(
            "Fly there",
            targets,
            lambda _view: in_flight.goto(target.latitude_deg, target.longitude_deg),
            lambda view: f"Fly {vehicle_name(view)} to {where}?",
        )
