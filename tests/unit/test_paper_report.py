"""The paper's report: every table and figure is there, its numbers are those of the results, and it stands alone."""

from __future__ import annotations

import base64
import io
import math
import re
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.params.vehicle import load_vehicle
from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.printed import print_results
from gcs_cli.experiments.paper.report import render
from gcs_cli.experiments.paper.report_flights import signals
from gcs_cli.experiments.paper.report_labels import LABELS, fixed, number
from gcs_cli.experiments.paper.report_matrix import matrix_table, space_rms
from gcs_cli.experiments.paper.report_metrics import metrics_table, step_table
from gcs_cli.experiments.paper.report_moves import moves_table, shared_moves
from gcs_cli.experiments.paper.report_pictures import Picture, poses_of, quaternions, take
from gcs_cli.experiments.paper.report_sentences import sentences
from gcs_cli.experiments.paper.report_steps import yaw_authority, yaw_note
from gcs_cli.experiments.paper.report_tables import plain
from tests.support.paper_flights import linear_part, onset_part, pil_part, small_flights, small_results
from tests.support.parsed_page import parsed

PIXEL = "data:image/png;base64," + base64.b64encode(b"no picture, but nobody looks").decode()


@pytest.fixture(scope="module")
def page() -> str:
    results = small_results() | {"linear": linear_part(), "onset": onset_part(), "pil": pil_part()}
    return render(results, small_flights().recordings, [Picture("on its way north", PIXEL)])


def test_every_table_and_figure_of_the_paper_is_there(page: str) -> None:
    text = parsed(page).text
    for part in (
        "What came out", "Does it hold?", "Table I: the vehicle", "Table II: the PID", "Table III: backstepping",
        "Corrections of the paper", *(f"Fig. {figure}:" for figure in range(7, 16)),
        "The plants against each other", "Disturbances: Hard profile", "Linear analysis: poles",
        "Linear analysis: open loops", "Margins of the attitude loops as flown", "cut at one place",
        "Margins with ideal rotors and one step of delay", "Margins of x, y and z as flown", "Lowest stable rates",
        "How it was made",
        "on its way north", "instructions on an emulated Cortex-M4F, not the F28377S",
    ):  # fmt: skip
        assert part in text, part


def test_the_navigation_leads_only_to_what_is_there(page: str) -> None:
    targets = re.findall(r'href="#([^"]+)"', page)
    names = re.findall(r' id="([^"]+)"', page)
    assert len(targets) > 15
    assert set(targets) <= set(names)
    assert len(set(names)) == len(names)


def test_the_page_needs_nothing_from_outside_and_is_small(page: str) -> None:
    found = parsed(page)
    assert not re.search(r"https?:|@import|url\(", page)
    assert {"script", "link", "iframe"}.isdisjoint(found.tags)
    assert all(value.startswith("data:") for name, value in found.attributes if name == "src")
    assert not re.search(r"\b(nan|inf)\b", page, re.IGNORECASE)
    assert len(page) < 4_000_000  # 1.1 MB measured; pictures take another 0.4 MB


def test_both_controllers_are_drawn_against_the_reference_on_both_plants(page: str) -> None:
    for figure in range(8, 14):
        part = page[page.index(f'id="fig-{figure}"') :]
        part = part[: part.index("</section>")]
        assert part.count("<svg") == 4  # response and error, on two plants
        for style, curves in (("ref", 2), ("s1", 4), ("s2", 4)):
            assert len(re.findall(rf'class="line {style}\b', part)) == curves, (figure, style)


def test_the_numbers_of_the_tables_are_those_of_the_results() -> None:
    found = small_flights().entries
    table = parsed(metrics_table(found, cases.DESIRED, (cases.SMALL_ANGLE,), (cases.PID,))).text
    of = found[cases.key(cases.PID, cases.DESIRED)]["metrics"]
    assert f"{1e3 * of['x']['rms_error']:.1f} mm" in table
    assert f"{of['y']['rise_time_s']:.3f} s" in table
    assert f"{math.degrees(of['roll']['max_error']):.3f}°" in table
    steps = parsed(step_table(found, cases.SMALL_ANGLE)).text
    for name in (cases.PID, cases.BACKSTEPPING):
        of = found[cases.key(name, "step_pitch")]["metrics"]["pitch"]
        assert f"{of['overshoot_percent']:.1f} %" in steps
        assert f"{of['settling_time_s']:.3f} s" in steps


