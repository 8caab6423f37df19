"""``gcs test`` with its worker processes: exit codes, order, Ctrl-C, SIGKILL, watching."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from tests.support.commands import Ended, gcs
from tests.support.plugin_site import ROOT, install
from tests.support.process import BOUND_S, Process, children_of
from tests.support.programs import NEW_INTERPRETERS
from tests.support.warm_children import warm_children

GOOD = "plan = 'hop'\nstate = 'truth'\n[expect]\nmax_error_m = 0.2\n"
BAD = "plan = 'hop'\nstate = 'truth'\n[expect]\nmax_error_m = 0.0001\n"
ENDLESS = "duration_s = 1000000\n[expect]\nat_end = ['landed']\n"
WORKER = "gcs_cli.scenarios.worker"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def _warm() -> Iterator[None]:
    """Fork the workers of commands in this process; those of commands in other processes are new interpreters."""
    with warm_children():
        yield


def write(**texts: str) -> None:
    for name, text in texts.items():
        Path(f"{name}.toml").write_text(text, encoding="utf-8")


def document(*arguments: object) -> tuple[dict[str, Any], Ended]:
    ended = gcs("test", "--json", *arguments)
    return json.loads(ended.stdout), ended


def test_a_run_without_failures_exits_with_0(folder: Path) -> None:
    write(a=GOOD)
    ended = gcs("test", "-j", 1)
    first, last = (line for line in ended.stdout.splitlines() if not line.startswith("compiling kernels"))
    assert first.startswith("PASS  a  seed 1  max_error_m ≤ 0.2: margin 0.1")
    assert last.startswith("1 passed in ")
    assert (ended.stderr, ended.returncode) == ("", 0)
    assert sorted(folder.iterdir()) == [folder / "a.toml"]


def test_a_failure_exits_with_1_and_leaves_its_log(folder: Path) -> None:
    write(bad=BAD, good=GOOD)
    ended = gcs("test", ".", "--junit", "j.xml", "--report", "r.html")
    assert ended.returncode == 1
    assert "repeat: gcs test bad.toml" in ended.stdout
    (kept,) = folder.glob("runs/*-test/*")
    assert kept.name == "bad-seed1"
    assert f"log and report: {kept.relative_to(folder)}" in ended.stdout
    assert sorted(path.name for path in kept.iterdir()) == ["flight.ulg", "report.html"]
    assert ElementTree.parse("j.xml").getroot().get("failures") == "1"
    assert "<title>Scenarios: 1 failed</title>" in Path("r.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["a.toml", "wrong.toml"], "gcs: wrong.toml: spid: is not a known key; known are "),
        (["none"], "gcs: none: there is no such file or folder"),
        (["a.toml", "-k", "b"], "gcs: -k b: matches none of a"),
        (["a.toml", "--junit", "j.txt"], "gcs: --junit j.txt: give the file a name that ends in .xml"),
        (["a.toml", "--report", "no/r.html"], "gcs: --report no/r.html: there is no directory no"),
        (["a.toml", "--watch", "--json"], "gcs: --watch and --json exclude each other"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_bad_file_or_option_exits_with_2_before_a_flight(
    folder: Path, arguments: list[str], sentence: str
) -> None:
    write(a=GOOD, wrong=GOOD.replace("plan", "spid = 3\nplan"))
    ended = gcs("test", *arguments)
    assert ended.stderr.startswith(sentence)
    assert ended.stderr.count("\n") == 1
    told = [json.loads(line) for line in ended.stdout.splitlines()]
    error = {"event": "error", "message": sentence.removeprefix("gcs: "), "exit_code": 2}
    assert (told, ended.returncode) == ([error] if "--json" in arguments else [], 2)


def test_the_number_of_processes_changes_no_result(folder: Path) -> None:
    gusty = (
        "plan = 'hop'\nstate = 'truth'\nvehicle = 'x_quad'\nrepeat = 3\nwind = {gust_m_s = 1}\n"
        "[expect]\nmax_error_m = 0.05\n"
    )
    write(b=gusty, a=BAD, c=GOOD)
    found = []
    for jobs in (1, 2):
        results, ended = document("-j", jobs, "--keep", "kept")
        assert ended.returncode == 1
        for flight in results["flights"]:
            del flight["wall_time_s"]
        found.append(results["flights"])
    assert [(flight["scenario"], flight["seed"]) for flight in found[0]] == [
        ("a", 1), ("b", 1), ("b", 2), ("b", 3), ("c", 1),
    ]  # fmt: skip
    assert found[0] == found[1]
    assert found[0][0]["log_sha256"] is not None


@pytest.mark.parametrize("jobs", [1, 2])
def test_exitfirst_ends_at_the_first_failure_in_order(folder: Path, jobs: int) -> None:
    write(a=GOOD, b=BAD, c=ENDLESS)
    results, ended = document("-x", "-j", jobs, "--keep", "kept")
    assert [flight["scenario"] for flight in results["flights"]] == ["a", "b"]
    assert ended.returncode == 1


def test_a_log_that_cannot_be_kept_does_not_end_the_run(folder: Path) -> None:
    write(bad=BAD, good=GOOD)
    Path("kept").touch()
    ended = gcs("test", "-j", 1, "--keep", "kept")
    assert "gcs: the log of bad-seed1 is not kept: " in ended.stdout
    assert "PASS  good" in ended.stdout
    assert ended.returncode == 1


def has_ended(process: int) -> bool:
    """Wait for the end of a process that is not a child; BOUND_S is a hang guard."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return True
    with os.fdopen(descriptor):
        return bool(select.select([descriptor], [], [], BOUND_S)[0])


