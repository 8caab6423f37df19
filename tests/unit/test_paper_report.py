"""The paper's report: verdicts, every table and figure of the paper, and numbers equal to those of the results."""

from __future__ import annotations

import base64
import math
import re
from typing import Any

import numpy as np
import pytest

from flightstack.core.errors import INSTALL_MULTIBODY
from gcs_cli.charts.figure import AnyFigure, Figure
from gcs_cli.experiments.paper.findings.printed_values import CORRECTIONS
from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.report import tables
from gcs_cli.experiments.paper.report.figures import beside, signals
from gcs_cli.experiments.paper.report.labels import fixed, number, plain
from gcs_cli.experiments.paper.report.page import render, report_figures
from gcs_cli.experiments.paper.report.pictures import Picture, poses_of, take
from gcs_cli.experiments.paper.report.tables import Cell, Table
from gcs_cli.experiments.paper.report.verdicts import Verdict, space_rms_m, verdicts
from tests.support.paper_flights import (
    full_results,
    linear_part,
    onset_part,
    pil_part,
    small_flights,
    small_results,
)
from tests.support.parsed_page import parsed

MOST_WORDS = 1900
PIXEL = "data:image/png;base64," + base64.b64encode(b"not a picture").decode()
SCRIPTS = re.compile(r"<(script|style)\b.*?</\1>", re.DOTALL)


def all_results() -> dict[str, Any]:
    return small_results() | {"linear": linear_part(), "onset": onset_part(), "pil": pil_part()}


def page_of(results: dict[str, Any], pictures: tuple[Picture, ...] = ()) -> str:
    recordings = small_flights().recordings
    return render(results, recordings, report_figures(results, recordings), pictures)


def text_of(html: str) -> str:
    return parsed(SCRIPTS.sub("", html)).text


def texts(table: Table) -> list[list[str]]:
    return [[cell if isinstance(cell, str) else cell.text for cell in row] for row in table.rows]


def verdict_on(results: dict[str, Any], claim: str) -> Verdict:
    return next(one for one in verdicts(results) if claim in one.claim)


@pytest.fixture(scope="module")
def page() -> str:
    return page_of(all_results(), (Picture("flying north", PIXEL),))


@pytest.fixture(scope="module")
def drawn() -> dict[str, AnyFigure]:
    found = report_figures(all_results(), small_flights().recordings)
    assert len({figure.name for figure in found}) == len(found)
    return {figure.name: figure for figure in found}


# ---------------------------------------------------------------- the page


def test_report_has_at_most_1900_words() -> None:
    results = full_results()
    html = page_of(results, tuple(Picture(f"7.0 s: picture {index}", PIXEL) for index in range(4)))
    words = re.sub(r"<[^>]+>", " ", SCRIPTS.sub("", html)).split()
    assert len(words) <= MOST_WORDS
    assert len(words) > 1600  # the fixture has every row of a whole run


def test_report_begins_with_a_verdict_on_each_claim() -> None:
    text = text_of(page_of(full_results()))
    assert text.index("Verdict on each claim") < text.index("Table I: vehicle")
    for claim in ("quite similar", "overshoots less", "the code on the target matches the simulation"):
        assert claim in text


def test_report_has_every_table_and_figure_of_the_paper(page: str, drawn: dict[str, AnyFigure]) -> None:
    text = text_of(page)
    for part in (
        "Table I: vehicle", "Table II: PID", "Table III: backstepping", "Corrections of the paper",
        "Stability and margins of the attitude loops", "Plants compared", "processor in the loop",
    ):  # fmt: skip
        assert part in text, part
    numbers = {int(found.group(1)) for name in drawn if (found := re.match(r"fig-(\d+)", name))}
    assert numbers == set(range(7, 16))
    assert set(re.findall(r'data-chart="([^"]+)"', page)) == {
        name for name, figure in drawn.items() if not figure.empty
    }


