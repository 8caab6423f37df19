"""The screen Map: plan, track and vehicles from above, north up; its widget has view and cursor."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual import work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.events import Leave, MouseDown, MouseMove, MouseScrollDown, MouseScrollUp, MouseUp, Resize
from textual.message import Message

from flightstack.core.contract import Vector3
from gcs_cli.actions import in_flight
from gcs_cli.charts.canvas import DOTS_X, DOTS_Y
from gcs_cli.tui.map.drawing import draw_map, legend, place_text
from gcs_cli.tui.map.model import MapModel
from gcs_cli.tui.map.scene import MapScene
from gcs_cli.tui.map.viewport import Viewport
from gcs_cli.tui.mission.plan_fetcher import PlanFetcher
from gcs_cli.tui.orders.orders import order_named, vehicle_name
from gcs_cli.tui.watch_screen import WatchScreen
from gcs_cli.tui.widgets.drawing import CanvasWidget, LineWidget, watch_app
from gcs_cli.vehicle.view_types import VehicleView

_EVERY = 2
"""Drawn in one of so many redraws, and at once when the user moves the map."""
_PAN_SHARE = 0.1
_ZOOM_STEP = 2.0**0.5
_FOLLOW_MARGIN = 0.25
"""Share of the screen at each side that a followed vehicle does not enter."""
_FIT_MARGIN = 0.02
_ALL, _FOLLOW, _FREE = "all", "follow", "free"


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


class MapWidget(CanvasWidget):
    """Shows all of the scene until the user moves the view."""

    class Picked(Message):
        """The user clicked on the map."""

    class Moved(Message):
        """The cursor or the view moved."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.scene = MapScene()
        self.view = Viewport()
        self.mode = _ALL
        self._grid = False
        self._mouse: tuple[int, int] | None = None
        self._drag: tuple[int, int] | None = None
        self._is_dragged = False
        self._extent_key: object = None

    @property
    def cursor(self) -> tuple[int, int] | None:
        """Column and row of the mouse, or of the middle after the view was moved by keys."""
        if self._mouse is None and self.mode == _FREE:
            return self.view.width // 2, self.view.height // 2
        return self._mouse

    @property
    def cursor_place(self) -> tuple[float, float] | None:
        """Place under the cursor, metres north and east of the anchor."""
        return None if self.cursor is None else self.view.cell_place(*self.cursor)

    def show_scene(self, scene: MapScene) -> None:
        """Draw ``scene``."""
        self.scene = scene
        self._adjust_view()
        if self.view.width and self.view.height:
            canvas = draw_map(scene, self.view, watch_app(self).palette, grid=self._grid, cursor=self.cursor)
            self.draw(canvas)

    def _adjust_view(self) -> None:
        vehicle = self.scene.vehicle
        if self.mode == _FOLLOW and vehicle is not None:
            if not self.view.shows(vehicle.place, _FOLLOW_MARGIN):
                self.view = self.view.centred(vehicle.place)
        elif self.mode == _ALL:
            key = (
                self.view.width,
                self.view.height,
                self.scene.plan,
                self.scene.home,
                sum(not craft.is_traffic for craft in self.scene.others),
            )
            is_outside = vehicle is not None and not self.view.shows(vehicle.place, _FIT_MARGIN)
            if key != self._extent_key or is_outside:
                self._extent_key = key
                self.view = self.view.fitted(self.scene.extent())

    def fit(self) -> None:
        """Show everything, now and when something is added."""
        self.mode, self._extent_key, self._mouse = _ALL, None, None
        self._changed()

    def follow(self) -> None:
        """Keep the vehicle in the middle part of the screen."""
        self.mode, self._mouse = _FOLLOW, None
        if self.scene.vehicle is not None:
            self.view = self.view.centred(self.scene.vehicle.place)
        self._changed()

    def pan(self, columns: int, rows: int) -> None:
        """Move the view by tenths of the screen."""
        self.mode, self._mouse = _FREE, None
        wide, high = self.view.dots
        step = _PAN_SHARE * min(wide, high)
        self.view = self.view.panned(columns * step, rows * step)
        self._changed()

    def zoom(self, steps: int) -> None:
        """Zoom in (positive) or out around the cursor, or around the vehicle while it is followed."""
        place = self.cursor_place
        if self.mode == _FOLLOW and self.scene.vehicle is not None:
            place = self.scene.vehicle.place
        elif self.mode == _ALL:
            self.mode = _FREE
        self.view = self.view.zoomed(_ZOOM_STEP**steps, place)
        self._changed()

    def toggle_grid(self) -> None:
        """Show or hide the grid."""
        self._grid = not self._grid
        self._changed()

    def _changed(self) -> None:
        self.show_scene(self.scene)
        self.post_message(self.Moved())

    def on_resize(self, event: Resize) -> None:
        """Draw in the new size."""
        self.view = self.view._replace(width=event.size.width, height=event.size.height)
        self._mouse = None
        self._changed()

    def on_mouse_scroll_up(self, event: MouseScrollUp) -> None:
        """Zoom in around the mouse."""
        event.stop()
        self._mouse = (event.x, event.y)
        self.zoom(1)

    def on_mouse_scroll_down(self, event: MouseScrollDown) -> None:
        """Zoom out around the mouse."""
        event.stop()
        self._mouse = (event.x, event.y)
        self.zoom(-1)

    def on_mouse_down(self, event: MouseDown) -> None:
        """Begin to drag the map or to click."""
        self._drag, self._is_dragged = (event.x, event.y), False
        self.capture_mouse()

    def on_mouse_move(self, event: MouseMove) -> None:
        """Drag the map, or move the cursor."""
        self._mouse = (event.x, event.y)
        if self._drag is not None and self._mouse != self._drag:
            columns, rows = event.x - self._drag[0], event.y - self._drag[1]
            self.mode, self._is_dragged, self._drag = _FREE, True, self._mouse
            self.view = self.view.panned(-columns * DOTS_X, -rows * DOTS_Y)
        self._changed()

    def on_mouse_up(self, event: MouseUp) -> None:
        """End a drag; without movement it was a click."""
        self.release_mouse()
        was_click, self._drag = self._drag is not None and not self._is_dragged, None
        self._mouse = (event.x, event.y)
        self._changed()
        if was_click:
            self.post_message(self.Picked())

    def on_leave(self, _event: Leave) -> None:
        """Move the cursor back to the middle."""
        if self._drag is None:
            self._mouse = None
            self._changed()
