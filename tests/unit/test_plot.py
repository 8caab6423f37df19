"""Plots: lanes, axes, curves with gaps, values at the cursor, units and fuzzy search."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from gcs_cli.charts.canvas import rows_of_text
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.palette import DARK
from gcs_cli.tui.plot.drawing import (
    Curve,
    Lane,
    Scale,
    Span,
    cell_time,
    draw_plot,
    gutter_of,
    lanes_of,
    scale_of,
    tick_labels,
    value_at,
    value_text,
)
from gcs_cli.tui.plot.fields import FIRST_FIELDS, MOST_FIELDS, PlotFields, field_choices, value_note
from gcs_cli.tui.widgets.fuzzy import search
from gcs_cli.vehicle.field_units import enum_text, field_unit, shown_unit, shown_values
from tests.support.telemetry_frames import attitude, received

pytestmark = pytest.mark.unit

TIMES = np.linspace(0.0, 60.0, 61)
RAMP = Curve("A.ramp", "m", TIMES, TIMES / 6.0)
SPAN = Span(0.0, 60.0)


def drawn(curves, span=SPAN, width=60, height=14):
    return rows_of_text(draw_plot(curves, span, width, height, DARK).rows()).splitlines()


def dots_of(row: str) -> int:
    return sum(bin(ord(mark) - 0x2800).count("1") for mark in row if "⠀" <= mark <= "⣿")


def test_plot_has_legend_axis_and_times():
    rows = drawn([RAMP])
    assert rows[0] == " A.ramp 10.00 m"
    assert [row.split("┤")[0].strip() for row in rows if "┤" in row] == ["10", "5", "0"]
    assert rows[-2].startswith("  └")
    assert rows[-1].split("  ")[0].strip() == "−60 s"
    assert rows[-1].endswith("0 s")


def test_curve_rises_from_the_lower_left_to_the_upper_right():
    rows = drawn([RAMP])[1:12]
    assert rows[-1][3] in "⣀⡠⣠"
    assert rows[0].rstrip()[-1] in "⠉⠋⠊⠏⠁⠃"


def test_units_have_lanes_of_their_own():
    other = RAMP._replace(name="B.v", unit="m/s")
    lanes = lanes_of([RAMP, other, RAMP._replace(name="C.h")], 20)
    assert [(lane.unit, len(lane.curves), lane.top, lane.bottom) for lane in lanes] == [
        ("m", 2, 0, 9),
        ("m/s", 1, 10, 19),
    ]


def test_lanes_that_do_not_fit_are_left_out():
    curves = [RAMP._replace(unit=str(number)) for number in range(8)]
    assert len(lanes_of(curves, 12)) == 3
    assert len(lanes_of(curves, 0)) == 1


@pytest.mark.parametrize("size", [(0, 0), (1, 1), (5, 2), (20, 3), (300, 90)])
def test_any_size_is_drawn(size):
    canvas = draw_plot([RAMP, RAMP._replace(unit="s")], Span(0, 60, 30.0), *size, DARK)
    assert len(canvas.rows()) == size[1]


@given(st.floats(-1e9, 1e9), st.floats(0.0, 1e9), st.integers(4, 60))
def test_axis_holds_the_values_with_at_least_two_ticks(low, size, rows):
    values = np.array([low, low + size])
    scale = scale_of(Lane("", (Curve("a", "", np.array([0.0, 1.0]), values),), 0, rows), Span(0.0, 1.0))
    slack = 1e-6 * max(1.0, abs(low) + size)
    assert scale.low <= low + slack
    assert scale.high >= low + size - slack
    assert len(scale.ticks) >= 2
    assert len(set(tick_labels(scale))) == len(scale.ticks)


@given(st.lists(st.floats(), min_size=2, max_size=9))
def test_any_values_are_drawn(values):
    curve = Curve("a", "", np.arange(len(values), dtype=np.float64), np.array(values))
    assert len(drawn([curve], Span(0.0, 9.0, 4.0), 40, 10)) <= 10


def test_axis_steps_are_one_two_five_with_needed_decimals():
    assert tick_labels(Scale(0.0, 1.0, 0.2)) == ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
    assert tick_labels(Scale(-20.0, 20.0, 20.0)) == ["-20", "0", "20"]
    assert tick_labels(Scale(0.0, 0.1, 0.05)) == ["0.00", "0.05", "0.10"]


def test_axis_of_no_samples_and_of_constants_is_finite():
    for values in (np.array([]), np.array([math.nan]), np.array([5.0]), np.array([0.0])):
        curve = Curve("a", "", np.arange(len(values), dtype=np.float64), values)
        scale = scale_of(Lane("", (curve,), 0, 9), Span(0.0, 10.0))
        assert scale.low < scale.high


def test_only_visible_samples_scale_the_axis():
    values = np.where(TIMES < 30, 1000.0, TIMES)
    scale = scale_of(Lane("", (RAMP._replace(values=values),), 0, 9), Span(35.0, 60.0))
    assert scale.high == 60.0


def test_nan_and_silence_interrupt_the_curve():
    flat = RAMP._replace(values=np.ones(61))
    whole = sum(map(dots_of, drawn([flat])))
    nan = sum(map(dots_of, drawn([flat._replace(values=np.where(abs(TIMES - 30) < 10, math.nan, 1.0))])))
    kept = abs(TIMES - 30) > 10
    silent = sum(map(dots_of, drawn([flat._replace(times_s=TIMES[kept], values=flat.values[kept])])))
    assert nan < 0.85 * whole  # measured: 0.78
    assert silent < 0.85 * whole


def test_many_samples_draw_the_same_peaks():
    times_s = np.linspace(0.0, 60.0, 50_000)
    values = np.zeros(50_000)
    values[25_000], values[40_000] = 1.0, -1.0
    rows = drawn([Curve("a", "", times_s, values)])
    assert dots_of(rows[1][3:]) > dots_of(drawn([Curve("a", "", times_s, np.zeros(50_000))])[1][3:])
    assert len({column for row in rows[1:12] for column, mark in enumerate(row[3:]) if mark in "⡇⢸⣿"}) == 2


def test_value_at_the_cursor_is_the_last_before_it():
    assert value_at(RAMP, 6.9) == 1.0
    assert value_at(RAMP, None) == 10.0
    assert math.isnan(value_at(RAMP, -1.0))
    kept = TIMES < 20
    kept[-1] = True
    gap = Curve("a", "m", TIMES[kept], RAMP.values[kept])
    assert math.isnan(value_at(gap, 40.0))
    assert value_at(gap, 19.5) == 19.0 / 6.0


def test_cursor_shows_its_time_and_the_values_there():
    rows = drawn([RAMP], Span(0.0, 60.0, 30.2))
    assert rows[0] == " A.ramp 5.000 m"
    assert "−29.80 s" in rows[-1]


@pytest.mark.parametrize("cursor_s", [29.0, 30.0, 31.0, 45.0])
def test_time_at_the_cursor_covers_no_part_of_a_label(cursor_s: float):
    labels = drawn([RAMP], Span(0.0, 60.0, cursor_s))[-1].split("s")[:-1]
    assert {float(label.replace("−", "-")) for label in labels} <= {
        -60,
        -50,
        -40,
        -30,
        -20,
        -10,
        0,
        cursor_s - 60,
    }


def test_column_of_the_cursor_gives_its_time():
    gutter = gutter_of([RAMP], SPAN, 14)
    assert cell_time(gutter, SPAN, gutter, 60 + gutter) == pytest.approx(0.5)
    assert cell_time(0, SPAN, gutter, 60) == 0.0
    assert cell_time(999, SPAN, gutter, 60) == 60.0


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (math.nan, "—"),
        (0.0, "0.000"),
        (-1e-17, "0.000"),
        (12.3456, "12.35"),
        (-1234.5, "-1234"),
        (1e8, "1.000e+08"),
    ],
)
def test_values_have_four_digits(value, text):
    assert value_text(value) == text


def test_legend_is_shorter_on_a_narrow_screen():
    assert drawn([RAMP, RAMP._replace(name="A.other")], width=30)[0] == " ramp 10.00 m   other 10.00 m"


def test_search_prefers_whole_words_at_boundaries():
    names = ["ATTITUDE.rollspeed", "ATTITUDE.roll", "SYS_STATUS.onboard_control", "POSITION.x"]
    assert [match.name for match in search("roll", names)][:2] == ["ATTITUDE.roll", "ATTITUDE.rollspeed"]
    assert [match.name for match in search("att rol", names)][:2] == ["ATTITUDE.roll", "ATTITUDE.rollspeed"]
    assert [match.name for match in search("posx", names)] == ["POSITION.x"]
    assert search("zzz", names) == []
    assert len(search("", names)) == 4


def test_search_marks_the_letters_that_match():
    (match,) = search("atro", ["ATTITUDE.roll"])
    assert [match.name[position] for position in match.positions] == list("ATro")


@given(st.text(max_size=8), st.lists(st.text(max_size=20), max_size=5))
def test_search_takes_any_text(query, names):
    assert len(search(query, names)) <= len(names)


def test_search_of_repeated_letters_is_quick():
    assert search("e" * 20, ["e" * 60, "x" * 60])[0].positions == tuple(range(20))


def test_units_are_shown_without_scale():
    message = received(
        mavlink.MAVLink_global_position_int_message(5, 473977418, 0, 488000, 0, 0, 0, 0, 65535)
    )
    assert field_unit(message, "lat") == "degE7"
    assert shown_unit("degE7")[1] == "deg"
    assert shown_values(message, "lat", np.array([473977418.0]))[0] == pytest.approx(47.3977418)
    assert shown_values(message, "alt", np.array([488000.0]))[0] == pytest.approx(488.0)
    assert value_note(message, "lat") == "47.40 deg"


def test_unknown_integers_are_gaps():
    message = received(mavlink.MAVLink_global_position_int_message(5, 0, 0, 0, 0, 0, 0, 0, 65535))
    assert math.isnan(shown_values(message, "hdg", np.array([65535.0]))[0])
    assert value_note(message, "hdg") == "— deg"


def test_enumerations_are_shown_by_name():
    heartbeat = received(mavlink.MAVLink_heartbeat_message(2, 12, 129, 0, 4, 3))
    assert enum_text(heartbeat, "system_status", 4) == "ACTIVE"
    assert enum_text(heartbeat, "type", 2) == "QUADROTOR"
    assert enum_text(heartbeat, "base_mode", 129) == "CUSTOM_MODE_ENABLED | SAFETY_ARMED"
    assert enum_text(heartbeat, "system_status", 77) == ""
    assert enum_text(heartbeat, "custom_mode", 1) == ""


def test_plotted_field_keeps_its_colour():
    fields = PlotFields()
    colour = fields.colour(FIRST_FIELDS[1])
    fields.remove(FIRST_FIELDS[0])
    assert fields.add("A.x")
    assert fields.colour(FIRST_FIELDS[1]) == colour
    assert fields.colour("A.x") not in {fields.colour(name) for name in FIRST_FIELDS}
    for number in range(MOST_FIELDS):
        added = fields.add(f"B.{number}")
    assert not added
    assert len(fields.names) == MOST_FIELDS
    fields.clear()
    assert fields.names == ()


def test_curves_of_received_and_missing_fields():
    history, fields = History(), PlotFields()
    for step in range(3):
        history.record(attitude(0.1 * step), 10.0 + step)
    curves = {curve.name: curve for curve in fields.curves(history, 1)}
    assert curves["ATTITUDE.roll"].unit == "deg"
    assert curves["ATTITUDE.roll"].values == pytest.approx(np.degrees([0.0, 0.1, 0.2]), abs=1e-5)
    assert len(curves["VFR_HUD.alt"].values) == 0
    choices = {choice.name: choice for choice in field_choices(history, 1, fields)}
    assert choices["ATTITUDE.roll"].note() == "11.46 deg"
    assert choices["ATTITUDE.yaw"].colour is None
    assert choices["VFR_HUD.alt"].note() == "not received"


def test_search_tries_each_start_of_a_word_once() -> None:
    name = "ab" * 100
    assert search("ab" * 30 + "c", [name]) == []  # with one try per choice of letters it would not end
    assert search("ab" * 30, [name])[0].positions == tuple(range(60))
