"""``gcs compare``: flights of any length and plan side by side."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from flightstack.core.errors import ConfigError
from gcs_cli.__main__ import main
from gcs_cli.commands.compare import comparison_table
from gcs_cli.errors import USAGE, CliError
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.compare import (
    ComparedRun,
    condition_rows,
    figure_rows,
    read_runs,
    render_comparison,
)
from gcs_cli.report.poses import find_run
from gcs_cli.report.summary import RunInfo, summarise, write_summary
from tests.support.parsed_page import own_part, parsed
from tests.support.square_plan import square_plan
from tests.support.synthetic_flight import synthetic_flight_bytes


def make_run(folder: Path, seconds: float = 36.0, **facts: Any) -> Path:
    """Write a run directory as ``gcs fly`` does."""
    folder.mkdir()
    log = folder / "flight.ulg"
    log.write_bytes(synthetic_flight_bytes(inner_ms=20, outer_ms=20, seconds=seconds))
    run = RunInfo("completed", "missions/square.plan", 1.0, **facts)
    write_summary(folder / "summary.json", summarise(read_flight(log), square_plan(), run))
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    base = tmp_path_factory.mktemp("runs")
    return [make_run(base / "calm", seed=1), make_run(base / "windy", 20.0, seed=1, wind="5,0")]


def read(paths: Sequence[Path]) -> list[ComparedRun]:
    return read_runs([find_run(path) for path in paths])


def gcs(*words: object) -> int:
    return main([str(word) for word in words])


def test_differing_conditions_are_marked() -> None:
    rows = {row.key: row for row in condition_rows([{"seed": 1, "wind_m_s": [5.0, 0.0]}, {"seed": 1}])}
    assert rows["wind_m_s"].texts == ["5, 0", "–"]
    assert rows["wind_m_s"].differs
    assert not rows["seed"].differs
    assert "gust_m_s" not in rows


def test_figures_show_their_change_relative_to_the_first_run() -> None:
    summaries = [{"rms_tracking_error_m": value} for value in (0.1, 0.15, None, 1.5)]
    [row] = [row for row in figure_rows(summaries) if row.key == "rms_tracking_error_m"]
    assert row.title == "tracking error, rms [m]"
    assert row.texts == ["0.1000", "0.1500", "–", "1.5000"]
    assert row.changes == ["", "+50.0%", "", "×15"]


def test_overruns_are_compared_if_a_run_has_them() -> None:
    def keys(*overruns: int | None) -> list[str]:
        return [row.key for row in figure_rows([{"overruns": value} for value in overruns])]

    assert "overruns" in keys(None, 2)
    assert "overruns" not in keys(None, None)  # in lockstep


def test_plan_is_shown_by_its_name() -> None:
    def texts(*plans: str | None) -> list[str]:
        return next(
            row.texts for row in condition_rows([{"plan": plan} for plan in plans]) if row.key == "plan"
        )

    assert texts("/home/a/square.plan", "/home/a/hop.plan", None) == ["square.plan", "hop.plan", "–"]
    assert texts("/home/a/square.plan", "/home/b/square.plan") == [
        "/home/a/square.plan",
        "/home/b/square.plan",
    ]


def test_table_keeps_titles_whole_at_80_columns(runs: list[Path]) -> None:
    console = Console(file=io.StringIO(), width=80)
    console.print(comparison_table(read([runs[0], runs[1], runs[0]])))
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    for title in ("≠ wind N, E, D [m/s]", "rotor commands, rms [rad/s²]", "attitude error, largest [°]"):
        assert any(line.strip().startswith(title) for line in lines)
    assert not any("…" in line or line.rstrip().endswith(" %") for line in lines)


def test_runs_of_different_length_are_overlaid_from_arming(runs: list[Path]) -> None:
    page = parsed(render_comparison(read(runs)))
    position = page.charts["position"]
    by_name = {trace["name"]: trace for trace in position["data"] if trace["yaxis"] == "y"}
    assert list(by_name) == ["calm: setpoint", "calm", "windy: setpoint", "windy"]
    assert by_name["calm"]["x"][0] < 0.0 < by_name["windy"]["x"][-1] < by_name["calm"]["x"][-1]
    assert by_name["calm"]["legendgroup"] == by_name["calm: setpoint"]["legendgroup"] == "calm"
    assert len({trace["line"]["color"] for trace in by_name.values()}) == 2
    assert {
        tuple(chart["layout"]["xaxis"]["range"]) for chart in page.charts.values() if chart["linked"]
    } == {tuple(position["layout"]["xaxis"]["range"])}
    rotors = page.charts["rotor-speeds"]
    assert {trace["yaxis"] for trace in rotors["data"]} == {"y", "y2", "y3", "y4"}


def test_the_page_holds_all_it_needs_and_repeats(runs: list[Path]) -> None:
    first, second = (render_comparison(read(runs)) for _ in range(2))
    assert first == second
    assert "http" not in own_part(first)


def test_bare_log_without_summary_has_figures(runs: list[Path], tmp_path: Path) -> None:
    log = tmp_path / "downloaded.ulg"
    log.write_bytes((runs[0] / "flight.ulg").read_bytes())
    named, bare = read([runs[0], log])
    assert (named.name, bare.name) == ("calm", "downloaded")
    assert bare.summary["outcome"] is None
    assert bare.summary["rms_tracking_error_m"] == named.summary["rms_tracking_error_m"]
    assert np.array_equal(bare.flight.position.values, named.flight.position.values)


def test_runs_of_one_name_are_numbered(runs: list[Path]) -> None:
    assert [run.name for run in read([runs[0], runs[1], runs[0]])] == ["calm (1)", "windy", "calm (2)"]


def test_command_writes_the_page_once(
    runs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    page = runs[0] / "compare.html"
    assert gcs("compare", *runs, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert [run["name"] for run in told["runs"]] == ["calm", "windy"]
    assert told["conditions"]["wind_m_s"] == {"values": [None, [5.0, 0.0]], "differs": True}
    assert told["figures"]["items_reached"] == ["6 of 6", "4 of 6"]
    assert told["page"] == str(page)
    assert page.exists()
    assert list(tmp_path.iterdir()) == []
    before = page.read_bytes()
    assert gcs("compare", *runs) == USAGE
    printed = capsys.readouterr()
    assert "tracking error, rms" in printed.out
    assert "page written" not in printed.out
    assert "compare.html: exists already" in printed.err
    assert page.read_bytes() == before
    assert gcs("compare", *runs, "--json") == USAGE
    assert json.loads(capsys.readouterr().out.splitlines()[0])["page"] is None
    assert gcs("compare", *runs, "--overwrite") == 0
    printed = capsys.readouterr().out
    assert f"page written to {page}" in printed
    assert "≠ wind" in printed
    assert "tracking error, rms" in printed
    page.unlink()


def test_bad_runs_are_one_sentence_and_write_nothing(
    runs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = tmp_path / "text.ulg"
    text.write_text("no log")
    header = tmp_path / "logs" / "header.ulg"
    header.parent.mkdir()
    header.write_bytes((runs[0] / "flight.ulg").read_bytes()[:1000])
    for words, sentence in (
        ([runs[0]], "give two flights or more"),
        ([runs[0], text], "is not a readable flight log"),
        ([runs[0], header], "header.ulg: the log has no data"),
        ([runs[0], tmp_path / "none"], "there is no such directory or log"),
        ([runs[0], tmp_path], "text.ulg"),
    ):
        assert gcs("compare", *words) == USAGE
        error = capsys.readouterr().err
        assert sentence in error
        assert error.count("\n") == 1
    assert not (tmp_path / "compare.html").exists()
    assert not (runs[0] / "compare.html").exists()
    with pytest.raises((CliError, ConfigError)):
        read([runs[0], text])


@pytest.mark.parametrize(
    ("key", "value"), [("flight_time_s", "12"), ("waypoints", [{"seq": 0}]), ("rms_torque_n_m", 3.0)]
)
def test_damaged_summary_is_one_sentence(tmp_path: Path, capfd: Any, key: str, value: object) -> None:
    good, bad = make_run(tmp_path / "good", 20.0), make_run(tmp_path / "bad", 20.0)
    summary = bad / "summary.json"
    summary.write_text(json.dumps(json.loads(summary.read_text()) | {key: value}))
    page = tmp_path / "page.html"
    assert gcs("compare", good, bad, "--out", page) == USAGE
    assert "bad/summary.json is damaged: its figure" in capfd.readouterr().err.replace("\n", " ")
    assert not page.exists()


def test_name_that_is_not_utf_8_is_shown(tmp_path: Path) -> None:
    runs = [make_run(tmp_path / "good", 20.0), make_run(Path(f"{tmp_path}/bad\udcff"), 20.0)]
    assert [run.name for run in read(runs)] == ["good", "bad?"]
    render_comparison(read(runs)).encode("utf-8")


@pytest.mark.parametrize("name", ["calm/flight.ulg", "nowhere/page.html"])
def test_page_is_written_to_no_other_file(runs: list[Path], name: str, capfd: Any) -> None:
    log = runs[0] / "flight.ulg"
    before = log.read_bytes()
    assert gcs("compare", *runs, "--out", runs[0].parent / name, "--overwrite") == USAGE
    assert "--out" in capfd.readouterr().err
    assert log.read_bytes() == before


def test_json_names_no_page_that_cannot_be_written(runs: list[Path], tmp_path: Path, capsys: Any) -> None:
    page = tmp_path / "page.html"
    page.mkdir()
    assert gcs("compare", *runs, "--json", "--out", page) != 0
    printed = capsys.readouterr()
    assert json.loads(printed.out.splitlines()[0])["page"] is None
    assert "page.html" in printed.err
