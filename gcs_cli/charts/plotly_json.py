"""A figure as the JSON that plotly.js draws. Pure; plotly's Python package is not used.

Colours are CSS variables, ``var(--s1)``, which charts.js replaces by those of the page's light or dark scheme.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from gcs_cli.charts.decimate import drawn_samples
from gcs_cli.charts.figure import AnyFigure, Axis, Band, Bars, Figure, Level, Panel, Series, SpaceFigure
from gcs_cli.charts.plotly_parts import MARGIN, Json, base_layout, colour, dash_of, mode_of, numbers, plain
from gcs_cli.charts.plotly_space import space_json

_GAP_PX, _TITLE_PX = 16, 30
"""Between rows of panels: without, and with tick labels and a title."""
_BAND_LABEL_PX, _PAGE_PX = 7.0, 900.0
"""Width of a character, and of a chart on a wide page: a band that is too short for its label has none."""
_TEXT_PLACES = ("bottom left", "top right")
"""Places of successive texts beside their points: two points that lie close together have theirs apart."""


def chart_json(figure: AnyFigure) -> str:
    """Return data, layout and what charts.js needs besides as JSON that is safe within a script element."""
    content = space_json(figure) if isinstance(figure, SpaceFigure) else _plane(figure)
    content["file"] = figure.name
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _plane(figure: Figure) -> Json:
    data: list[Json] = []
    layout = base_layout()
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
    layout["height"] = inner_px + MARGIN["t"] + MARGIN["b"]
    layout["barmode"] = "overlay"
    return {"data": data, "layout": layout, "linked": figure.linked}


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
        yield {
            **_bar_trace(bars, panel.y.unit),
            "xaxis": x_name,
            "yaxis": y_name,
            "showlegend": len(panel.bars) > 1,
        }


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
    found: Json = {
        "type": "scatter",
        "name": plain(series.name),
        "x": numbers(x, 8),
        "y": numbers(y),
        "mode": mode_of(series),
        "line": {"color": colour(series.colour), "width": series.width, "dash": dash_of(series.dash)},
        "hovertemplate": read_out,
    }  # fmt: skip
    if series.marker:
        found["marker"] = {"symbol": series.marker, "size": 7, "color": colour(series.colour)}
    if series.filled:
        found |= {"fill": "toself", "opacity": 0.7, "hoverinfo": "skip"}
        found.pop("hovertemplate")
        found["fillcolor"] = colour("even")
    if series.texts:
        places = [_TEXT_PLACES[number % len(_TEXT_PLACES)] for number in range(len(series.texts))]
        found |= {"text": [plain(text) for text in series.texts], "textposition": places}
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
        "y": [height or None for height in numbers(bars.heights)],
        # the line keeps a bar visible however small its share
        "marker": {"color": colour(bars.colour), "line": {"width": 1.5, "color": colour(bars.colour)}},
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