def test_links_of_the_report_lead_to_a_section_or_a_file_beside_it(page: str) -> None:
    html = SCRIPTS.sub("", page)
    names = re.findall(r' id="([^"]+)"', html)
    targets = re.findall(r'href="([^"]+)"', html)
    assert len(set(names)) == len(names)
    assert {target[1:] for target in targets if target.startswith("#")} <= set(names)
    assert {target for target in targets if not target.startswith("#")} == {
        "results.json", "figures/", *(f"pil-{name}/pil.html" for name in ("pid", "backstepping", "backstepping-rigid")),
    }  # fmt: skip


def test_report_loads_nothing_from_outside(page: str) -> None:
    html = SCRIPTS.sub("", page)
    assert not re.search(r"https?:|@import|url\(", html)
    assert {"link", "iframe"}.isdisjoint(parsed(html).tags)
    assert not re.search(r"\b(nan|inf)\b", text_of(page), re.IGNORECASE)


def test_texts_of_the_report_are_escaped() -> None:
    results = small_results()
    results["corrections"] = [dict.fromkeys(("where", "printed", "used", "why", "place"), "a < b & <i>c")]
    results["left_out"] = {"linear": "<script>alert()</script>"}
    html = page_of(results)
    assert "a < b & <i>c" in text_of(html)
    assert "<script>alert" not in html
    assert "<i>c" not in html


def test_report_names_missing_parts_with_their_reason() -> None:
    results = small_results()
    results["left_out"] = {"multibody": "no MuJoCo here", "linear": "not done", "pil": "left out on request"}
    text = text_of(page_of(results))
    for words in (
        "multibody plant: no MuJoCo here",
        "linear analysis: not done",
        "loop: left out on request",
    ):
        assert f"Left out: {words}" in text or words in text
    results["pil"] = {**pil_part(), "controllers": {}, "why_left_out": "no compiler is there"}
    assert "no compiler is there" in text_of(page_of(results))


# ---------------------------------------------------------------- tables


def test_printed_values_stand_beside_the_flown_ones() -> None:
    results = small_results()
    one, two, three = tables.printed_tables(results["vehicle"], results["gains"])
    assert ["I_x", "7.2·10⁻³", "7.2·10⁻³", "kg·m²"] in texts(one)
    assert (("Kd_z", "6150", Cell("1.312·10⁵", "bad"), "1/(m·s)")) in two.rows
    assert ["c2", "285.74", "285.74", "1/s"] in texts(three)
    corrected = texts(tables.corrections_table(results["corrections"]))
    assert corrected == [[one.where, one.printed, one.used] for one in CORRECTIONS]


def test_response_and_step_tables_have_the_numbers_of_the_results() -> None:
    found = small_flights().entries
    rows = texts(tables.response_table(found, (cases.SMALL_ANGLE, cases.RIGID)))
    pid, rigid = (
        found[cases.key(cases.PID, cases.DESIRED, cases.PLAIN, plant)]["metrics"]["x"]
        for plant in (cases.SMALL_ANGLE, cases.RIGID)
    )
    errors = [fixed(1e3 * of[key], 1) for of in (pid, rigid) for key in ("rms_error", "max_error")]
    assert ["x [mm]", "PID", *errors] in rows
    roll = math.degrees(found[cases.key(cases.BACKSTEPPING, cases.DESIRED)]["metrics"]["roll"]["max_error"])
    assert rows[1][3] == fixed(roll, 2)
    pitch = next(row for row in texts(tables.step_table(found)) if row[0] == "pitch")
    of = found[cases.key(cases.BACKSTEPPING, "step_pitch")]["metrics"]["pitch"]
    assert pitch[3:] == [fixed(of["overshoot_percent"]), fixed(of["settling_time_s"], 2)]


