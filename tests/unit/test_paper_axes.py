"""Charts of two free axes: what is drawn lies where it should, and nothing that is not finite is drawn."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_cli.experiments.paper.report_axes import BOTTOM, LEFT, RIGHT, TOP, Axis, Guide, chart, spanning
from gcs_cli.experiments.paper.report_curves import Mark
from gcs_cli.experiments.paper.report_space import Path, space_chart
from gcs_cli.report.chart import Line
from tests.support.parsed_page import parsed

SIZE = (480, 250)
UNIT = Axis("unit", 0.0, 1.0)


def points(html: str, style: str) -> np.ndarray:
    """Points of all curves of a style, in pixels."""
    found = re.findall(rf'class="line {style}" d="M([^"]+)"', html)
    return np.array([[float(part) for part in point.split(",")] for path in found for point in path.split()])


def curve(x: object, y: object, style: str = "s1") -> Line:
    return Line("a curve", np.array(x, np.float64), np.array(y, np.float64), style)


@given(st.lists(st.floats(-1e9, 1e9).filter(lambda value: not 0.0 < value < 1e-9), min_size=1), st.booleans())
def test_an_axis_holds_its_values(values: list[float], log: bool) -> None:
    axis = spanning("x", [np.array(values), np.array([math.nan, math.inf])], log=log)
    assert axis.low < axis.high
    there = [value for value in values if value > 0.0] if log else values
    if there:
        slack = 1e-9 * max(map(abs, there))  # of rounding
        assert axis.low - slack <= min(there)
        assert max(there) <= axis.high + slack


def test_corners_of_the_data_are_corners_of_the_picture() -> None:
    drawn = points(chart("a", UNIT, UNIT, [curve([0.0, 1.0], [0.0, 1.0])]), "s1")
    assert drawn.tolist() == [[LEFT, SIZE[1] - BOTTOM], [SIZE[0] - RIGHT, TOP]]


def test_equal_axes_make_a_circle_round() -> None:
    angle = np.linspace(0.0, 2.0 * math.pi, 400)
    line = curve(3.0 + np.cos(angle), 5.0 * 0.0 + np.sin(angle))
    html = chart("a", spanning("x", [line.x]), spanning("y", [line.y]), [line], equal=True)
    drawn = points(html, "s1")
    width, height = np.ptp(drawn, axis=0)
    assert width == pytest.approx(height, abs=0.2)
    assert (
        np.ptp(points(chart("a", spanning("x", [line.x]), spanning("y", [line.y]), [line]), "s1"), axis=0)[0]
        > 300
    )


def test_a_curve_that_leaves_the_axes_ends_with_a_cross() -> None:
    html = chart("a", UNIT, UNIT, [curve([0.0, 0.5, 0.6, 0.7], [0.1, 0.2, 9.0, 0.2])])
    assert len(points(html, "s1")) == 2
    assert html.count('class="cross s1"') == 1
    assert "leaves the picture" in parsed(html).text


def test_gaps_stay_gaps() -> None:
    html = chart("a", UNIT, UNIT, [curve([0.0, 0.2, 0.4, 0.6, 0.8], [0.1, 0.2, math.nan, 0.3, 0.4])])
    assert html.count('class="line s1"') == 2
    assert "cross" not in html


def test_peaks_survive_the_thinning() -> None:
    y = np.zeros(50_000)
    y[31_234] = 1.0
    html = chart("a", UNIT, UNIT, [curve(np.linspace(0.0, 1.0, len(y)), y)])
    drawn = points(html, "s1")
    assert len(drawn) < 1000
    assert drawn[:, 1].min() == TOP


def test_marks_and_guides_are_drawn_where_they_belong() -> None:
    marks = [
        Mark(0.5, 0.5, "s2", "a pole"),
        Mark(5.0, 0.5, "s2", "outside"),
        Mark(0.1, 0.1, "s2", "", dot=True),
    ]
    html = chart("a", UNIT, UNIT, [], marks=marks, guides=[Guide("limit", 0.5), Guide("far", 7.0)])
    page = parsed(html)
    assert html.count('class="cross s2"') == 1
    assert html.count('class="dot s2"') == 1
    assert "a pole" in page.text
    assert "limit" in page.text
    assert "outside" not in page.text
    assert "far" not in page.text


def test_a_logarithmic_axis_has_its_decades() -> None:
    html = chart("a", Axis("f", 1.0, 1000.0, log=True), UNIT, [curve([1.0, 10.0, 1000.0], [0.0, 0.5, 1.0])])
    x = points(html, "s1")[:, 0]
    assert (x[1] - x[0]) * 2.0 == pytest.approx(x[2] - x[1], abs=0.2)
    assert all(f">{tick}</text>" in html for tick in ("1", "10", "100", "1000"))


def test_without_data_there_is_a_sentence() -> None:
    assert "No data" in chart("a", UNIT, UNIT, [])
    assert "No data" in space_chart("a", [Path("p", np.full((3, 3), math.nan), "s1")])


def test_in_space_north_is_up_right_of_east_and_height_is_up() -> None:
    along = {
        "north": np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
        "east": np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]),
        "climb": np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -2.0]]),
    }
    html = space_chart("a", [Path(name, path, name) for name, path in along.items()])
    moved = {name: np.diff(points(html, name), axis=0)[0] for name in along}
    assert moved["north"][0] > 0.0 > moved["north"][1]  # right and up: pixels count downwards
    assert moved["east"][0] > 0.0
    assert moved["east"][1] > 0.0
    assert moved["climb"][0] == pytest.approx(0.0, abs=0.1)
    assert moved["climb"][1] < -50.0
