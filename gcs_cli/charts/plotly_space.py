"""Paths in space as JSON of plotly.js. Pure."""

from __future__ import annotations

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.charts.decimate import spaced
from gcs_cli.charts.figure import SpaceFigure, SpacePath
from gcs_cli.charts.plotly_parts import Json, base_layout, colour, dash_of, mode_of, numbers, plain

_POINTS, _POSES = 3000, 1500


def space_json(figure: SpaceFigure) -> Json:
    """Return data, layout and the poses of the time slider."""
    layout = base_layout()
    layout["margin"] = {"l": 0, "r": 0, "t": 30, "b": 0}
    layout["height"] = figure.height
    axis = {
        "gridcolor": colour("line"), "zerolinecolor": colour("axis"), "linecolor": colour("axis"),
        "showbackground": False, "color": colour("soft"),
    }  # fmt: skip
    low, high = _corners(figure)
    span = high - low
    layout["scene"] = {
        "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", numbers(1.25 * span / span.max(), 4), strict=True)),
        "camera": {"eye": {"x": 0.8, "y": -1.5, "z": 0.9}, "center": {"x": 0, "y": 0, "z": -0.15}},
    }
    for name, title, *ends in zip("xyz", ("east", "north", "height"), low, high, strict=True):
        layout["scene"][f"{name}axis"] = {**axis, "title": {"text": f"{title} [m]"}, "range": numbers(ends)}
    content: Json = {"data": [_space_trace(path) for path in figure.paths], "layout": layout, "linked": False}
    if figure.playback is not None and len(figure.playback.time_s):
        content["playback"] = _playback(figure)
        content["data"].append(_vehicle_trace())
    return content


def _corners(figure: SpaceFigure) -> tuple[FloatArray, FloatArray]:
    """Return the ends of the axes east, north and height, so that metres are equally long on all of them."""
    points = np.concatenate([path.ned_m for path in figure.paths])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return np.zeros(3), np.ones(3)
    points = np.column_stack((points[:, 1], points[:, 0], -points[:, 2]))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(0.05 * float((high - low).max()), 0.5)
    return low - margin, high + margin


def _space_trace(path: SpacePath) -> Json:
    points = path.ned_m if path.texts else path.ned_m[spaced(len(path.ned_m), _POINTS)]
    north, east, down = points.T
    return {
        "type": "scatter3d",
        "name": plain(path.name),
        **{key: numbers(values) for key, values in (("x", east), ("y", north), ("z", -down))},
        "mode": mode_of(path),
        "line": {"color": colour(path.colour), "width": path.width, "dash": dash_of(path.dash)},
        "marker": {"color": colour(path.colour), "size": 4, "symbol": _symbol_in_space(path)},
        "text": [plain(text) for text in path.texts],
        "textfont": {"color": colour("ink")},
        "showlegend": path.in_legend,
        "hovertemplate": "%{fullData.name}<br>%{y:.2f} m north, %{x:.2f} m east, %{z:.2f} m high<extra></extra>",
    }


def _symbol_in_space(path: SpacePath) -> str:
    return (
        path.marker
        if path.marker in ("circle", "x", "cross", "diamond", "square", "circle-open")
        else "circle"
    )


def _playback(figure: SpaceFigure) -> Json:
    """Return the poses for the time slider: metres east, north and up; roll, pitch and yaw."""
    poses = figure.playback
    assert poses is not None
    index = spaced(len(poses.time_s), _POSES)
    north, east, down = poses.ned_m[index].T
    return {
        "time": numbers(poses.time_s[index], 7),
        "east": numbers(east),
        "north": numbers(north),
        "up": numbers(-down),
        **{name: numbers(poses.euler_rad[index, column], 4) for column, name in enumerate(("roll", "pitch", "yaw"))},
        "size": _vehicle_size_m(poses.ned_m),
    }  # fmt: skip


def _vehicle_size_m(ned_m: FloatArray) -> float:
    """Return how large the vehicle is drawn: a thirtieth of the flown space, at least its true size."""
    finite = ned_m[np.isfinite(ned_m).all(axis=1)]
    extent = float(np.ptp(finite, axis=0).max()) if len(finite) else 0.0
    return float(f"{max(0.25, extent / 30.0):.3g}")


def _vehicle_trace() -> Json:
    """Return the trace that charts.js moves: the arms, and a longer line ahead."""
    return {
        "type": "scatter3d", "name": "vehicle, nose ahead", "x": [], "y": [], "z": [], "mode": "lines",
        "line": {"color": colour("bad"), "width": 6}, "hoverinfo": "skip", "showlegend": True,
    }  # fmt: skip
