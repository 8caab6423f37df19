"""The map in braille: from a scene and a viewport to a canvas. Pure."""

from __future__ import annotations

import math

import numpy as np
from rich.text import Text

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from gcs_cli.charts.canvas import DASHED, DOTS_X, DOTS_Y, DOTTED, Canvas, circle_vertices
from gcs_cli.tui.map.scene import Craft, MapArea, MapPlan, MapScene, Place
from gcs_cli.tui.map.viewport import Viewport, round_step
from gcs_cli.tui.palette import Palette

_GRID_DOTS = 40
"""Least distance of grid lines."""
_SCALE_BAR_CELLS = 8
_HEADING_DOTS = 9.0
_ARROWS, _UNKNOWN_HEADING = "↑↗→↘↓↙←↖", "●"
_HOME_MARK, _RALLY_MARK, _TARGET_MARK, _CURSOR_MARK = "⌂", "◇", "◎", "┼"


def draw_map(
    scene: MapScene,
    view: Viewport,
    colours: Palette,
    *,
    grid: bool = False,
    cursor: tuple[int, int] | None = None,
) -> Canvas:
    """Draw ``scene``; later parts hide earlier ones. ``cursor`` is the column and row of a mark."""
    canvas = Canvas(view.width, view.height)
    if grid:
        _draw_grid(canvas, view, colours)
    for area in scene.plan.areas:
        _draw_area(canvas, view, area, colours)
    _draw_path(canvas, view, scene.plan, colours)
    canvas.line(*view.to_dots(scene.track), colours.good)
    if scene.vehicle is not None and scene.target is not None:
        canvas.line(*view.to_dots(np.array([scene.vehicle.place, scene.target])), colours.target, DOTTED)
    if cursor is not None:
        canvas.label(*cursor, _CURSOR_MARK, f"bold {colours.text}")
    for craft in scene.others:
        _draw_craft(canvas, view, craft, colours.warning if craft.is_traffic else colours.bad, colours)
    if scene.vehicle is not None:
        _draw_craft(canvas, view, scene.vehicle, colours.text, colours)
    _draw_marks(canvas, view, scene, colours)
    _draw_scale(canvas, view, colours, grid)
    return canvas


def _draw_grid(canvas: Canvas, view: Viewport, colours: Palette) -> None:
    step_m = round_step(_GRID_DOTS * view.m_per_dot)
    wide, high = view.dots
    north, west = view.to_place(0, 0)
    south, east = view.to_place(wide, high)
    meridians = np.arange(math.ceil(west / step_m), math.floor(east / step_m) + 1) * step_m
    parallels = np.arange(math.ceil(south / step_m), math.floor(north / step_m) + 1) * step_m
    x, _ = view.to_dots(np.column_stack((np.zeros_like(meridians), meridians)))
    _, y = view.to_dots(np.column_stack((parallels, np.zeros_like(parallels))))
    for column in x:
        dots = np.arange(0, high, 4)
        canvas.points(np.full_like(dots, int(column)), dots, colours.muted)
    for row in y:
        dots = np.arange(0, wide, 4)
        canvas.points(dots, np.full_like(dots, int(row)), colours.muted)


def _draw_area(canvas: Canvas, view: Viewport, area: MapArea, colours: Palette) -> None:
    x, y = view.to_dots(np.array(area.vertices, dtype=np.float64).reshape(-1, 2))
    if area.radius_m:
        x, y = circle_vertices(float(x[0]), float(y[0]), area.radius_m / view.m_per_dot)
    style = colours.accent if area.is_inclusion else colours.bad
    if not area.is_inclusion:
        canvas.hatch(x, y, style)
    canvas.polygon(x, y, style)


def _draw_path(canvas: Canvas, view: Viewport, plan: MapPlan, colours: Palette) -> None:
    if not plan.path:
        return
    places = np.array([item.place for item in plan.path])
    canvas.line(*view.to_dots(places), colours.warning)
    for begin, end in plan.jumps:
        canvas.line(*view.to_dots(np.array([begin, end])), colours.warning, DASHED)


def _draw_craft(canvas: Canvas, view: Viewport, craft: Craft, colour: str, colours: Palette) -> None:
    """Draw an arrow in one of eight directions and a line along the exact heading; a dot without a heading."""
    x, y = view.to_dots(np.array([craft.place]))
    column, row = _cell(x[0], y[0])
    mark = _UNKNOWN_HEADING
    if craft.heading_deg is not None:
        heading = math.radians(craft.heading_deg)
        tip = x[0] + _HEADING_DOTS * math.sin(heading), y[0] - _HEADING_DOTS * math.cos(heading)
        canvas.line([x[0], tip[0]], [y[0], tip[1]], f"bold {colour}")
        mark = _ARROWS[round(craft.heading_deg / 45.0) % 8]
    canvas.label(column, row, mark, f"bold {colours.background} on {colour}")
    canvas.label(column + 1, row, craft.name, colour)


