"""The flight report: sound HTML, complete, and in need of nothing from outside."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import FsLoopTiming
from flightstack.mavlink.link import Link
from flightstack.plan import Plan
from gcs_cli.link.tlog_file import TlogFile
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.chart import Level, Line, decimated, time_chart
from gcs_cli.report.conditions import conditions
from gcs_cli.report.flight_data import Flight, Text, loop_timing, series
from gcs_cli.report.page import render_report, write_report
from gcs_cli.report.plots import mode_bands, plots
from gcs_cli.report.summary import RunInfo, summarise
from gcs_cli.report.svg import nice_ticks, tick_text
from gcs_cli.report.timing import read_loop_timing
from tests.support.parsed_page import parsed
from tests.support.square_plan import square_plan
from tests.support.synthetic_flight import synthetic_flight_bytes


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    path = tmp_path_factory.mktemp("log") / "flight.ulg"
    path.write_bytes(synthetic_flight_bytes(inner_ms=10, outer_ms=20))
    return read_flight(path)


def timing_row(time_s: float, real_time: bool = False) -> object:
    return loop_timing(time_s, 500.0, (14.0, 22.0, 180.0, 3.0, 9.0, 60.0), int(real_time))


def report(
    flight: Flight, plan: Plan | None = None, timings: list | None = None, outcome: str = "completed"
) -> str:
    plan = plan or square_plan()
    summary = summarise(flight, plan, RunInfo(outcome, "missions/square.plan", 1.2, seed=1))
    return render_report(flight, plan, summary, timings or [])


def test_the_report_shows_every_part_of_the_flight(flight: Flight) -> None:
    page = parsed(report(flight, timings=[timing_row(1.0), timing_row(2.0)]))
    assert page.tags.count("svg") == 8  # map, altitude, three angles, rotors, tracking, timing
    for part in (
        "Path from above", "Altitude", "Attitude", "Rotor speeds", "Tracking error", "Loop timing", "Plan",
        "Messages", "completed", "6 of 6", "paper_quad", "highest 303", "lowest 30", "period 2000 µs",
        "Reached item 3", "home, 0, 4, 5", "takeoff", "mission", "closest approach",
    ):  # fmt: skip
        assert part in page.text, part
    assert page.text.count("accepted within 1 m") == 4


def test_the_report_needs_nothing_from_outside_and_is_small(flight: Flight) -> None:
    html = report(flight, timings=[timing_row(1.0)])
    page = parsed(html)
    assert not re.search(r"https?:|//\w|@import|url\(", html)
    assert {name for name, _ in page.attributes}.isdisjoint({"src", "href", "srcset", "data", "onload"})
    assert {"script", "link", "iframe", "img"}.isdisjoint(page.tags)
    assert len(html) < 400_000  # 190 kB measured


def test_no_coordinate_is_without_a_number(flight: Flight) -> None:
    assert not re.search(r"\b(nan|inf)\b", report(flight), re.IGNORECASE)


def test_a_flight_without_loop_timing_says_so(flight: Flight) -> None:
    assert "No loop timing was received" in parsed(report(flight)).text


def test_real_time_shows_lateness_too(flight: Flight) -> None:
    text = parsed(report(flight, timings=[timing_row(1.0, True), timing_row(2.0, True)])).text
    assert "lateness of a tick" in text
    assert "lockstep" not in text


def test_the_head_says_under_what_it_flew(flight: Flight) -> None:
    run = RunInfo(
        "completed", "missions/square.plan", controller="backstepping", gains="paper", plant="multibody", seed=7,
        inner_hz=1000.0, outer_hz=250.0, wind="5,-3", gust=1.0, torque_gust=0.1, battery_start=60.0,
        battery_drain=20.0, faults=("rotor:2:off@8", "state:freeze@9"), ideal_rotors=True, params="my.params",
    )  # fmt: skip
    head = render_report(flight, square_plan(), summarise(flight, square_plan(), run), [])
    head = head.partition("<header>")[2].partition("</header>")[0]
    assert "vehicle paper_quad · controller backstepping, gains paper · loops in python" in head
    assert "1000 and 250 Hz · plant multibody" in head
    assert (
        "wind 5 m/s north, −3 m/s east · gusts 1 m/s · gusty torque 0.1 N m · battery from 60 % · battery drained "
        "20 times as fast · fault rotor:2:off@8 · fault state:freeze@9 · rotors without lag and limits · parameters of "
        "my.params · seed 7" in head
    )
    assert "no wind, no faults · seed 1" in report(flight)


def test_the_setpoint_is_not_drawn_while_the_vehicle_stands_landed(flight: Flight) -> None:
    """It sinks into the ground then, to hold the vehicle there."""
    time_s, touchdown = flight.position_setpoint.time_s, 34.0
    ends = replace(flight, landed=(*flight.landed[:-1], (touchdown, True)))

    def with_setpoint(down_m: float, from_s: float) -> str:
        values = flight.position_setpoint.values.copy()
        values[time_s >= from_s, 2] = down_m
        return report(replace(ends, position_setpoint=series(time_s.copy(), values)))

    assert ends.standing(np.array([0.0, 5.0, touchdown - 1.0, 40.0])).tolist() == [False, False, False, True]
    assert with_setpoint(7.5, touchdown) == with_setpoint(-7.5, touchdown)
    assert with_setpoint(7.5, touchdown - 5.0) != with_setpoint(-7.5, touchdown - 5.0)


def test_a_run_without_a_log_has_a_report() -> None:
    page = parsed(report(Flight(), Plan(()), outcome="vehicle lost: no heartbeat for 5 s"))
    assert page.text.count("No data.") == 7
    assert "vehicle lost: no heartbeat for 5 s" in page.text
    assert "The vehicle sent no messages." in page.text


def test_values_that_are_no_numbers_leave_gaps_only() -> None:
    bad = np.array([0.0, math.nan, 1.0, math.inf, 2.0, 3.0])
    time_s = np.arange(6.0)
    angles = series(time_s, np.column_stack([bad] * 3))
    position = series(time_s.copy(), np.column_stack([bad] * 3))
    nothing = series(time_s.copy(), np.full((6, 3), math.nan))
    for target in (angles, nothing):
        html = report(
            Flight(6.0, position=position, attitude=angles, attitude_target=target, rotor_speed=angles)
        )
        parsed(html)
        assert not re.search(r"[\"\s,](nan|inf|-inf)[\"\s,]", html)


def test_texts_are_escaped(flight: Flight) -> None:
    nasty = "<script>alert('1')</script> & \"more\""
    hostile = Flight(texts=(Text(0.0, 2, nasty),), info={"vehicle": nasty, "controller": nasty})
    page = parsed(report(hostile, Plan(()), outcome=nasty))
    assert "script" not in page.tags
    assert page.text.count(nasty) >= 4


def test_modes_are_bands_while_armed(flight: Flight) -> None:
    bands = [(round(band.start, 3), round(band.end, 3), band.label) for band in mode_bands(flight)]
    assert bands == [(1.0, 6.2, "takeoff"), (6.2, 30.2, "mission"), (30.2, 35.0, "land")]


def test_loop_timing_comes_from_the_telemetry_log(tmp_path: Path, flight: Flight) -> None:
    tlog, out = tmp_path / "gcs.tlog", tmp_path / "report.html"
    link = Link(1, 1)
    with TlogFile(tlog) as log:
        for second in range(3):
            values = [
                second * 1_000_000,
                500 * second,
                0,
                0,
                500.0,
                100.0,
                50.0,
                12.0,
                20.0,
                90.0,
                0,
                0,
                0,
                0,
            ]
            log.write(1_760_000_000_000_000 + second, link.encode(FsLoopTiming(*values)))
    timings = read_loop_timing(tlog)
    assert [timing.time_s for timing in timings] == [0.0, 1.0, 2.0]
    assert (timings[0].period_us, timings[0].execution_max_us, timings[0].real_time) == (2000.0, 90.0, False)
    summary = summarise(flight, square_plan(), RunInfo("completed", "square.plan"))
    write_report(out, flight, square_plan(), summary, tlog)
    assert "period 2000 µs" in out.read_text(encoding="utf-8")
    write_report(out, flight, square_plan(), summary, tmp_path / "missing.tlog")
    assert "No loop timing" in out.read_text(encoding="utf-8")


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
    x = np.arange(100_000.0)
    assert decimated(x, y)[1].max() == 7.0


@settings(max_examples=100)
@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(3, 12))
def test_ticks_are_round_few_and_inside(low: float, span: float, count: int) -> None:
    ticks = nice_ticks(low, low + span, count)
    slack = 1e-6 * span + 1e-9 * abs(low)
    assert all(low - slack <= tick <= low + span + slack for tick in ticks)
    assert len(ticks) <= count + 2


def test_tick_texts() -> None:
    assert [tick_text(value) for value in (0.0, -0.0, -2.5, 1000.0, 0.1 + 0.2)] == [
        "0",
        "0",
        "−2.5",
        "1000",
        "0.3",
    ]


def test_a_logarithmic_chart_leaves_out_what_is_not_positive() -> None:
    line = Line("mean", np.array([0.0, 1.0, 2.0]), np.array([0.0, 10.0, 100.0]), "s1")
    svg = time_chart("timing", "[µs]", [line], (0.0, 2.0), levels=[Level("period", 2000.0)], log=True)
    assert svg.count("<circle") == 2
    ticks = re.findall(r'class="tick y"[^>]*>([^<]*)<', svg)
    assert ticks == ["10", "100", "1000", "10000"]


def test_a_report_without_a_log_claims_nothing_about_the_rotors() -> None:
    assert "no limits" not in "".join(plots(Flight(), Plan(()), (), None))


def test_report_names_force_torque_and_parameters() -> None:
    summary = {"force_n": [1.0, 0.0, -0.5], "torque_n_m": [0.0, 0.0, 0.1], "param": ["RTL_TYPE=0"]}
    assert conditions(summary) == [
        "force 1 N north, 0 N east, −0.5 N down",
        "torque 0 N m roll, 0 N m pitch, 0.1 N m yaw",
        "RTL_TYPE=0",
    ]
