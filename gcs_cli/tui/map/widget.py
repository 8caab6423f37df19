"""The map as a widget: pan, zoom, fit, follow, and the cursor."""

from __future__ import annotations

from textual.events import Leave, MouseDown, MouseMove, MouseScrollDown, MouseScrollUp, MouseUp, Resize
from textual.message import Message

from gcs_cli.charts.canvas import DOTS_X, DOTS_Y
from gcs_cli.tui.map.drawing import draw_map
from gcs_cli.tui.map.scene import MapScene
from gcs_cli.tui.map.viewport import Viewport
from gcs_cli.tui.widgets.drawing import CanvasWidget, watch_app

_PAN_SHARE = 0.1
_ZOOM_STEP = 2.0**0.5
_FOLLOW_MARGIN = 0.25
"""Share of the screen at each side that a followed vehicle does not enter."""
_FIT_MARGIN = 0.02
_ALL, _FOLLOW, _FREE = "all", "follow", "free"


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