def test_disturbance_table_marks_the_smallest_distance() -> None:
    found = small_flights().entries
    names = (cases.PID, cases.BACKSTEPPING)
    distances = [space_rms_m(found[cases.key(name, cases.HARD)]) for name in names]
    row = next(row for row in tables.disturbance_table(found).rows if row[0] == "as flown")
    marked = [isinstance(cell, Cell) and cell.style == "best" for cell in row[1:3]]
    ended = [found[cases.key(name, cases.HARD)]["ended"] is not None for name in names]
    best = min(of for of, early in zip(distances, ended, strict=True) if not early)
    assert marked == [of <= 1.01 * best and not early for of, early in zip(distances, ended, strict=True)]
    assert True in marked


@pytest.mark.parametrize(("how", "shown"), [("crashed", "crashed"), ("lost", "lost")])
def test_flight_that_ended_early_has_no_figures(how: str, shown: str) -> None:
    ending = {"time_s": 7.0, "why": "turned <over>", "how": how}
    found = {key: {**case, "ended": None} for key, case in small_flights().entries.items()}
    key = cases.key(cases.PID, cases.SMOOTH)
    found[key] = {**found[key], "ended": ending}
    row = next(row for row in tables.overshoot_table(found).rows if row[:2] == ["small-angle", "as flown"])
    assert row[2] == Cell(shown, "bad")
    assert row[4] != Cell(shown, "bad")
    html = page_of(small_results() | {"cases": found})
    assert ("1 crashed, 0 lost" if how == "crashed" else "0 crashed, 1 lost") in text_of(html)


def test_fig_14_names_flights_that_ended_early() -> None:
    flown = small_flights()
    key = cases.key(cases.BACKSTEPPING, cases.HARD)
    one = flown.recordings[key]
    half = len(one.time_s) // 2
    arrays = {name: value[:half] for name, value in one._asdict().items() if isinstance(value, np.ndarray)}
    ended = one._replace(**arrays, ended_s=11.0, ended_why="turned <over>", ended_how="crashed")
    recordings, results = flown.recordings | {key: ended}, all_results()
    html = render(results, recordings, report_figures(results, recordings))
    assert "backstepping, hard profile, small-angle: turned <over> at 11.00 s" in text_of(html)
    assert "<over>" not in SCRIPTS.sub("", html)


def test_overshoot_is_compared_over_moves_that_began_at_rest_in_all_flights() -> None:
    def case(x: list[float | None], y: list[float | None]) -> dict[str, Any]:
        axes = {
            axis: {
                "moves": [
                    {"at_s": float(at), "by": -2.0, "overshoot_percent": one} for at, one in enumerate(over)
                ]
            }
            for axis, over in (("x", x), ("y", y))
        }
        return {"ended": None, "metrics": axes}

    found = {
        cases.key(cases.PID, cases.HARD): case([10.0, 90.0, 30.0], [20.0]),
        cases.key(cases.BACKSTEPPING, cases.HARD): case([12.0, None, 16.0], [14.0]),
        cases.key(cases.POLES, cases.HARD): {"ended": {"how": "lost"}, "metrics": {}},
    }
    (row,) = texts(tables.overshoot_table(found))
    assert row[6:] == ["20.0", "–", "14.0", "lost"]  # without the move of 90 %


def test_margins_and_rates_are_those_of_the_analysis() -> None:
    loops = linear_part()["loops"]
    rows = texts(tables.margins_table(loops))
    assert rows[0] == ["roll", "PID", "10.0", "0.80", "12.3", "57", "123.4"]
    assert rows[-1] == ["yaw, spin-up torque", "PID", "", "", "unstable", "", "1759.4"]
    assert texts(tables.outer_table(loops))[0] == ["x", "PID", "24.7", "2.48", "12.3", "57", "6.08"]
    rows = texts(tables.onset_table(onset_part()))
    assert rows[0][1:4] == ["roll", "203.00", "203.25"]
    assert rows[1][1:4] == ["yaw", "–", "–"]
    loops[0]["gains"] = "mine"
    assert texts(tables.margins_table(loops))[0][1] == "pid, mine"