def test_the_matrix_marks_the_best_and_whoever_is_as_good() -> None:
    found = dict(small_flights().entries)
    by_rms = {
        name: space_rms(found[cases.key(name, cases.SMOOTH)])
        for name in LABELS
        if cases.key(name, cases.SMOOTH) in found
    }
    assert len(by_rms) == 3
    table = matrix_table(found, cases.SMOOTH, cases.SMALL_ANGLE)
    first_row = table[table.index("<tr><th>Table I") :].split("</tr>")[0]
    best = min(by_rms.values())
    marked = [f'class="best">{fixed(1e3 * rms, 1)} mm' in first_row for rms in by_rms.values()]
    assert marked == [rms <= 1.01 * best for rms in by_rms.values()]
    assert True in marked


def test_a_crash_is_said_and_ends_the_curve() -> None:
    flown = small_flights()
    key = cases.key(cases.BACKSTEPPING, cases.HARD)
    recording = flown.recordings[key]
    half = len(recording.time_s) // 2
    arrays = {
        name: value[:half] for name, value in recording._asdict().items() if isinstance(value, np.ndarray)
    }
    crashed = recording._replace(**arrays, ended_s=11.0, ended_why="turned <over>", ended_how="crashed")
    results = all_flown()
    results["cases"] = results["cases"] | {
        key: {**flown.entries[key], "ended": {"time_s": 11.0, "why": "turned <over>", "how": "crashed"}}
    }
    html = render(results, flown.recordings | {key: crashed})
    text = parsed(html).text
    assert "crashed at 11.00 s: turned <over>" in text  # in the matrix
    assert "crashed: turned <over> at 11.00 s" in text  # beside figure 14
    assert "ended in a crash, and with what: backstepping, Table III (Table I, motors of 5 ms, thrust" in text
    assert "Flights that lost control and flew on: none." in text
    assert "All flights came to their end with: PID, Table II, linear PD" in text
    assert "<over>" not in html


def all_flown() -> dict[str, Any]:
    """Results in which nobody crashed or lost control, as some do at these low rates."""
    results = small_results()
    results["cases"] = {key: {**case, "ended": None} for key, case in results["cases"].items()}
    return results


def test_who_lost_control_is_told_apart_from_who_crashed() -> None:
    results = all_flown()
    key = cases.key(cases.PID, cases.SMOOTH)
    ending = {"time_s": 7.0, "why": "heading off by more than 60°", "how": "lost"}
    results["cases"] = results["cases"] | {key: {**results["cases"][key], "ended": ending}}
    text = parsed(render(results, {})).text
    assert "lost control at 7.00 s: heading off by more than 60°" in text
    assert "Flights that ended in a crash: none." in text
    assert "lost control and flew on, and with what: PID, Table II (Table I, motors of 5 ms, thrust" in text
    assert "0 / 1" in text
    matrix = parsed(matrix_table(results["cases"], cases.SMOOTH, cases.SMALL_ANGLE)).text
    assert matrix.count("heading off") == 1


def test_overshoot_is_told_of_each_move_and_compared_over_those_that_all_began_at_rest() -> None:
    def case(x: list[float | None], y: list[float | None]) -> dict[str, Any]:
        moves = {
            axis: {
                "moves": [
                    {"at_s": 1.0 + at, "by": -2.0, "overshoot_percent": one} for at, one in enumerate(over)
                ]
            }
            for axis, over in (("x", x), ("y", y))
        }
        return {"ended": None, "metrics": moves}

    found = {
        cases.key(cases.PID, cases.HARD): case([10.0, 90.0, 30.0], [20.0]),
        cases.key(cases.BACKSTEPPING, cases.HARD): case([12.0, None, 16.0], [14.0]),
        cases.key(cases.POLES, cases.HARD): {"ended": {"how": "lost"}, "metrics": {}},
    }
    whole = {key: one for key, one in found.items() if one["ended"] is None}
    pid, back = whole
    assert shared_moves(whole) == [{pid: 10.0, back: 12.0}, {pid: 30.0, back: 16.0}, {pid: 20.0, back: 14.0}]
    table = moves_table(found, cases.PLAIN, cases.SMALL_ANGLE)
    rows = [re.findall(r"<t[hd][^>]*>([^<]*)", unescape(one)) for one in table.split("<tr")[2:]]
    assert rows[1] == ["x, 2.0 s, by −2.0 m", "90.0 %", "–", "lost control"]
    median, worst = rows[-2:]
    assert median == [
        "median of the 3 that began at rest with all of the paper's poles",
        "20.0 %",
        "14.0 %",
        "lost control",
    ]
    assert worst == ["worst of these", "30.0 %", "16.0 %", "lost control"]  # without the one of 90 %


