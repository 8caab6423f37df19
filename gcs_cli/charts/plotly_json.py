"""A figure as the JSON that plotly.js draws. Pure; plotly's Python package is not used.

Colours are CSS variables, ``var(--s1)``, which charts.js replaces by those of the page's light or dark scheme.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.charts.decimate import drawn_samples, spaced
from gcs_cli.charts.figure import (
    AnyFigure,
    Axis,
    Band,
    Bars,
    Dash,
    Figure,
    Level,
    Panel,
    Series,
    SpaceFigure,
    SpacePath,
)

Json: TypeAlias = dict[str, Any]

_DASHES: dict[Dash, str] = {name: name for name in ("solid", "dash", "dot", "dashdot", "longdash")}
_MARGIN = {"l": 64, "r": 18, "t": 44, "b": 44}
_GAP_PX, _TITLE_PX = 16, 30
"""Between rows of panels: without, and with tick labels and a title."""
_BAND_LABEL_PX, _PAGE_PX = 7.0, 900.0
"""Width of a character, and of a chart on a wide page: a band that is too short for its label has none."""
_SPACE_POINTS = 3000
_POSES = 1500


def chart_json(figure: AnyFigure) -> str:
    """Return data, layout and what charts.js needs besides as JSON that is safe within a script element."""
    content = _space(figure) if isinstance(figure, SpaceFigure) else _plane(figure)
    content["file"] = figure.name
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def colour(name: str) -> str:
    """Return the CSS variable of a colour."""
    return f"var(--{name})"


def plain(text: str) -> str:
    """Return a text so that plotly.js shows it as it is: it reads some HTML in texts."""
    return text.replace("&", "&amp;").replace("<", "&lt;")


def numbers(values: Iterable[float], digits: int = 6) -> list[float | None]:
    """Return values rounded to significant digits; None for one that is not finite."""
    return [float(f"{value:.{digits}g}") + 0.0 if math.isfinite(value) else None for value in values]


def _plane(figure: Figure) -> Json:
    data: list[Json] = []
    layout = _base_layout()
    shared = figure.linked and figure.columns == 1
    rows = math.ceil(len(figure.panels) / figure.columns)
    inner_px = rows * figure.height + (rows - 1) * (_GAP_PX if shared else _GAP_PX + 2 * _TITLE_PX)
    seen: set[tuple[str, str]] = set()
    for index, panel in enumerate(figure.panels):
        x_name = "x" if shared or not index else f"x{index + 1}"
        y_name = "y" if not index else f"y{index + 1}"
        data += _traces(panel, x_name, y_name, seen, len(figure.panels) > 1)
        domains = _domains(index, figure, rows, inner_px)
        layout[f"xaxis{x_name[1:]}"] = {**_axis(panel.x), "domain": domains[0], "anchor": y_name}
        layout[f"yaxis{y_name[1:]}"] = {**_axis(_with_levels(panel)), "domain": domains[1], "anchor": x_name}
        if panel.equal:
            layout[f"yaxis{y_name[1:]}"] |= {"scaleanchor": x_name, "scaleratio": 1}
        layout["shapes"] += [*_bands(panel.bands, x_name, y_name), *_levels(panel.levels, x_name, y_name)]
        layout["annotations"] += _panel_title(panel, x_name, y_name)
        if not shared or not index:
            layout["annotations"] += _band_labels(panel, x_name, y_name)
    layout["hovermode"] = "x unified" if _over_x(figure) else "closest"
    layout["hoversubplots"] = "axis"
    layout["height"] = inner_px + _MARGIN["t"] + _MARGIN["b"]
    layout["barmode"] = "overlay"
    return {"data": data, "layout": layout, "linked": figure.linked}


def _base_layout() -> Json:
    return {
        "margin": dict(_MARGIN),
        "paper_bgcolor": colour("card"),
        "plot_bgcolor": colour("card"),
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": colour("soft")},
        "hoverlabel": {"bgcolor": colour("page"), "bordercolor": colour("axis"), "font": {"color": colour("ink")}},
        "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 1, "yref": "container", "yanchor": "top",
                   "bgcolor": "rgba(0,0,0,0)", "font": {"color": colour("ink")}},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": colour("axis"), "activecolor": colour("ink")},
        "uirevision": "kept",
        "shapes": [],
        "annotations": [],
    }  # fmt: skip


def _axis(axis: Axis) -> Json:
    found: Json = {
        "title": {"text": plain(axis.title), "standoff": 8},
        "gridcolor": colour("line"),
        "linecolor": colour("axis"),
        "zerolinecolor": colour("axis"),
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": colour("axis"),
        "showline": True,
        "automargin": False,
    }
    if axis.log:
        found |= {"type": "log", "exponentformat": "power"}
    if axis.low is not None or axis.high is not None:
        ends = (axis.low, axis.high)
        found["range"] = [None if end is None else math.log10(end) if axis.log else end for end in ends]
    return found


def _with_levels(panel: Panel) -> Axis:
    """Return the axis of y with ends that hold the levels too, and room for their labels."""
    levels = [level.at for level in panel.levels if not level.upright]
    if not levels or (panel.y.low is not None and panel.y.high is not None):
        return panel.y
    values = np.concatenate([*(series.y for series in panel.series), np.array(levels)])
    values = values[np.isfinite(values) & ((values > 0.0) | (not panel.y.log))]
    if panel.y.log:
        values = np.log10(values)
    low, high = float(values.min()), float(values.max())
    margin = max(0.1 * (high - low), 1e-3 * max(abs(low), abs(high)), 1e-6)
    ends = [10.0**end if panel.y.log else end for end in (low - margin, high + margin)]
    low, high = (float(f"{end:.6g}") for end in ends)
    return replace(
        panel.y,
        low=low if panel.y.low is None else panel.y.low,
        high=high if panel.y.high is None else panel.y.high,
    )


def _domains(index: int, figure: Figure, rows: int, inner_px: int) -> tuple[list[float], list[float]]:
    row, column = divmod(index, figure.columns)
    gap = 0.09 if figure.columns > 1 else 0.0
    width = (1.0 - gap * (figure.columns - 1)) / figure.columns
    left = column * (width + gap)
    step_px = (inner_px + _row_gap(figure)) / rows
    top = 1.0 - row * step_px / inner_px
    return [round(left, 5), round(left + width, 5)], [
        round(max(0.0, top - figure.height / inner_px), 5),
        round(top, 5),
    ]


def _row_gap(figure: Figure) -> int:
    return _GAP_PX if figure.linked and figure.columns == 1 else _GAP_PX + 2 * _TITLE_PX


def _over_x(figure: Figure) -> bool:
    """True if all curves run forward in x, so that one cursor reads them all."""
    curves = [series for panel in figure.panels for series in panel.series if len(series.x)]
    if any(panel.equal or panel.bars for panel in figure.panels) or not curves:
        return False
    return all(series.dash != "none" and bool(np.all(np.diff(series.x) >= 0.0)) for series in curves)


def _traces(
    panel: Panel, x_name: str, y_name: str, seen: set[tuple[str, str]], among_others: bool
) -> Iterator[Json]:
    for series in panel.series:
        key = (series.name, series.colour)
        yield {
            **_trace(series, _read_out(series, panel, among_others), panel.y.log),
            "xaxis": x_name,
            "yaxis": y_name,
            "legendgroup": plain(series.group or series.name),
            "showlegend": series.in_legend and key not in seen,
        }
        if series.in_legend:
            seen.add(key)
    for bars in panel.bars:
        yield {**_bar_trace(bars, panel.y.unit), "xaxis": x_name, "yaxis": y_name, "showlegend": False}


def _read_out(series: Series, panel: Panel, among_others: bool) -> str:
    """Return what the cursor shows of a curve: panel and curve, where there are several, value and unit."""
    names = [
        *([panel.y.label] if among_others else []),
        *([series.name] if len(panel.series) > 1 or not among_others else []),
    ]
    return f"{plain(', '.join(names))}: %{{y:.5~g}} {plain(panel.y.unit)}<extra></extra>"


def _trace(series: Series, read_out: str, log: bool) -> Json:
    y = np.where(series.y > 0.0, series.y, np.nan) if log else series.y
    if series.texts or series.hints or series.dash == "none" or series.filled:
        x = series.x
    else:
        x, y = drawn_samples(series.x, y)
    modes = [
        *(["lines"] if series.dash != "none" else []),
        *(["markers"] if series.marker else []),
        *(["text"] if series.texts else []),
    ]
    found: Json = {
        "type": "scatter",
        "name": plain(series.name),
        "x": numbers(x, 8),
        "y": numbers(y),
        "mode": "+".join(modes) or "lines",
        "line": {"color": colour(series.colour), "width": series.width, "dash": _DASHES.get(series.dash, "solid")},
        "hovertemplate": read_out,
    }  # fmt: skip
    if series.marker:
        found["marker"] = {"symbol": series.marker, "size": 7, "color": colour(series.colour)}
    if series.filled:
        found |= {"fill": "toself", "opacity": 0.7, "hoverinfo": "skip"}
        found.pop("hovertemplate")
        found["fillcolor"] = colour("even")
    if series.texts:
        found |= {"text": [plain(text) for text in series.texts], "textposition": "top right"}
        found["textfont"] = {"color": colour("ink"), "size": 13}
    if series.hints:
        found["customdata"] = [plain(hint) for hint in series.hints]
        found["hovertemplate"] = "%{customdata}<extra></extra>"
    return found


def _bar_trace(bars: Bars, unit: str) -> Json:
    left, right = np.array(bars.edges[:-1]), np.array(bars.edges[1:])
    return {
        "type": "bar",
        "name": plain(bars.name),
        "x": numbers(0.5 * (left + right), 8),
        "width": numbers(right - left),
        "y": numbers(bars.heights),
        "marker": {"color": colour(bars.colour), "line": {"width": 1, "color": colour("card")}},
        "customdata": [plain(hint) for hint in bars.hints],
        "hovertemplate": "%{customdata}<extra></extra>"
        if bars.hints
        else f"%{{y:.4~g}} {plain(unit)}<extra></extra>",
    }


def _bands(bands: Iterable[Band], x_name: str, y_name: str) -> Iterator[Json]:
    for index, band in enumerate(bands):
        yield {
            "type": "rect", "layer": "below", "line": {"width": 0}, "xref": x_name, "yref": f"{y_name} domain",
            "x0": band.start, "x1": band.end, "y0": 0, "y1": 1, "fillcolor": colour("even" if index % 2 else "odd"),
        }  # fmt: skip


def _band_labels(panel: Panel, x_name: str, y_name: str) -> Iterator[Json]:
    if not panel.bands:
        return
    span = max(band.end for band in panel.bands) - min(band.start for band in panel.bands)
    for band in panel.bands:
        if (band.end - band.start) / max(span, 1e-9) * _PAGE_PX >= _BAND_LABEL_PX * len(band.label):
            yield {
                "text": plain(band.label), "x": 0.5 * (band.start + band.end), "xref": x_name, "y": 1,
                "yref": f"{y_name} domain", "yanchor": "bottom", "showarrow": False, "font": {"size": 11},
            }  # fmt: skip


def _levels(levels: Iterable[Level], x_name: str, y_name: str) -> Iterator[Json]:
    for level in levels:
        along = {"xref": f"{x_name} domain", "x0": 0, "x1": 1, "yref": y_name, "y0": level.at, "y1": level.at}
        across = {
            "xref": x_name,
            "x0": level.at,
            "x1": level.at,
            "yref": f"{y_name} domain",
            "y0": 0,
            "y1": 1,
        }
        place = "start" if level.upright else "end"
        yield {
            "type": "line", **(across if level.upright else along),
            "line": {"color": colour(level.colour), "width": 1, "dash": "dash"},
            "label": {"text": plain(level.label), "textposition": place, "yanchor": "bottom", "padding": 2,
                      "font": {"size": 11, "color": colour(level.colour)}},
        }  # fmt: skip


def _panel_title(panel: Panel, x_name: str, y_name: str) -> Iterator[Json]:
    if panel.title:
        yield {
            "text": f"<b>{plain(panel.title)}</b>", "x": 0, "xref": f"{x_name} domain", "xanchor": "left", "y": 1,
            "yref": f"{y_name} domain", "yanchor": "bottom", "showarrow": False, "font": {"color": colour("ink")},
        }  # fmt: skip


def _space(figure: SpaceFigure) -> Json:
    layout = _base_layout()
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
    points = path.ned_m if path.texts else path.ned_m[spaced(len(path.ned_m), _SPACE_POINTS)]
    north, east, down = points.T
    modes = [
        *(["lines"] if path.dash != "none" else []),
        *(["markers"] if path.marker else []),
        *(["text"] if path.texts else []),
    ]
    return {
        "type": "scatter3d",
        "name": plain(path.name),
        **{key: numbers(values) for key, values in (("x", east), ("y", north), ("z", -down))},
        "mode": "+".join(modes) or "lines",
        "line": {"color": colour(path.colour), "width": path.width, "dash": _DASHES.get(path.dash, "solid")},
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
