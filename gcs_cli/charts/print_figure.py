"""A figure as PDF, SVG or PNG for print, drawn by matplotlib. The same figure gives the same bytes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Canvas

from flightstack.core.atomic_file import replacing
from gcs_cli.charts.decimate import decimated, finite_runs
from gcs_cli.charts.figure import LIGHT, AnyFigure, Axis, Dash, Figure, Panel, Series, Shape, SpaceFigure

WIDTH_IN = 7.0
"""Of a text column of A4."""
_PX_PER_IN = 110.0
_SPACE_HEIGHT_IN = 4.6
_BAND_LABEL = 0.011
"""Width of a character as a share of the axis."""
_DASHES: dict[Dash, Any] = {
    "solid": "-", "dash": (0, (5, 2)), "dot": (0, (1, 1.5)), "dashdot": (0, (5, 2, 1, 2)), "longdash": (0, (9, 2.5)),
    "none": "",
}  # fmt: skip
_MARKERS: dict[Shape, str] = {
    "": "", "circle": "o", "x": "x", "cross": "+", "diamond": "D", "square": "s", "triangle-up": "^",
    "circle-open": "o",
}  # fmt: skip
_SETTINGS = {
    "svg.hashsalt": "flightstack",
    "pdf.fonttype": 42,
    "font.size": 8.0,
    "axes.edgecolor": LIGHT["axis"],
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "grid.color": LIGHT["line"],
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "path.simplify": False,
}
_NO_DATES = {
    ".pdf": {"CreationDate": None, "ModDate": None},
    ".svg": {"Date": None},
    ".png": {"Software": None},
}


def write_figure(path: Path, figure: AnyFigure, width_in: float = WIDTH_IN) -> None:
    """Write the figure in the format of the suffix, .pdf, .svg or .png; raise OSError or ValueError."""
    metadata = _NO_DATES.get(path.suffix)
    if metadata is None:
        raise ValueError(f"{path}: expected .pdf, .svg or .png")
    with mpl.rc_context(_SETTINGS):
        canvas = (
            _space(figure, width_in) if isinstance(figure, SpaceFigure) else plane_canvas(figure, width_in)
        )
        with replacing(path) as temporary:
            canvas.savefig(temporary, format=path.suffix[1:], metadata=metadata, dpi=200)


def _band_labels(axes: Any, panel: Panel) -> None:
    """Name the bands that have room for it."""
    low, high = axes.get_xlim()
    for band in panel.bands:
        if (band.end - band.start) / (high - low) > _BAND_LABEL * len(band.label):
            axes.text(0.5 * (band.start + band.end), 1.01, band.label, transform=axes.get_xaxis_transform(),
                      ha="center", va="bottom", fontsize=6.5, color=LIGHT["soft"])  # fmt: skip


def plane_canvas(figure: Figure, width_in: float) -> Canvas:
    """Return the printed panels of a figure, ``width_in`` inches wide."""
    rows = math.ceil(len(figure.panels) / figure.columns)
    height_in = rows * (figure.height / _PX_PER_IN) + 0.7
    canvas = Canvas(figsize=(width_in, height_in), layout="constrained")
    grid = canvas.subplots(
        rows, figure.columns, squeeze=False, sharex="col" if figure.linked else False
    ).ravel()
    for axes, panel in zip(grid, figure.panels, strict=False):
        _panel(axes, panel)
        if panel is figure.panels[0] or not figure.linked:
            _band_labels(axes, panel)
        if figure.linked and not axes.get_subplotspec().is_last_row():
            axes.set_xlabel("")  # the row below has it; y differs from column to column
    for axes in grid[len(figure.panels) :]:
        axes.set_visible(False)
    _legend(canvas, [axes.get_legend_handles_labels() for axes in grid])
    return canvas


def _legend(canvas: Canvas, found: list[tuple[list[Any], list[str]]]) -> None:
    """Show each curve once, above the panels."""
    entries = {
        label: handle for handles, labels in found for handle, label in zip(handles, labels, strict=True)
    }
    if entries:
        canvas.legend(
            list(entries.values()), list(entries), loc="outside upper left", ncols=min(len(entries), 6)
        )


def _panel(axes: Any, panel: Panel) -> None:
    axes.set_xlabel(panel.x.title)
    axes.set_ylabel(panel.y.title)
    if panel.title:
        axes.set_title(panel.title, loc="left", fontsize=8.0, fontweight="bold")
    axes.set_xscale("log" if panel.x.log else "linear")
    axes.set_yscale("log" if panel.y.log else "linear")
    for index, band in enumerate(panel.bands):
        axes.axvspan(band.start, band.end, color=LIGHT["even" if index % 2 else "odd"], linewidth=0)
    for series in panel.series:
        _series(axes, series, panel.y.log)
    for bars in panel.bars:
        axes.bar(np.array(bars.edges[:-1]), bars.heights, np.diff(bars.edges), align="edge", color=LIGHT[bars.colour],
                 edgecolor="white", linewidth=0.4, label=bars.name if len(panel.bars) > 1 else None)  # fmt: skip
    for level in panel.levels:
        (axes.axvline if level.upright else axes.axhline)(
            level.at, color=LIGHT[level.colour], linewidth=0.7, linestyle=(0, (4, 3))
        )
        _level_text(axes, level.label, level.at, level.upright, LIGHT[level.colour])
    _limits(axes, panel.x, panel.y)
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim")


def _level_text(axes: Any, label: str, at: float, upright: bool, colour: str) -> None:
    if upright:
        axes.text(
            at, 1.0, f" {label}", transform=axes.get_xaxis_transform(), va="top", fontsize=6.5, color=colour
        )
    else:
        axes.text(1.0, at, label, transform=axes.get_yaxis_transform(), ha="right", va="bottom", fontsize=6.5,
                  color=colour)  # fmt: skip


def _limits(axes: Any, x: Axis, y: Axis) -> None:
    axes.set_xlim(x.low, x.high, auto=None)
    axes.set_ylim(y.low, y.high, auto=None)


def _series(axes: Any, series: Series, log: bool) -> None:
    colour, label = LIGHT[series.colour], series.name if series.in_legend else None
    if series.filled:
        axes.fill(series.x, series.y, color=colour, alpha=0.12, linewidth=0)
    y = np.where(series.y > 0.0, series.y, np.nan) if log else series.y
    marks = series.dash == "none"
    runs = [(series.x, y)] if marks else [_thinned(*run) for run in finite_runs(series.x, y)]
    for x, part in runs:
        axes.plot(x, part, color=colour, linewidth=0.65 * series.width, linestyle=_DASHES[series.dash], label=label,
                  marker=_MARKERS[series.marker], markersize=3.5,
                  markerfacecolor="none" if series.marker == "circle-open" else colour)  # fmt: skip
        label = None
    for x, y_at, text in zip(series.x, series.y, series.texts, strict=False):
        axes.annotate(text, (x, y_at), (3, 3), textcoords="offset points", fontsize=7)


def _thinned(x: Any, y: Any) -> tuple[Any, Any]:
    return decimated(x, y) if bool(np.all(np.diff(x) >= 0.0)) else (x, y)


def _space(figure: SpaceFigure, width_in: float) -> Canvas:
    canvas = Canvas(figsize=(width_in, _SPACE_HEIGHT_IN), layout="constrained")
    axes: Any = canvas.add_subplot(projection="3d")
    for path in figure.paths:
        north, east, down = path.ned_m.T
        axes.plot(east, north, -down, color=LIGHT[path.colour], linewidth=0.4 * path.width,
                  linestyle=_DASHES[path.dash], marker=_MARKERS[path.marker], markersize=3.0,
                  label=path.name if path.in_legend else None)  # fmt: skip
        for x, y, z, text in zip(east, north, -down, path.texts, strict=False):
            axes.text(x, y, z, f" {text}", fontsize=7)
    axes.set(xlabel="east [m]", ylabel="north [m]", zlabel="height [m]")
    if not figure.empty:
        axes.set_aspect("equal", adjustable="datalim")
    _legend(canvas, [axes.get_legend_handles_labels()])
    return canvas
