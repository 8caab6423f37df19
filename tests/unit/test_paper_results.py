"""The matrix of experiments, tables, verdicts, and results.json: the same from one process and from two."""

from __future__ import annotations

import io
import json
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from flightstack.params.gains_file import BUILT_IN
from gcs_cli.__main__ import main
from gcs_cli.errors import CliError
from gcs_cli.experiments.paper import linear, pil_section, run
from gcs_cli.experiments.paper.findings import claims as claims_module
from gcs_cli.experiments.paper.findings import claims_stability, comparisons, plants
from gcs_cli.experiments.paper.findings.claims import claims
from gcs_cli.experiments.paper.findings.comparisons import shared_overshoots
from gcs_cli.experiments.paper.findings.printed_values import CORRECTIONS, table_1, table_2, table_3
from gcs_cli.experiments.paper.findings.verdicts import NotFlownError, flight
from gcs_cli.experiments.paper.flights.cases import (
    BACKSTEPPING,
    CONDITIONS,
    CONTENDERS,
    DRIVE,
    MULTIBODY,
    NUDGE,
    PID,
    POLES,
    RIGID,
    SHAPED,
    SMALL_ANGLE,
    all_cases,
    key,
    matrix,
)
from gcs_cli.experiments.paper.flights.closed_loop import fly
from gcs_cli.experiments.paper.flights.experiments import entry_of, run_cases, thinned
from gcs_cli.experiments.paper.flights.trajectory import trajectory_names
from gcs_cli.experiments.paper.linear.tables import actuator_settings
from gcs_cli.experiments.paper.results import results_of, text_of
from gcs_cli.experiments.paper.run import FIGURES_NAME, HTML_NAME, JSON_NAME, PaperOptions

REPOSITORY = Path(__file__).resolve().parents[2]
FEW = [
    *matrix(("step_roll", "step_x"), (SMALL_ANGLE,), CONTENDERS[:2], CONDITIONS[:2]),
    *matrix(("step_roll",), (RIGID,), CONTENDERS[:2], CONDITIONS[:1]),
]


def test_keys_are_distinct_and_every_combination_is_there() -> None:
    cases = all_cases(True)
    assert len({case.key for case in cases}) == len(cases)
    assert len(set(cases)) == len(cases)
    by_key = {case.key: case for case in cases}
    for contender in CONTENDERS:
        for condition in CONDITIONS:
            along = ("hard", "step_z") if condition.name == SHAPED else ("smooth", "hard")
            for trajectory in along:
                for plant in (SMALL_ANGLE, RIGID) if condition.name != DRIVE else (RIGID,):
                    case = by_key[key(contender.name, trajectory, condition.name, plant)]
                    assert (case.controller, case.gains) == (contender.controller, contender.gains)
                    assert all(getattr(case, name) == value for name, value in condition.changes.items())
        assert key(contender.name, "desired", plant=MULTIBODY) in by_key
    for name in (PID, BACKSTEPPING):
        assert all(key(name, trajectory, plant=MULTIBODY) in by_key for trajectory in trajectory_names())
    assert {case.plant for case in all_cases(False)} == {SMALL_ANGLE, RIGID}


def test_what_a_condition_changes_is_what_its_name_says() -> None:
    changes = {condition.name: condition.changes for condition in CONDITIONS}
    assert changes["no_limits"] == {"limits": False}
    assert changes["ideal"] == {"limits": False, "lag_s": 0.0}
    assert changes["lag_0"] == {"lag_s": 0.0}


def test_the_rate_fed_pid_is_table_2_but_for_the_rate() -> None:
    plain, fed = (
        tomllib.loads((BUILT_IN / f"{name}.toml").read_text(encoding="utf-8"))
        for name in ("paper", "paper_rate_fed")
    )
    assert fed["attitude_pid"].pop("rate_feedforward") == 1.0
    assert plain["attitude_pid"].pop("rate_feedforward") == 0.0
    assert {**fed, "description": ""} == {**plain, "description": ""}


def test_tables_show_what_is_printed_and_what_flies() -> None:
    one, two, three = table_1(), table_2(), table_3()
    assert [entry.symbol for entry in one if entry.corrected] == []
    assert [entry.symbol for entry in two if entry.corrected] == ["Kd_z"]
    assert [entry.symbol for entry in three if entry.corrected] == []
    assert {entry.symbol: entry.used for entry in three}["c2"] == 285.74
    assert {entry.symbol: entry.printed for entry in one}["τ"] is None


