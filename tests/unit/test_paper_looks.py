"""What the eye cannot tell in the paper's report is said or drawn apart: hidden curves, crowded poles, slow growth."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gcs_cli.experiments.paper.linear.gains import AttitudeGains
from gcs_cli.experiments.paper.linear.sampled import Actuators, AttitudeTick
from gcs_cli.experiments.paper.report_alike import alike, hidden_note
from gcs_cli.experiments.paper.report_lag import INNER_HZ, beyond_note, doubling_time_s
from gcs_cli.experiments.paper.report_metrics import metrics_cells
from gcs_cli.experiments.paper.report_onset import onset_table
from gcs_cli.experiments.paper.report_poles import pole_maps
from gcs_cli.pil.histogram_chart import histogram_chart
from gcs_cli.pil.profile import StageProfile
from gcs_cli.report.chart import Line
from tests.support.paper_flights import linear_part, onset_part
from tests.support.parsed_page import parsed

TIME = np.linspace(0.0, 1.0, 101)


def line(label: str, y: np.ndarray) -> Line:
    return Line(label, TIME[: len(y)], y, "s1")


@given(st.floats(0.0, 0.03))
def test_curves_closer_than_a_hundredth_of_the_chart_are_one(apart: float) -> None:
    reach = 0.01 * 2.0  # c goes from 0 to 2, which is the chart's height
    assume(abs(apart - reach) > 1e-9)
    found = alike([line("a", TIME), line("b", TIME + apart), line("c", 2.0 * TIME)])
    assert found == ([("a", "b")] if apart <= reach else [])


def test_a_curve_that_ends_early_is_not_on_top_of_a_whole_one() -> None:
    assert alike([line("a", TIME), line("b", TIME[:50])]) == []
    assert alike([]) == []


def test_hidden_curves_are_named_with_their_charts() -> None:
    same, other = [line("a", TIME), line("b", TIME)], [line("a", TIME), line("b", -TIME)]
    assert hidden_note({"x": same, "y": same, "z": other}) == "On top of each other: a = b (x, y)."
    assert hidden_note({"z": other}) == ""
    assert hidden_note({"x": [*same, line("c", TIME)]}) == "On top of each other: all (x)."


def test_slow_poles_of_x_are_drawn_once_more_by_themselves() -> None:
    loops = linear_part()["loops"]
    assert "slower" not in pole_maps(loops)  # two poles, close together
    loops[0]["axes"]["x"] = {"poles": [[-1.0, 2.0], [-1.0, -2.0], [-80.0, 0.0]]}
    maps = pole_maps(loops)
    closer = maps[maps.index("x (north): poles slower") :].split("</svg>")[0]
    assert maps.count("slower than") == 1
    assert closer.count('class="cross s1"') == 2
    assert "−80" not in closer


def test_loops_are_told_apart_by_shape_where_they_share_a_pole() -> None:
    loops = linear_part()["loops"]
    loops.append({**loops[0], "controller": "backstepping"})
    shapes = re.findall(r'class="cross (s\d)"[^>]* d="([^"]+)"', pole_maps(loops))
    of = {style: re.sub(r"^M[\d.,]+", "", shape) for style, shape in shapes}
    assert set(of) == {"s1", "s2"}
    assert of["s1"] != of["s2"]


@pytest.mark.parametrize("lag_s", [0.03, 0.05])
def test_a_swing_doubles_in_the_time_that_is_told(lag_s: float) -> None:
    gains = AttitudeGains(400.0, 0.0, 10.0, 0.0, 0.0)
    doubling_s = doubling_time_s(gains, lag_s)
    assert doubling_s is not None
    step = np.abs(AttitudeTick(gains, INNER_HZ, Actuators(0, lag_s)).step_response(4001, 0.0, 1e-3))
    tops = np.flatnonzero((step[1:-1] > step[:-2]) & (step[1:-1] >= step[2:])) + 1
    first, last = tops[len(tops) // 2], tops[-1]
    doublings = math.log2(step[last] / step[first])
    assert (last - first) / INNER_HZ / doublings == pytest.approx(doubling_s, rel=0.02)


def test_a_loop_that_bears_the_lag_is_not_spoken_of() -> None:
    assert doubling_time_s(AttitudeGains(100.0, 0.0, 16.0, 0.0, 0.0), 0.02) is None
    loops = linear_part()["loops"]
    assert beyond_note(loops) == ""
    weak = {**loops[0]["axes"]["roll"], "largest_lag_s": 0.0118}
    weak["gains"] = {**weak["gains"], "kp": 850.0, "kd": 10.0}
    loops[0]["axes"]["roll"] = weak
    twice = [*loops, {**loops[0], "gains": "paper_rate_fed"}]
    told = beyond_note(twice)
    assert told.count("With motors of 20 ms, roll φ of PID, Table II is unstable") == 1
    assert "rate fed ahead" not in told


def test_the_sign_of_a_height_is_that_of_its_figure() -> None:
    of = {
        "overshoot_percent": None, "rise_time_s": None, "settling_time_s": None,
        "steady_state_error": 0.111, "rms_error": 0.2, "max_error": 0.3,
    }  # fmt: skip
    case = {"ended": None, "metrics": {"x": of, "z": of}}  # z is down: too far down is too low
    assert "−111.0 mm" in metrics_cells(case, "z")
    assert "−111.0 mm" not in metrics_cells(case, "x")


def test_each_setting_of_the_onset_is_a_line_of_its_own() -> None:
    table = onset_table([*onset_part(), {**onset_part()[0], "setting": "motor lag"}])
    assert re.findall(r'<th colspan="5">([^<]+)</th>', table) == [
        "ideal rotors, one step of delay",
        "motor lag",
    ]
    assert table.count("roll φ") == 2


@pytest.mark.parametrize(
    ("counts", "top"), [((100,), 100), ((996, 4), 100), ((66, 34), 80), ((1, 1, 1, 1), 30)]
)
def test_the_axis_of_shares_ends_at_a_tick_above_the_tallest_bar(counts: tuple[int, ...], top: int) -> None:
    edges = tuple(float(index) for index in range(len(counts) + 1))
    chart = histogram_chart(
        StageProfile("whole", sum(counts), 0.0, 1.0, 1.0, 1.0, edges, counts), "cycles", "s1"
    )
    ticks = [float(tick) for tick in re.findall(r'class="tick y"[^>]*>([^<]+)<', chart)]
    assert max(ticks) == top
    assert "share of steps [%]" in parsed(chart).text
