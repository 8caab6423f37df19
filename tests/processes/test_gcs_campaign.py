"""``gcs campaign`` with its worker processes: equal tables, SIGKILL, Ctrl-C, exit codes."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.commands import gcs
from tests.support.process import Process, children_of, wait_until
from tests.support.warm_children import warm_children

SCENARIO = """\
plan = "hop"
vehicle = "x_quad"
state = "truth"
[campaign]
method = "latin-hypercube"
flights = 4
[vary]
wind.gust_m_s = { uniform = [0, 2] }
simulated.body.mass_kg = { uniform = [1.3, 1.7] }
[expect]
max_error_m = 0.6
"""
WORKER = "gcs_cli.scenarios.worker"


@pytest.fixture(autouse=True)
def _warm() -> Iterator[None]:
    """Fork the workers of campaigns in this process from the warm server; those of ``Process`` are new interpreters."""
    with warm_children():
        yield


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.toml").write_text(SCENARIO, encoding="utf-8")
    return tmp_path


def events(text: str, kind: str) -> list[dict[str, Any]]:
    found = [json.loads(line) for line in text.splitlines() if line.startswith("{")]
    return [event for event in found if event["event"] == kind]


def results(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in ("flights.parquet", "flights.csv", "report.html")}


def test_tables_are_the_same_with_one_worker_or_two_after_sigkill(folder: Path) -> None:
    whole = gcs("campaign", "c.toml", "--workers", 1, "--out", "one", "--csv", "--json")
    assert (whole.returncode, whole.stderr.count("gcs:")) == (0, 0)
    (summary,) = events(whole.stdout, "campaign")
    assert (summary["flights"], summary["passed"]) == (4, 4)
    run = Process("gcs_cli", "campaign", "c.toml", "--workers", "2", "--out", "two", "--csv", "--json")
    run.wait_for('"event": "flight"')
    run.kill()
    before = [json.loads(line)["flight"] for line in Path("two/flights.jsonl").read_text().splitlines()]
    assert before
    rest = gcs("campaign", "c.toml", "--workers", 2, "--out", "two", "--csv", "--json")
    flown = [event["flight"] for event in events(rest.stdout, "flight")]
    assert sorted(before + flown) == [1, 2, 3, 4]  # nothing twice
    one, two = results(folder / "one"), results(folder / "two")
    assert {**two, "report.html": b""} == {**one, "report.html": b""}


def test_a_campaign_that_is_over_flies_nothing_and_a_changed_one_is_refused(folder: Path) -> None:
    (folder / "c.toml").write_text(SCENARIO.replace("= 4", "= 2"))
    assert gcs("campaign", "c.toml", "-j", 1).returncode == 0
    written = Path("runs/campaign-c/flights.parquet").read_bytes()
    again = gcs("campaign", "c.toml", "-j", 1, "--json")
    assert (again.returncode, events(again.stdout, "flight")) == (0, [])
    (folder / "c.toml").write_text(SCENARIO.replace("= 4", "= 2").replace("0.6", "0.5"))
    refused = gcs("campaign", "c.toml", "-j", 1)
    assert refused.returncode == 2
    assert refused.stderr == (
        "gcs: runs/campaign-c: c.toml has changed since its flights: give another --out, or --overwrite to fly all of "
        "them again\n"
    )
    assert Path("runs/campaign-c/flights.parquet").read_bytes() == written


def test_a_failed_flight_exits_with_1_and_flies_alone(folder: Path) -> None:
    (folder / "c.toml").write_text(SCENARIO.replace("= 4", "= 2").replace("0.6", "0.0001"))
    ended = gcs("campaign", "c.toml", "-j", 1, "--out", "bad")
    assert ended.returncode == 1
    assert "FAIL  flight 1: max_error_m ≤ 0.0001; wind.gust_m_s " in ended.stdout
    assert "0 of 2 flights passed in " in ended.stdout
    row = json.loads(Path("bad/flights.jsonl").read_text().splitlines()[1])
    alone = gcs("campaign", "c.toml", "--out", "bad", "--only", 2, "--json")
    (flown,) = events(alone.stdout, "flight")
    assert alone.returncode == 1
    assert {name: value for name, value in flown.items() if name not in ("event", "kept")} == row
    assert sorted(path.name for path in Path(flown["kept"]).iterdir()) == ["flight.ulg", "report.html"]
    assert gcs("campaign", "c.toml", "--only", 3).stderr == "gcs: --only 3: c.toml has 2 flights\n"


@pytest.mark.parametrize(
    ("options", "command"),
    [((), "the same command"), (("--overwrite",), "the same command without --overwrite")],
    ids=["first", "overwrite"],
)
def test_ctrl_c_keeps_finished_flights(folder: Path, options: tuple[str, ...], command: str) -> None:
    (folder / "c.toml").write_text(SCENARIO.replace("= 4", "= 500"))
    run = Process("gcs_cli", "campaign", "c.toml", "--workers", "1", "--json", *options)
    run.wait_for('"event": "flight"')
    run.interrupt()
    assert run.end() == 130
    over = len(Path("runs/campaign-c/flights.jsonl").read_text().splitlines())
    assert f"gcs: interrupted: {over} of 500 flights are over; {command} continues" in run.lines


def test_a_killed_worker_leaves_its_flight_to_the_next_run(folder: Path) -> None:
    (folder / "c.toml").write_text(
        SCENARIO.replace('plan = "hop"', "duration_s = 100000").replace("= 4", "= 1")
    )
    run = Process("gcs_cli", "campaign", "c.toml", "--workers", "1")
    wait_until(lambda: Path("runs/campaign-c/campaign.json").exists() or not run.is_running)
    os.kill(children_of(run.popen.pid)[WORKER], signal.SIGKILL)
    assert run.end() == 1
    ended = "the process that flew it was killed by signal 9; the same command flies it again"
    assert f"gcs: flight 1: {ended}" in run.lines
    assert Path("runs/campaign-c/flights.jsonl").read_bytes() == b""


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            [],
            "gcs: Missing argument 'FILE': a scenario file with [campaign] and [vary], such as "
            "examples/campaigns/hop_in_gusts.toml\n",
        ),
        (["none.toml"], "gcs: none.toml: there is no such file or folder"),
        (["c.toml", "--seek", "best"], "gcs: --seek: best is not one of worst"),
        (["c.toml", "--flights", "50"], "gcs: --flights is for --seek: "),
        (["c.toml", "--flights", "12"], "gcs: --flights is for --seek: "),
        (
            ["c.toml", "--flights", "12", "--seek", "worst"],
            "gcs: --flights: 12 is outside the allowed range 20 to 100000\n",
        ),
        (["c.toml", "--workers", "0"], "gcs: --workers: 0 is outside the allowed range 1 to 256"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_bad_file_or_option_exits_with_2(folder: Path, arguments: list[str], sentence: str) -> None:
    ended = gcs("campaign", *arguments)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith(sentence)
    assert ended.stderr.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == ["c.toml"]


SEARCH = """\
plan = "hop"
vehicle = "x_quad"
state = "truth"
[campaign]
[vary]
wind.gust_m_s = { uniform = [0, 10] }
[expect]
max_error_m = 0.2
"""


def test_a_search_continues_and_its_flights_fly_alone(folder: Path) -> None:
    (folder / "s.toml").write_text(SEARCH)
    arguments = ("campaign", "s.toml", "--seek", "worst", "--flights", 20, "--out", "found", "--json")
    first = gcs(*arguments)
    (found,) = events(first.stdout, "search")
    rows = {event["flight"]: event for event in events(first.stdout, "flight")}
    assert (first.returncode, len(rows)) == (1, found["flights"])
    assert len(rows) <= 20
    assert rows[1]["inputs"] == {"wind.gust_m_s": 0.0}
    failing = [row["inputs"]["wind.gust_m_s"] for row in rows.values() if not row["passed"]]
    smallest = rows[found["smallest"]]
    assert smallest["inputs"]["wind.gust_m_s"] == min(failing)
    assert rows[found["worst"]]["robustness"] == min(row["robustness"] for row in rows.values())
    assert f"all flights have seed {rows[1]['seed']}:" in Path("found/report.html").read_text()
    more = gcs("campaign", "s.toml", "--seek", "worst", "--flights", 30, "--out", "found")
    assert more.stderr.startswith("gcs: found: --flights has changed since its flights: ")
    table = Path("found/flights.parquet").read_bytes()
    journal = Path("found/flights.jsonl").read_bytes().splitlines(keepends=True)
    Path("found/flights.jsonl").write_bytes(b"".join(journal[:-3]))  # as after SIGKILL
    again = gcs(*arguments, "--workers", 1)  # the first run had as many as processors
    assert len(events(again.stdout, "flight")) == 3
    assert Path("found/flights.parquet").read_bytes() == table
    alone = gcs(
        *("campaign", "s.toml", "--seek", "worst", "--out", "found"),
        *("--only", found["smallest"], "--json"),
    )
    (flown,) = events(alone.stdout, "flight")
    assert (flown["log_sha256"], alone.stderr) == (smallest["log_sha256"], "")
    (folder / "s.toml").write_text(SEARCH.replace("0.2", "0.3"))
    changed = gcs("campaign", "s.toml", "--seek", "worst", "--out", "found", "--only", 1)
    assert changed.stdout.startswith(
        "s.toml has changed since the search: this flight may differ from its flight 1\n"
    )
    other = gcs("campaign", "c.toml", "--seek", "worst", "--out", "found", "--only", 1)
    assert (other.returncode, other.stdout, other.stderr) == (
        2,
        "",
        "gcs: found: the directory holds the campaign of s.toml: give the --out of the search\n",
    )