@pytest.mark.parametrize("correction", CORRECTIONS, ids=lambda correction: correction.where)
def test_corrections_name_files_that_are_there(correction: Any) -> None:
    assert (REPOSITORY / correction.place).exists()


# ---------------------------------------------------------------- results.json


def test_one_process_and_two_give_the_same_results() -> None:
    alone, together = run_cases(FEW, 1), run_cases(FEW, 2)
    assert text_of(results_of(alone, {})) == text_of(results_of(together, {}))
    assert list(alone.recordings) == list(together.recordings)
    for name, recording in alone.recordings.items():
        assert recording.position_ned_m.tobytes() == together.recordings[name].position_ned_m.tobytes()


def test_results_are_json_with_floats_in_full() -> None:
    flown = run_cases(FEW[:2], 1)
    results = json.loads(text_of(results_of(flown, {"pil": "not wanted"})))
    entry = results["cases"][FEW[0].key]
    assert entry == json.loads(json.dumps(entry_of(fly(FEW[0]))))
    assert entry["metrics"]["roll"]["rms_error"] == entry_of(fly(FEW[0]))["metrics"]["roll"]["rms_error"]
    assert results["left_out"] == {"pil": "not wanted"}
    assert results["trajectories"]["step_roll"]["moves"][0]["by"] == math.radians(5.0)


def test_a_thinned_recording_has_every_so_many_rows() -> None:
    full = fly(FEW[0])
    thin = thinned(full, 7)
    assert (thin.euler_rad == full.euler_rad[::7]).all()
    assert (thin.case, thin.ended_s, thin.ended_why) == (full.case, full.ended_s, full.ended_why)


# ---------------------------------------------------------------- verdicts


def case_entry(
    overshoot: float | None,
    rms_m: float = 0.1,
    how: str = "",
    steady_m: float = 0.0,
    yaw_percent: float = 0.0,
    later: float | None = None,
) -> dict[str, Any]:
    """A flight with a move of x and two of y; ``later`` overshoots that of the third move."""
    moves = [move_entry(1.0, overshoot)], [move_entry(3.0, overshoot), move_entry(7.0, later)]
    x, y = ({"moves": of, "steady_state_error": 0.0} for of in moves)
    path = dict.fromkeys(("max_error_m", "path_rms_m", "path_max_m", "beyond_m"), 0.1)
    return {
        "ended": {"time_s": 1.0, "why": "turned over", "how": how} if how else None,
        "path": {"rms_error_m": rms_m, **path},
        "metrics": {"x": {**x, "steady_state_error": steady_m}, "y": y, "z": {"max_error": 0.13}},
        "effort": {"saturated_percent": {"yaw": yaw_percent}},
    }


def move_entry(at_s: float, overshoot: float | None) -> dict[str, Any]:
    return {"at_s": at_s, "watched_s": 2.0, "by": 1.0, "overshoot_percent": overshoot}


def cases_with(**changed: dict[str, Any]) -> dict[str, Any]:
    """All cases of the comparison on the small-angle plant, alike but for those of the given contenders."""
    return {
        case.key: changed.get(case.key.split("/")[0], case_entry(20.0))
        for case in matrix(("smooth", "hard"), (SMALL_ANGLE,))
    }


def verdicts(cases: dict[str, Any]) -> dict[str, bool]:
    return {claim["name"]: claim["holds"] for claim in claims(cases, {})}


def test_verdicts_follow_the_figures() -> None:
    alike = verdicts(cases_with())
    assert alike == {
        "similar": True, "overshoot": False, "limits": False, "method": False, "torque": False, "survives": True,
    }  # fmt: skip
    assert verdicts(cases_with(backstepping=case_entry(18.9)))["overshoot"]
    assert not verdicts(cases_with(backstepping=case_entry(19.1)))["overshoot"]
    assert verdicts(cases_with(backstepping=case_entry(19.4)))["method"]
    assert not verdicts(cases_with(backstepping=case_entry(20.0, rms_m=0.089)))["similar"]
    assert not verdicts(cases_with(pid=case_entry(20.0, rms_m=0.089)))["similar"]
    assert verdicts(cases_with(pid=case_entry(20.0, steady_m=-0.01)))["torque"]


def test_table_2_is_judged_with_its_rate_fed_ahead_too() -> None:
    assert not verdicts(cases_with(rate_fed_pid=case_entry(20.0, rms_m=0.089)))["similar"]
    fed = cases_with(backstepping=case_entry(15.0), rate_fed_pid=case_entry(14.0))
    found = {claim["name"]: claim for claim in claims(fed, {})}
    assert not found["overshoot"]["holds"]
    assert not found["method"]["holds"]
    assert "14.0 % with its rate fed ahead" in found["overshoot"]["words"]