def test_the_reference_that_asks_more_of_yaw_than_there_is_is_named_beside_the_steps() -> None:
    """U4 of Table I with one pair at its least speed, the other carrying the rest: d/b (m g − 4 b Ω²) over Iz."""
    results = small_results() | {"linear": linear_part()}
    flown = cases.key(cases.TUNED_PID, "step_yaw")
    results["cases"] = results["cases"] | {flown: results["cases"][cases.key(cases.PID, "step_yaw")]}
    vehicle = load_vehicle("paper_quad")
    rotor = vehicle.rotors[0]
    idle_n = 4.0 * rotor.thrust_coefficient_n_s2 * rotor.min_speed_rad_s**2
    torque = rotor.torque_coefficient_n_m_s2 / rotor.thrust_coefficient_n_s2 * (vehicle.weight_n - idle_n)
    assert yaw_authority() == pytest.approx(torque / vehicle.inertia_kg_m2[2])
    note = yaw_note(results)
    over = results["cases"][flown]["metrics"]["yaw"]["overshoot_percent"]
    for words in (
        "by 60 rad/s² (own gains: 150)",
        f"{yaw_authority():.1f} rad/s²",
        f"overshoots by {over:.1f} %",
    ):
        assert words in note, words
    assert yaw_note(small_results()) == ""  # nobody to tell of


def test_texts_are_escaped() -> None:
    results = small_results()
    results["corrections"] = [dict.fromkeys(("where", "printed", "used", "why", "place"), "a < b & <i>c")]
    results["left_out"] = {"linear": "<script>"}
    html = render(results, {})
    assert "a < b & <i>c" in parsed(html).text
    assert "<script>" not in html
    assert "<i>c" not in html


def test_what_was_left_out_is_said() -> None:
    results = small_results()
    results["left_out"] = {"multibody": "no MuJoCo here", "linear": "not done", "pil": "left out on request"}
    text = parsed(render(results, small_flights().recordings)).text
    for words in ("no MuJoCo here", "not done", "left out on request"):
        assert text.count(words) == 2, words  # in the summary and in its place
    results["pil"] = {**pil_part(), "controllers": {}, "why_left_out": "no compiler is there"}
    results["left_out"] = {}
    assert parsed(render(results, {})).text.count("no compiler is there") == 2


def test_the_summary_counts_claims_by_their_verdicts() -> None:
    results = small_results()
    claim = {
        "name": "a",
        "claim": "it is so",
        "source": "paper, IV.B",
        "words": "By 1 %.",
        "threshold": "",
        "figures": {},
    }
    results["comparisons"]["claims"] = [
        {**claim, "plant": cases.SMALL_ANGLE, "holds": True},
        {**claim, "plant": cases.RIGID, "holds": False},
        {**claim, "name": "b", "source": "our question", "plant": cases.RIGID, "holds": True},
    ]
    text = parsed(f"<div>{''.join(sentences(results))}</div>").text
    assert "“it is so” (paper, IV.B): Holds on the small-angle model, not on the rigid body. By 1 %." in text
    assert "0 of 1" in parsed(render(results, {})).text


def plants_part(within: bool, decides: bool = True) -> dict[str, Any]:
    found = {
        "max_position_m": 0.0021, "rms_position_m": 0.001, "max_attitude_deg": 0.123, "rms_attitude_deg": 0.05,
        "position_bound_m": 0.01, "attitude_bound_deg": 0.5, "within_bounds": within,
        "bound_decides": decides, "rounding": {"max_position_m": 1e-9 if decides else 0.0028},
    }  # fmt: skip
    return {"rigid_multibody": {cases.PID: found}}


@pytest.mark.parametrize("within", [True, False])
def test_the_difference_of_the_plants_stands_beside_its_bound(within: bool) -> None:
    results = small_results()
    results["plants"] = plants_part(within)
    text = parsed(render(results, {})).text
    assert "2.10 mm" in text
    assert "0.123°" in text
    assert ("not kept: 1 cm, 0.5°" in text) is not within
    assert ("not within 1 cm and 0.5°" in text) is not within


