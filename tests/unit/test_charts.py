"""The chart layer: what is drawn is what was given, on pages and in print."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_cli.charts import print_figure
from gcs_cli.charts.decimate import decimated, drawn_samples
from gcs_cli.charts.figure import (
    AnyFigure,
    Axis,
    Band,
    Bars,
    Figure,
    Level,
    Panel,
    Playback,
    Series,
    SpaceFigure,
    SpacePath,
)
from gcs_cli.charts.pages import render_page
from gcs_cli.charts.plotly_json import chart_json
from gcs_cli.charts.plotly_parts import numbers
from gcs_cli.charts.print_figure import write_figure


def curve(x: object, y: object, name: str = "a curve", colour: str = "s1") -> Series:
    return Series(name, np.array(x, np.float64), np.array(y, np.float64), colour)


def figure(*panels: Panel, linked: bool = False) -> Figure:
    return Figure("name", "Title", panels, "What it shows.", linked=linked)


def drawn(described: AnyFigure) -> dict:
    return json.loads(chart_json(described))


SPACE = SpaceFigure(
    "space",
    "Space",
    [SpacePath("flown", np.array([[1.0, 2.0, -3.0], [4.0, 5.0, -6.0]]))],
    playback=Playback(np.array([0.0, 1.0]), np.array([[1.0, 2.0, -3.0], [4.0, 5.0, -6.0]]), np.zeros((2, 3))),
)
HISTOGRAM = figure(
    Panel(Axis("share", "%"), x=Axis("cost", "ns"), bars=[Bars("steps", (1.0, 2.0, 4.0), (30.0, 70.0))])
)


@settings(max_examples=60)
@given(st.integers(1, 3000), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_decimation_keeps_peaks_order_and_ends(count: int, buckets: int, seed: int) -> None:
    x, y = np.arange(count, dtype=float), np.random.default_rng(seed).normal(size=count)
    kept_x, kept_y = decimated(x, y, buckets)
    assert len(kept_x) <= max(count if count <= 2 * buckets else 0, 2 * buckets + 2)
    assert (np.diff(kept_x) > 0).all()
    assert (y[kept_x.astype(int)] == kept_y).all()
    assert (kept_x[0], kept_x[-1]) == (0, count - 1)
    assert (kept_y.max(), kept_y.min()) == (y.max(), y.min())


def test_a_single_spike_in_a_long_flight_is_drawn() -> None:
    y = np.zeros(100_000)
    y[54_321] = 7.0
    [trace] = drawn(figure(Panel(Axis("y"), [curve(np.arange(100_000.0), y)])))["data"]
    assert max(trace["y"]) == 7.0
    assert len(trace["y"]) < 2000


def test_values_that_are_not_finite_are_gaps() -> None:
    x, y = drawn_samples(np.arange(6.0), np.array([math.nan, 1.0, 2.0, math.inf, 3.0, math.nan]))
    assert np.isnan(y).tolist() == [False, False, True, False]
    assert x[np.isfinite(x)].tolist() == [1.0, 2.0, 4.0]
    [trace] = drawn(figure(Panel(Axis("y"), [curve(range(3), [1.0, math.nan, 2.0])])))["data"]
    assert trace["y"] == [1.0, None, 2.0]


def test_logarithmic_panel_leaves_out_values_not_above_zero() -> None:
    panel = Panel(
        Axis("t", "µs", log=True), [curve(range(3), [0.0, 10.0, 100.0])], levels=[Level("period", 2000.0)]
    )
    content = drawn(figure(panel))
    assert content["data"][0]["y"] == [10.0, 100.0]
    low, high = content["layout"]["yaxis"]["range"]
    assert low < 1.0 and high > math.log10(2000.0)  # noqa: PT018


def test_panels_share_their_time_axis_and_a_legend_entry() -> None:
    panels = [Panel(Axis(name), [curve([0.0, 1.0], [0.0, 1.0])]) for name in ("roll", "pitch")]
    content = drawn(figure(*panels, linked=True))
    assert [(trace["xaxis"], trace["yaxis"]) for trace in content["data"]] == [("x", "y"), ("x", "y2")]
    assert [trace["showlegend"] for trace in content["data"]] == [True, False]
    assert [trace["hovertemplate"].partition(":")[0] for trace in content["data"]] == ["roll", "pitch"]
    assert "xaxis2" not in content["layout"]
    assert content["layout"]["yaxis"]["domain"][0] > content["layout"]["yaxis2"]["domain"][1]


def test_levels_bands_and_axes_are_labelled() -> None:
    panel = Panel(
        Axis("speed", "rad/s"),
        [curve([0.0, 9.0], [1.0, 2.0])],
        levels=[Level("highest", 3.0)],
        bands=[Band(0.0, 9.0, "hold")],
    )
    layout = drawn(figure(panel))["layout"]
    assert layout["yaxis"]["title"]["text"] == "speed [rad/s]"
    assert layout["xaxis"]["title"]["text"] == "time [s]"
    assert layout["annotations"][0]["text"] == "hold"
    assert {shape.get("label", {}).get("text") for shape in layout["shapes"]} == {None, "highest"}
    assert layout["yaxis"]["range"][1] > 3.0


def test_texts_of_two_points_that_lie_close_together_are_apart() -> None:
    places = replace(curve([0.0, 0.1, 5.0], [0.0, 0.0, 5.0]), texts=["home", "1", "2"])
    (trace,) = drawn(figure(Panel(Axis("north", "m"), [places])))["data"]
    assert trace["textposition"] == ["bottom left", "top right", "bottom left"]


def test_bars_lie_between_their_edges() -> None:
    [trace] = drawn(HISTOGRAM)["data"]
    assert (trace["x"], trace["width"], trace["y"]) == ([1.5, 3.0], [1.0, 2.0], [30.0, 70.0])


def test_space_has_east_right_north_ahead_and_height_up() -> None:
    content = drawn(SPACE)
    path, vehicle = content["data"]
    assert (path["x"], path["y"], path["z"]) == ([2.0, 5.0], [1.0, 4.0], [3.0, 6.0])
    assert vehicle["x"] == []
    assert content["playback"]["up"] == [3.0, 6.0]


def test_hostile_names_stay_text(tmp_path: Path) -> None:
    nasty = "</script><script>alert(1)</script><b>"
    described = figure(Panel(Axis(nasty), [curve([0.0], [0.0], nasty)], title=nasty))
    assert "<" not in chart_json(described)
    assert drawn(described)["data"][0]["name"].startswith("&lt;/script>")


def test_page_holds_plotly_once_and_loads_nothing(tmp_path: Path) -> None:
    (tmp_path / "demo.html").write_text(
        '{% extends "page.html" %}{% import "parts.html" as parts with context %}'
        "{% block title %}a{% endblock %}{% block body %}{% for f in figures %}{{ parts.figure_card(f) }}{% endfor %}"
        "{% endblock %}"
    )
    page = render_page(tmp_path, "demo.html", figures=[SPACE, HISTOGRAM, figure(Panel(Axis("none")))])
    assert page.startswith("<!doctype html>")
    assert page.count("* plotly.js v") == 1
    own = page.partition("<script>/**")[0] + page.rpartition("<script>")[2]
    assert "http" not in own
    assert " src=" not in own
    assert page.count("No data.") == 1
    assert page == render_page(tmp_path, "demo.html", figures=[SPACE, HISTOGRAM, figure(Panel(Axis("none")))])


def test_a_page_is_made_without_plotlys_python() -> None:
    program = (
        "import sys; from gcs_cli.charts.pages import _plotly_js; assert len(_plotly_js()) > 10**6;"
        "print([name for name in sys.modules if name.split('.')[0] in ('plotly', 'matplotlib')])"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize("suffix", [".pdf", ".svg"])
@pytest.mark.parametrize("described", [HISTOGRAM, SPACE], ids=["bars", "space"])
def test_printed_figures_repeat_byte_for_byte(described: AnyFigure, suffix: str, tmp_path: Path) -> None:
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    write_figure(first, described)
    write_figure(second, described)
    assert first.read_bytes() == second.read_bytes()
    assert len(first.read_bytes()) > 5000


def test_print_of_linked_panels_keeps_each_y_axis() -> None:
    panels = [Panel(Axis(name, "m"), [curve([0.0, 1.0], [0.0, 1.0])]) for name in "abcd"]
    canvas = print_figure.plane_canvas(Figure("linked", "Linked", panels, columns=2, linked=True), 7.0)
    canvas.draw_without_rendering()
    assert [axes.get_ylabel() for axes in canvas.axes] == ["a [m]", "b [m]", "c [m]", "d [m]"]
    assert [axes.get_xlabel() for axes in canvas.axes] == ["", "", "time [s]", "time [s]"]
    assert all(axes.yaxis.get_ticklabels()[0].get_visible() for axes in canvas.axes)


def test_rare_bar_of_a_histogram_stays_visible() -> None:
    """A bar of no visible height is drawn by its line; an empty one is not drawn."""
    bars = Bars("cost", [0.0, 1.0, 2.0, 3.0], [99.999, 0.0, 0.001])
    (trace,) = json.loads(chart_json(Figure("costs", "Costs", [Panel(Axis("share", "%"), bars=[bars])])))[
        "data"
    ]
    assert trace["y"][1] is None
    assert trace["y"][2] > 0.0
    assert trace["marker"]["line"]["width"] >= 1.5
    assert trace["marker"]["line"]["color"] == trace["marker"]["color"]


@given(
    st.lists(st.floats(-1e12, 1e12) | st.sampled_from([math.nan, math.inf, -math.inf])),
    st.sampled_from([4, 6, 7, 8]),
)
def test_numbers_are_those_that_the_text_with_these_digits_names(values: list[float], digits: int) -> None:
    """A half of the last digit may be rounded either way. Smaller values may lose digits, which no chart shows."""
    shown = [value for value in values if not 0.0 < abs(value) < 1e-15]
    for value, number in zip(shown, numbers(np.array(shown), digits), strict=True):
        if math.isfinite(value):
            assert number == float(f"{number:.{digits}g}")
            assert abs(number - value) <= 0.5001 * 10.0 ** (1 - digits) * abs(value)
        else:
            assert number is None