def test_only_moves_that_began_at_rest_with_all_are_compared() -> None:
    one, other = case_entry(20.0, later=80.0), case_entry(10.0)
    assert shared_overshoots([one, one]) == ([20.0, 20.0], [80.0, 80.0], 3)
    assert shared_overshoots([one, other]) == ([20.0, 10.0], [20.0, 10.0], 2)
    assert shared_overshoots([one, case_entry(None)]) is None
    found = {claim["name"]: claim for claim in claims(cases_with(pid=case_entry(None)), {})}
    assert not found["overshoot"]["holds"]
    assert "No move began at rest with all of them" in found["overshoot"]["words"]


@pytest.mark.parametrize(("how", "words"), [("crashed", "crashed"), ("lost", "lost control")])
def test_a_crash_is_told_and_decides_nothing_in_its_favour(how: str, words: str) -> None:
    found = {claim["name"]: claim for claim in claims(cases_with(backstepping=case_entry(1.0, how=how)), {})}
    assert not any(claim["holds"] for claim in found.values())
    assert (
        found["overshoot"]["words"] == f"Backstepping {words} on the small-angle plant: nothing to compare."
    )
    assert "the PID does not come to its end with: nothing" in found["survives"]["words"]
    assert f"({words})" in found["survives"]["words"]
    assert found["survives"]["words"].endswith("The PID with its rate fed ahead does not with: nothing.")


def test_an_advantage_that_ends_with_the_limits_alone_is_theirs() -> None:
    cases = cases_with(backstepping=case_entry(15.0))
    assert not verdicts(cases)["limits"]
    cases[key(BACKSTEPPING, "hard", "ideal")] = case_entry(19.5)  # without lag, too: not judged
    assert not verdicts(cases)["limits"]
    cases[key(BACKSTEPPING, "hard", "no_limits")] = case_entry(19.5)
    assert verdicts(cases)["limits"]
    cases[key(BACKSTEPPING, "hard", "plain")] = case_entry(19.5)
    assert not verdicts(cases)["limits"]  # nothing to explain


def linear_with(**backstepping: Any) -> dict[str, Any]:
    """An analysis in which both controllers are alike, but for these figures of backstepping's roll loop."""

    def loop(controller: str, changed: dict[str, Any]) -> dict[str, Any]:
        alike = {"gain_db": 10.0, "phase_deg": 40.0, "lowest_hz": 300.0}
        axes = {
            axis: {
                "sampled": [sampled(name, {**alike, **(changed if axis == "roll" else {})}) for name in named]
            }
            for axis, named in {"roll": FLOWN, "pitch": FLOWN, "yaw": (*FLOWN, *SPIN_UP)}.items()
        }
        return {"controller": controller, "gains": "paper", "axes": axes}

    return {"loops": [loop("pid", {}), loop("backstepping", backstepping)]}


FLOWN, SPIN_UP = ("motor lag",), ("motor lag with spin-up torque",)


def sampled(name: str, of: dict[str, Any]) -> dict[str, Any]:
    margins = {"gain_db": of["gain_db"], "phase_deg": of["phase_deg"]} if of["gain_db"] != "none" else None
    return {"actuators": name, "margins": {"1000": margins}, "lowest_stable_hz": of["lowest_hz"]}


@pytest.mark.parametrize(
    ("changed", "holds"),
    [
        ({}, True),
        ({"gain_db": 9.6, "phase_deg": 38.5, "lowest_hz": 310.0}, True),
        ({"gain_db": 9.4}, False),
        ({"phase_deg": 37.9}, False),
        ({"lowest_hz": 316.0}, False),
        ({"lowest_hz": None}, False),
        ({"gain_db": None, "phase_deg": None}, True),
        ({"gain_db": "none"}, False),
        ({"gain_db": 20.0, "phase_deg": 60.0, "lowest_hz": 200.0}, True),
    ],
)
def test_nearer_to_instability_is_told_by_margins_and_lowest_rates(
    changed: dict[str, Any], holds: bool
) -> None:
    found = [claim for claim in claims({}, linear_with(**changed)) if claim["name"] == "stable"]
    assert [claim["plant"] for claim in found] == [SMALL_ANGLE, RIGID]
    for claim in found:
        assert claim["holds"] is holds
        assert claim["words"].endswith("nearer in none." if holds else "nearer in roll.")