def test_plants_are_not_judged_where_a_loop_magnifies_rounding() -> None:
    results = small_results()
    results["plants"] = plants_part(True, decides=False)
    results["plants_elsewhere"] = {"step_roll": plants_part(True)}
    text = parsed(render(results, {})).text
    assert "kept: 1 cm" not in text
    assert "chance: magnified rounding" in text
    assert "moves its flight on the rigid body by up to 2.80 mm from itself" in text
    assert "step of roll" in text
    assert "rigid body to multibody, where loops" not in text  # no tile: nothing can be told


def test_signals_are_in_metres_and_degrees_with_the_height_upwards() -> None:
    recording = small_flights().recordings[cases.key(cases.PID, cases.DESIRED)]
    wanted, got = signals(recording, "z")
    assert wanted.max() == pytest.approx(2.5)
    assert np.allclose(got, -recording.position_ned_m[:, 2])
    assert signals(recording, "yaw")[0].max() == pytest.approx(180.0)
    assert np.allclose(np.radians(signals(recording, "roll")[0]), recording.euler_target_rad[:, 0])


def test_numbers_are_written_as_people_write_them() -> None:
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
    half = math.radians(45.0)
    east, nose_down = quaternions(np.array([[0.0, 0.0, 2.0 * half], [0.0, -2.0 * half, 0.0]]))
    assert np.allclose(east, (math.cos(half), 0.0, 0.0, math.sin(half)))
    assert np.allclose(nose_down, (math.cos(half), 0.0, -math.sin(half), 0.0))


def test_pictures_that_cannot_be_had_are_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    (picture,) = take({})
    assert picture.data_uri == ""
    assert "No pictures" in picture.caption
    monkeypatch.setattr("gcs_cli.experiments.paper.report_pictures.find_spec", lambda name: None)
    (picture,) = take(small_flights().recordings)
    assert INSTALL_MULTIBODY in picture.caption
    assert "pip install" in parsed(render(small_results(), {}, [picture])).text


def test_margins_and_rates_are_those_of_the_analysis(page: str) -> None:
    text = parsed(page).text
    for words in (
        "12.3 dB, 57°", "unstable", "−8.00 ± 6.00 j", "21.9 ms", "203.00 Hz", "203.25 Hz", "0.123 %",
        "none up to 2 kHz", "yaw ψ with spin-up torque", "1759.4 Hz", "222.2 Hz", "6.08 Hz", "24.7 %", "2.48 s",
    ):  # fmt: skip
        assert words in text, words
    poles = page[page.index('id="linear"') : page.index('id="bode"')]
    assert poles.count('class="cross s1"') == 12  # two poles of six axes
    bode = page[page.index('id="bode"') : page.index('id="margins"')]
    assert (
        len(re.findall(r'class="line s1"', bode)) == 8
    )  # gain and phase of three axes, and of yaw with spin-up


def test_the_target_s_costs_and_differences_are_those_of_the_comparison(page: str) -> None:
    text = parsed(page).text
    for words in (
        "0.477 µm",
        "same bits",
        "980.2",
        "2485",
        "stack used at most: 872 octets",
        "without a clock",
    ):
        assert words in text, words
    assert re.findall('href="(pil-[^/]*)', page) == ["pil-pid", "pil-backstepping", "pil-backstepping-rigid"]
    assert "It is a mission and no path." in text


def test_a_loop_of_other_gains_is_named_by_them() -> None:
    results = small_results() | {"linear": linear_part(), "onset": onset_part()}
    results["linear"]["loops"][0]["gains"] = "mine"
    assert "pid, mine" in parsed(render(results, {})).text


@pytest.mark.parametrize("decides", [True, False])
def test_the_terminal_is_told_where_a_difference_of_plants_is_chance(decides: bool) -> None:
    results = small_results()
    results["plants"] = plants_part(True, decides)
    terminal = Console(file=io.StringIO(), width=200)
    print_results(terminal, results, Path("here"))
    told = terminal.file.getvalue()
    assert "rigid body against multibody, PID, Table II: at most 2.1 mm and 0.123° apart" in told
    assert ("by chance: a push of 10⁻¹² N moves it by 2.8 mm on one plant alone" in told) is not decides
    assert "results in here" in told