def _draw_marks(canvas: Canvas, view: Viewport, scene: MapScene, colours: Palette) -> None:
    """Write item numbers and symbols, the important ones first; others must find free cells."""
    marks: list[tuple[Place, str, str]] = []
    items = [item for item in scene.plan.path if item.has_mark]
    current = [item for item in items if item.seq == scene.current]
    marks += [(i.place, f"{i.seq}", f"bold {colours.background} on {colours.warning}") for i in current]
    if scene.target is not None:
        marks.append((scene.target, _TARGET_MARK, f"bold {colours.target}"))
    if scene.home is not None:
        marks.append((scene.home, _HOME_MARK, f"bold {colours.accent}"))
    marks += [(place, _RALLY_MARK, f"bold {colours.good}") for place in scene.plan.rally]
    others = sorted((item for item in items if item.seq != scene.current), key=lambda item: item.seq)
    marks += [(item.place, f"{item.seq}", f"bold {colours.warning}") for item in others]
    if not marks:
        return
    x, y = view.to_dots(np.array([place for place, _, _ in marks]))
    for across, down, (_, text, style) in zip(x, y, marks, strict=True):
        canvas.label_near(*_cell(across, down), text, style)


def _cell(x: float, y: float) -> tuple[int, int]:
    return math.floor(np.clip(x, -1e6, 1e6) / DOTS_X), math.floor(np.clip(y, -1e6, 1e6) / DOTS_Y)


def _draw_scale(canvas: Canvas, view: Viewport, colours: Palette, grid: bool) -> None:
    """Draw the scale bar at the lower left, north at the upper right."""
    m_per_cell = DOTS_X * view.m_per_dot
    length_m = round_step(_SCALE_BAR_CELLS * m_per_cell)
    cells = round(length_m / m_per_cell)
    text = f" {distance_text(length_m)}"
    if grid:
        text += f", grid {distance_text(round_step(_GRID_DOTS * view.m_per_dot))}"
    canvas.label(1, view.height - 1, "├" + "─" * max(0, cells - 2) + "┤", colours.text)
    canvas.label(1 + cells, view.height - 1, text, colours.text)
    canvas.label(view.width - 3, 0, "N↑", f"bold {colours.text}")


def distance_text(length_m: float) -> str:
    """Return a length with a unit that keeps it short."""
    if length_m >= 1000.0:
        return f"{length_m / 1000.0:.3g} km"
    return f"{length_m:.3g} m" if length_m >= 1.0 else f"{length_m * 100.0:.3g} cm"


def place_text(frame: LocalFrame, place: tuple[float, float], home: Place | None) -> str:
    """Return latitude and longitude of a place, and its distance and bearing from home."""
    geo = frame.to_geo(Vector3(place[0], place[1], 0.0))
    text = f"{geo.latitude_deg:.6f}° {geo.longitude_deg:.6f}°"
    if home is None:
        return text
    north_m, east_m = place[0] - home.north_m, place[1] - home.east_m
    bearing_deg = round(math.degrees(math.atan2(east_m, north_m))) % 360
    return f"{text}  {distance_text(math.hypot(north_m, east_m))} {bearing_deg:03d}° from home"


def legend(scene: MapScene, colours: Palette, width: int) -> Text:
    """Return the meaning of the marks that the scene has, as much as ``width`` holds."""
    parts: list[tuple[str, str, bool]] = [
        ("track", colours.good, bool(len(scene.track))),
        ("mission", colours.warning, bool(scene.plan.path)),
        ("geofence", colours.accent, any(area.is_inclusion for area in scene.plan.areas)),
        ("keep out", colours.bad, any(not area.is_inclusion for area in scene.plan.areas)),
        (f"{_RALLY_MARK} rally", colours.good, bool(scene.plan.rally)),
        (f"{_HOME_MARK} home", colours.accent, scene.home is not None),
        (f"{_TARGET_MARK} setpoint", colours.target, scene.target is not None),
        ("traffic", colours.warning, any(craft.is_traffic for craft in scene.others)),
    ]
    text = Text(no_wrap=True, overflow="crop", end="")
    for name, style, is_shown in parts:
        if is_shown and len(text) + len(name) + 2 <= width:
            text.append(f"{name}  ", style)
    return text