def test_the_analysis_has_what_the_claim_asks_for() -> None:
    for axis in ("roll", "pitch", "yaw"):
        names = {name for name, _ in actuator_settings(axis)}
        assert names.issuperset(FLOWN if axis != "yaw" else FLOWN + SPIN_UP)


def test_a_yaw_loop_that_saturates_is_told() -> None:
    (claim, *_) = claims(cases_with(pid=case_entry(20.0, yaw_percent=80.4)), {})
    assert claim["words"].endswith(
        "The yaw loop of the PID as flown is at the rotors' limits in 80 % of the time."
    )
    flights = {case.key: case_entry(20.0) for case in matrix(("desired",), (SMALL_ANGLE, RIGID))}
    (claim,) = claims(flights, {})
    assert claim["holds"]
    flights[key(PID, "desired", plant=RIGID)] = case_entry(20.0, yaw_percent=80.4)
    (claim,) = claims(flights, {})
    assert not claim["holds"]
    assert "80 % of the time on the rigid-body plant" in claim["words"]


@pytest.mark.parametrize(
    ("module", "name", "value"),
    [
        (claims_module, "SMOOTH", "smoth"),
        (claims_module, "IDEAL", "idel"),
        (claims_module, "PID", "pdi"),
        (claims_stability, "DESIRED", "smooth_"),
        (claims_stability, "_FLOWN", "motor lagg"),
    ],
)
def test_a_verdict_is_never_dropped_by_a_typo(
    monkeypatch: pytest.MonkeyPatch, module: Any, name: str, value: str
) -> None:
    cases = {case.key: case_entry(20.0) for case in all_cases(multibody=False)}
    assert len(claims(cases, linear_with())) == 2 * 7 + 1
    monkeypatch.setattr(module, name, value)
    with pytest.raises((KeyError, ValueError)):
        claims(cases, linear_with())


@pytest.mark.parametrize("path", [("path", "rms_error_m"), ("effort", "saturated_percent"), ("metrics", "x")])
def test_a_figure_that_a_flight_lacks_is_an_error(path: tuple[str, str]) -> None:
    cases = {case.key: case_entry(20.0) for case in all_cases(multibody=False)}
    for case in cases.values():
        del case[path[0]][path[1]]
    with pytest.raises(KeyError, match=path[1]):
        claims(cases, linear_with())


def test_a_condition_that_a_plant_does_not_fly_is_no_missing_flight() -> None:
    with pytest.raises(KeyError):
        flight({}, key(PID, "smooth", "drive", SMALL_ANGLE))
    with pytest.raises(NotFlownError):
        flight({}, key(PID, "smooth", "drive", RIGID))
    with pytest.raises(ValueError, match="'driv' is none of"):
        key(PID, "smooth", "driv")


def test_a_table_without_flights_is_empty() -> None:
    assert claims({}, {}) == []
    assert comparisons.xy({}) == {}


def test_the_table_in_xy_has_none_for_a_crash() -> None:
    table = comparisons.xy(cases_with(poles=case_entry(20.0, how="crashed")))["hard"][SMALL_ANGLE]["plain"]
    assert table[POLES] is None
    assert table[PID]["overshoot_percent"] == 20.0


# ---------------------------------------------------------------- plants


def test_the_difference_of_plants_is_the_largest_anywhere() -> None:
    one = fly(FEW[0])
    moved = one.position_ned_m.copy()
    moved[1000] += [0.003, 0.004, 0.0]
    turned = one.euler_rad.copy()
    turned[2000, 1] -= math.radians(0.4)
    found = plants.difference(one, one._replace(position_ned_m=moved, euler_rad=turned))
    assert found["max_position_m"] == pytest.approx(0.005)
    assert found["max_attitude_deg"] == pytest.approx(0.4)
    assert plants.difference(one, one)["max_position_m"] == 0.0


def test_the_bound_holds_the_multibody_plant() -> None:
    one = fly(FEW[0])
    names = [key(PID, "desired", plant=plant) for plant in (RIGID, MULTIBODY)]
    for away_m, within in ((0.009, True), (0.011, False)):
        other = one._replace(position_ned_m=one.position_ned_m + np.array([away_m, 0.0, 0.0]))
        found = plants.comparisons(dict(zip(names, (one, other), strict=True)))
        assert found["rigid_multibody"][PID]["within_bounds"] is within
        assert not found["rigid_multibody"][PID]["bound_decides"]  # nobody tried what rounding does


