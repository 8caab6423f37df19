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
from gcs_cli.experiments.paper.findings import plants
from gcs_cli.experiments.paper.findings.printed_values import CORRECTIONS, table_1, table_2, table_3
from gcs_cli.experiments.paper.flights.cases import (
    BACKSTEPPING,
    CONDITIONS,
    CONTENDERS,
    DRIVE,
    MULTIBODY,
    NUDGE,
    PID,
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
