"""The flight report: sound HTML, complete, and in need of nothing from outside."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flightstack.mavlink.dialect import FsLoopTiming
from flightstack.mavlink.link import Link
from flightstack.plan import Plan, load_plan
from gcs_cli.errors import DONE, USAGE
from gcs_cli.link.tlog import TlogFile
from gcs_cli.logs.ulog_reader import read_ulog
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.conditions import conditions
from gcs_cli.report.flight_charts import mode_bands, time_figures
from gcs_cli.report.flight_data import NO_LOOPS, Flight, LoopTiming, Text, loop_timing, series
from gcs_cli.report.page import render_report, write_report
from gcs_cli.report.path_charts import map_figure
from gcs_cli.report.summary import RunInfo, summarise
from gcs_cli.report.telemetry import read_loop_timing
from tests.support.commands import gcs
from tests.support.parsed_page import own_part, parsed
from tests.support.sample_logs import small_ulog
from tests.support.square_plan import square_plan
from tests.support.synthetic_flight import synthetic_flight_bytes

CHARTS = [
    "path-in-space", "path-from-above", "position", "velocity", "position-error", "attitude", "attitude-error",
    "rotor-speeds", "battery", "loop-timing-execution",
]  # fmt: skip


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    path = tmp_path_factory.mktemp("log") / "flight.ulg"
    path.write_bytes(synthetic_flight_bytes(inner_ms=10, outer_ms=20))
    return read_flight(path)


def timing_row(time_s: float, real_time: bool = False) -> LoopTiming:
    return loop_timing(time_s, 500.0, (14.0, 22.0, 180.0, 3.0, 9.0, 60.0), int(real_time))


def report(
    flight: Flight, plan: Plan | None = None, timing: Sequence[LoopTiming] = (), outcome: str = "completed"
) -> str:
    plan = plan or square_plan()
    summary = summarise(flight, plan, RunInfo(outcome, "missions/square.plan", 1.2, seed=1))
    return render_report(flight, plan, summary, timing)


def test_the_report_shows_every_part_of_the_flight(flight: Flight) -> None:
    battery = series(np.array([1.0, 2.0]), np.array([[0.9, 16.0], [0.89, 15.9]]))
    page = parsed(report(replace(flight, battery=battery), timing=[timing_row(1.0), timing_row(2.0)]))
    assert list(page.charts) == CHARTS
    for part in (
        "Path in space", "Path from above", "Position", "Attitude", "Rotor speeds", "Tracking error", "Loop timing",
        "Plan", "Messages", "completed", "6 of 6", "paper_quad", "Reached item 3", "closest approach",
    ):  # fmt: skip
        assert part in page.text, part
    drawn = str(page.charts)
    for part in ("highest 303", "lowest 30", "period 2000 µs", "home, 0, 4, 5", "takeoff", "mission"):
        assert part in drawn, part
    assert len(re.findall(r"item [123]: accepted within 1 m", drawn)) == 3
    assert page.charts["battery"]["data"][0]["y"] == [90.0, 89.0]


def test_every_chart_has_a_caption_and_linked_charts_one_range(flight: Flight) -> None:
    page = parsed(report(flight, timing=[timing_row(1.0)]))
    assert page.text.count("Setpoint minus ") == 2
    assert page.attributes.count(("class", "note")) == len(CHARTS)
    ranges = {tuple(chart["layout"]["xaxis"]["range"]) for chart in page.charts.values() if chart["linked"]}
    assert len(ranges) == 1


def test_the_report_needs_nothing_from_outside_and_is_small(flight: Flight) -> None:
    html = own_part(report(flight, timing=[timing_row(1.0)]))
    page = parsed(html)
    assert not re.search(r"https?:|@import|url\(", html)
    assert {name for name, _ in page.attributes}.isdisjoint({"src", "href", "srcset", "data", "onload"})
    assert {"link", "iframe", "img"}.isdisjoint(page.tags)
    assert len(html) < 1_200_000  # 0.9 MB measured


def test_two_reports_of_a_log_are_the_same_bytes(flight: Flight) -> None:
    assert report(flight) == report(flight)


def test_fence_and_rally_points_are_drawn(flight: Flight) -> None:
    plan = load_plan(Path(__file__).parents[2] / "missions" / "fenced_square.plan")
    flight = replace(flight, home=plan.home, local_origin=plan.home)
    charts = parsed(report(flight, plan)).charts
    for name in ("path-in-space", "path-from-above"):
        names = [trace["name"] for trace in charts[name]["data"]]
        assert {"geofence, stay inside", "geofence, stay outside", "rally points"} <= set(names), name
    [inside] = [
        curve for curve in map_figure(flight, plan, (0.0, 36.0)).panels[0].series if "inside" in curve.name
    ]
    assert (np.ptp(inside.x), np.ptp(inside.y)) == pytest.approx((50.0, 50.0), abs=0.1)


def test_errors_are_setpoint_minus_position_on_each_axis(flight: Flight) -> None:
    time_s, position = flight.position_setpoint
    shifted = series(time_s.copy(), position - np.array([0.1, 0.2, 0.3]))
    figures = {figure.name: figure for figure in time_figures(replace(flight, position=shifted))}
    means = [float(panel.series[0].y.mean()) for panel in figures["position-error"].panels]
    assert means == pytest.approx([0.1, 0.2, -0.3, math.sqrt(0.14)], abs=1e-6)


def test_a_flight_without_loop_timing_says_so(flight: Flight) -> None:
    assert "No loop timing was received" in parsed(report(flight)).text


def test_real_time_shows_lateness_too(flight: Flight) -> None:
    text = parsed(report(flight, timing=[timing_row(1.0, True), timing_row(2.0, True)])).text
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


def test_a_report_of_a_log_alone_does_not_say_that_there_was_no_wind(flight: Flight) -> None:
    summary = summarise(flight, square_plan(), RunInfo("completed", "square", seed=None))
    assert "no wind" not in render_report(flight, square_plan(), summary, [])


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
    assert page.text.count("No data.") == len(CHARTS)
    assert "no limits" not in page.text
    assert "vehicle lost: no heartbeat for 5 s" in page.text
    assert "The vehicle sent no messages." in page.text


def test_values_that_are_no_numbers_leave_gaps_only() -> None:
    bad = np.array([0.0, math.nan, 1.0, math.inf, 2.0, 3.0])
    time_s = np.arange(6.0)
    angles = series(time_s, np.column_stack([bad] * 3))
    position = series(time_s.copy(), np.column_stack([bad] * 3))
    nothing = series(time_s.copy(), np.full((6, 3), math.nan))
    loops = NO_LOOPS._replace(rotor_speed=angles)
    for target in (angles, nothing):
        html = report(
            Flight(6.0, position=position, attitude=angles, attitude_target=target, read_loops=lambda: loops)
        )
        parsed(html)
        assert not re.search(r"[\"\s,:\[](nan|inf|-inf|infinity)[\"\s,\]]", own_part(html), re.IGNORECASE)


def test_texts_are_escaped(flight: Flight) -> None:
    nasty = "<script>alert('1')</script> & \"more\""
    hostile = Flight(texts=(Text(0.0, 2, nasty),), info={"vehicle": nasty, "controller": nasty})
    page = parsed(report(hostile, Plan(()), outcome=nasty))
    assert page.tags.count("script") == 2  # plotly.js and charts.js
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
    assert read_loop_timing(tlog, 0.5)[1].time_s == 0.5


def test_log_without_samples_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "header.ulg"
    log.write_bytes(small_ulog()[:1000])
    refused = "", f"gcs: {log}: the log has no data\n", USAGE
    assert gcs("report", log) == refused
    assert gcs("log", "info", log) == refused
    assert list(tmp_path.iterdir()) == [log]


def test_log_of_unknown_topics_has_a_report(tmp_path: Path) -> None:
    content = small_ulog()
    for topic in read_ulog(content, "log").topics:
        content = content.replace(topic.kind.encode(), f"x{topic.kind[1:]}".encode())
    (tmp_path / "other.ulg").write_bytes(content)
    assert gcs("report", tmp_path / "other.ulg").returncode == DONE


def test_report_names_force_torque_and_parameters() -> None:
    summary = {"force_n": [1.0, 0.0, -0.5], "torque_n_m": [0.0, 0.0, 0.1], "param": ["RTL_TYPE=0"]}
    assert conditions(summary) == [
        "force 1 N north, 0 N east, −0.5 N down",
        "torque 0 N m roll, 0 N m pitch, 0.1 N m yaw",
        "RTL_TYPE=0",
    ]