def test_a_bound_decides_where_a_push_of_nothing_stays_nothing() -> None:
    one = fly(FEW[0])
    flights = {key(PID, "desired", plant=plant): one for plant in (RIGID, MULTIBODY)}
    for away_m, decides in ((1e-9, True), (1e-3, False)):
        nudged = one._replace(position_ned_m=one.position_ned_m + np.array([away_m, 0.0, 0.0]))
        found = plants.comparisons({**flights, key(PID, "desired", NUDGE.name, RIGID): nudged})
        assert found["rigid_multibody"][PID]["bound_decides"] is decides
        assert found["rigid_multibody"][PID]["rounding"]["max_position_m"] == pytest.approx(away_m)


def test_other_trajectories_are_compared_where_the_multibody_plant_flew_them() -> None:
    one = fly(FEW[0])
    flights = {key(PID, "step_roll", plant=plant): one for plant in (SMALL_ANGLE, RIGID)}
    assert plants.other_trajectories(flights) == {}
    found = plants.other_trajectories({**flights, key(PID, "step_roll", plant=MULTIBODY): one})
    assert found["step_roll"]["rigid_multibody"][PID]["max_position_m"] == 0.0


# ---------------------------------------------------------------- the command


@pytest.fixture
def quick_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The analysis is tested elsewhere, and takes long."""
    monkeypatch.setattr(linear, "results", dict)
    monkeypatch.setattr(linear, "onset", dict)


def silent() -> Console:
    return Console(file=io.StringIO())


@pytest.mark.usefixtures("quick_parts")
def test_the_same_command_twice_gives_the_same_files(tmp_path: Path) -> None:
    for name in ("one", "two"):
        run.run(PaperOptions(tmp_path / name, pil=False, multibody=False, jobs=1), silent(), FEW)
    figures = sorted(
        path.relative_to(tmp_path / "one") for path in (tmp_path / "one" / FIGURES_NAME).iterdir()
    )
    assert {path.suffix for path in figures} == {".pdf", ".svg"}
    for path in (Path(JSON_NAME), Path(HTML_NAME), *figures):
        assert (tmp_path / "one" / path).read_bytes() == (tmp_path / "two" / path).read_bytes(), path
    results = json.loads((tmp_path / "one" / JSON_NAME).read_text(encoding="utf-8"))
    assert results["left_out"] == {"pil": run.NOT_WANTED, MULTIBODY: run.NOT_WANTED}
    assert list(results["cases"]) == [case.key for case in FEW]


@pytest.mark.usefixtures("quick_parts")
def test_an_interrupt_keeps_the_parts_that_were_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> dict[str, Any]:
        raise KeyboardInterrupt

    monkeypatch.setattr(pil_section, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.run(PaperOptions(tmp_path, multibody=False, jobs=1), silent(), FEW[:1])
    results = json.loads((tmp_path / JSON_NAME).read_text(encoding="utf-8"))
    assert list(results["cases"]) == [FEW[0].key]
    assert results["left_out"]["pil"] == run.NOT_REACHED
    assert "linear" not in results["left_out"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted((JSON_NAME, HTML_NAME))


def test_a_directory_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(CliError, match="the directory cannot be made: Not a directory"):
        run.run(PaperOptions(file / "paper"), silent(), [])


def test_a_target_that_is_not_there_is_told_before_anything_flies(tmp_path: Path) -> None:
    with pytest.raises(CliError, match="/dev/nobody"):
        run.run(PaperOptions(tmp_path, target="serial:/dev/nobody"), silent(), FEW)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--connect", "udp:14999", "paper"], "gcs: paper flies vehicles of its own: leave --connect out"),
        (
            ["paper", "--no-pil", "--port", "serial:/dev/nobody"],
            "gcs: --port and --no-pil exclude each other",
        ),
        (["paper", "--port", "serial:/dev/nobody"], "/dev/nobody"),
        (["paper", "--port", "board"], "gcs: --port board: "),
    ],
)
def test_usage_is_told_in_one_sentence(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*arguments, "--out", str(tmp_path / "paper")]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1


@pytest.mark.usefixtures("quick_parts")
def test_json_is_the_results_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "all_cases", lambda multibody: FEW[:1])
    assert main(["paper", "--no-pil", "--no-multibody", "--jobs", "1", "--json", "--out", str(tmp_path)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told.pop("directory") == str(tmp_path)
    assert told == json.loads((tmp_path / JSON_NAME).read_text(encoding="utf-8"))