def test_target_tables_have_the_costs_and_differences_of_the_comparison(page: str) -> None:
    pil = pil_part()
    assert ["whole step", "980.2", "2485", "980.2", "2485"] in texts(tables.profile_table(pil))
    rows = texts(tables.equivalence_table(pil))
    assert rows[0] == ["PID, small-angle", "0.477", "2", "0", "passed"]
    assert rows[2][0] == "backstepping, rigid body"
    assert "at most 872 bytes" in text_of(page)


# ---------------------------------------------------------------- figures


@pytest.mark.parametrize("number_", range(8, 14))
def test_figs_8_to_13_draw_both_controllers_against_the_reference(
    drawn: dict[str, AnyFigure], number_: int
) -> None:
    figure = drawn[f"fig-{number_}"]
    assert isinstance(figure, Figure)
    assert beside(small_flights().recordings) == [cases.SMALL_ANGLE, cases.RIGID]
    curves = [[series.name for series in panel.series] for panel in figure.panels]
    both = ["PID", "backstepping"]
    assert curves == [["reference", *both], ["reference", *both], both, both]


def test_bode_and_pole_figures_have_the_loops_of_the_analysis(drawn: dict[str, AnyFigure]) -> None:
    bode, poles = drawn["bode"], drawn["poles"]
    assert isinstance(bode, Figure)
    assert isinstance(poles, Figure)
    assert len(bode.panels) == 8  # gain and phase of three axes, and of yaw with spin-up torque
    assert [len(panel.series[0].x) for panel in poles.panels] == [2, 2, 2, 0, 0, 2]  # x and y: slow ones


def test_profile_figure_shows_the_share_of_steps(drawn: dict[str, AnyFigure]) -> None:
    figure = drawn["fig-15"]
    assert isinstance(figure, Figure)
    assert [tuple(panel.bars[0].heights) for panel in figure.panels] == [(99.0, 1.0)] * 2


def test_signals_are_in_metres_and_degrees_with_the_height_upwards() -> None:
    recording = small_flights().recordings[cases.key(cases.PID, cases.DESIRED)]
    wanted, got = signals(recording, "z")
    assert wanted.max() == pytest.approx(2.5)
    assert np.allclose(got, -recording.position_ned_m[:, 2])
    assert signals(recording, "yaw")[0].max() == pytest.approx(180.0)
    assert np.allclose(np.radians(signals(recording, "roll")[0]), recording.euler_target_rad[:, 0])


# ---------------------------------------------------------------- numbers, pictures, terminal


def test_numbers_have_true_minus_signs_and_powers_of_ten() -> None:
    assert [number(value) for value in (0.0, 3.14159, -0.0123, 1234.5, 1e-7, None, math.inf)] == [
        "0", "3.14", "−0.0123", "1234", "1·10⁻⁷", "–", "–",
    ]  # fmt: skip
    assert [fixed(value, 1) for value in (-0.04, 2.25, None, math.nan)] == ["0.0", "2.2", "–", "–"]
    assert [plain(value) for value in (7.2e-3, 0.011, 2.83e5, 6150.0, 9.81, -0.5, 0.0, None)] == [
        "7.2·10⁻³", "0.011", "2.83·10⁵", "6150", "9.81", "−0.5", "0", "–",
    ]  # fmt: skip


def test_poses_are_the_recording_at_fifty_hertz() -> None:
    recording = small_flights().recordings[cases.key(cases.PID, cases.DESIRED)]
    poses = poses_of(recording)
    assert np.allclose(np.diff(poses.time_s), 0.02)
    assert np.array_equal(poses.position_ned_m, recording.position_ned_m[::5])


def test_missing_pictures_have_their_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    (picture,) = take({})
    assert picture.data_uri == ""
    assert "No pictures" in picture.caption
    monkeypatch.setattr("gcs_cli.experiments.paper.report.pictures.find_spec", lambda name: None)
    (picture,) = take(small_flights().recordings)
    assert INSTALL_MULTIBODY in picture.caption
    assert "pip install" in text_of(page_of(small_results(), (picture,)))