def flying(*arguments: str) -> tuple[Process, int]:
    """Start a run whose second flight has no end; return it and its worker once the first flight is over."""
    write(a=GOOD, b=ENDLESS)
    run = Process("gcs_cli", "test", "-j", "1", *arguments)
    run.wait_for("PASS  a")
    return run, children_of(run.popen.pid)[WORKER]


def test_ctrl_c_shows_the_flights_that_are_over(folder: Path) -> None:
    run, worker = flying("--junit", "j.xml", "--report", "r.html")
    run.interrupt()
    assert run.end() == 130
    assert "1 passed in " in run.output
    assert run.lines[-1] == "gcs: interrupted: 1 of 2 flights were flown"
    assert has_ended(worker)
    assert ElementTree.parse("j.xml").getroot().get("tests") == "1"
    assert "interrupted: only the flights that were over are shown" in Path("r.html").read_text(
        encoding="utf-8"
    )


def read_until(terminal: int, text: bytes) -> bytes:
    """Read a terminal up to a text; BOUND_S is a hang guard."""
    seen = b""
    while text not in seen:
        assert select.select([terminal], [], [], BOUND_S)[0], seen
        seen += os.read(terminal, 4096)
    return seen


def test_ctrl_c_restores_the_terminal(folder: Path) -> None:
    write(a=GOOD, b=ENDLESS)
    terminal, inner = pty.openpty()
    try:
        process = subprocess.Popen(
            [sys.executable, "-m", "gcs_cli", "test", "-j", "1"],
            stdin=inner, stdout=inner, stderr=inner,
            env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"},
        )  # fmt: skip
        seen = read_until(terminal, b"b seed 1")  # under way
        assert b"\x1b[?25l" in seen  # the cursor is hidden
        process.send_signal(signal.SIGINT)
        seen = read_until(terminal, b"of 2 flights were flown")
        assert b"\x1b[?25h" in seen
        assert process.wait(BOUND_S) == 130
    finally:
        os.close(inner)
        os.close(terminal)


def test_sigkill_leaves_no_process_and_no_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(NEW_INTERPRETERS, "1")
    run, worker = flying("--junit", "j.xml")
    run.kill()
    assert has_ended(worker)
    assert sorted(path.name for path in folder.iterdir()) == ["a.toml", "b.toml"]


def test_a_killed_worker_is_a_failure_and_the_next_flight_has_a_new_one(folder: Path) -> None:
    write(a=GOOD, b=ENDLESS, c=GOOD)
    run = Process("gcs_cli", "test", "-j", "1")
    run.wait_for("PASS  a")
    os.kill(children_of(run.popen.pid)[WORKER], signal.SIGKILL)
    run.wait_for("FAIL  b  seed 1  flight: the process that flew it was killed by signal 9")
    run.wait_for("PASS  c")
    assert run.end() == 1


def test_watch_flies_what_changed_until_ctrl_c(folder: Path) -> None:
    write(a=GOOD, b=GOOD)
    run = Process("gcs_cli", "test", "--watch", "-j", "1", "--keep", "kept", "--report", "r.html")
    run.wait_for("watching 3 files; Ctrl-C ends")
    before = len(run.lines)
    write(b=BAD)
    run.wait_for("watching 3 files")
    assert [line[:7] for line in run.lines[before:] if line.startswith(("PASS", "FAIL"))] == ["FAIL  b"]
    page = Path("r.html").read_text(encoding="utf-8")
    assert 'data-name="a"' in page
    assert "1 failed" in page
    write(b="plan = 3\n[expect]\n")
    run.wait_for("gcs: b.toml: plan: 3 is not a text")
    write(b=GOOD)
    run.wait_for("PASS  b")
    run.wait_for("watching 3 files")
    worker = children_of(run.popen.pid)[WORKER]
    run.interrupt()
    assert run.end() == 0
    assert has_ended(worker)


def test_watch_flies_a_changed_controller(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site = folder / ".site"
    site.mkdir()
    install(site)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), str(ROOT)]))
    write(a=f"controller = 'lqr'\ntorque_n_m = [0.005, 0.0, 0.0]\n{GOOD}")
    # a new interpreter: the warm server has another path
    run = Process("gcs_cli.__main__", "test", "--watch", "-j", "1", "--keep", "kept")
    run.wait_for("PASS  a")
    run.wait_for("watching 3 files")
    law = site / "lqr_controller.py"
    text = law.read_text()
    law.write_text(text.replace("roll = params", "roll = -params"))
    run.wait_for("FAIL  a")
    run.wait_for("watching 3 files")
    law.write_text("1 / 0\n")
    run.wait_for("cannot be loaded: division by zero")
    law.write_text(text)
    run.wait_for("PASS  a")
    run.wait_for("watching 3 files")
    run.interrupt()
    assert run.end() == 0
