"""Programs whose output goes nowhere: a closed pipe or a full disk ends none of them with a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.commands import gcs
from tests.support.vehicle_processes import LONG_S, vehicle

NAMES = {"flightstack": "flightstack", "sim_bridge": "sim-bridge", "gcs_cli": "gcs"}
PROGRAMS = tuple(NAMES)


def closed_pipe() -> int:
    """Return the end of a pipe that nothing reads."""
    reader, writer = os.pipe()
    os.close(reader)
    return writer


def run(command: list[str], **streams: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *command], text=True, timeout=LONG_S, check=False,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},
    )  # fmt: skip


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_into_a_closed_pipe_ends_quietly(program: str) -> None:
    pipe = closed_pipe()
    assert run([program, "--help"], stdout=pipe).stderr == ""
    os.close(pipe)


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_onto_a_full_disk_is_one_sentence(program: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = run([program, "--help"], stdout=full.fileno())
    assert (done.stderr, done.returncode) == (f"{NAMES[program]}: No space left on device\n", 1)


@pytest.mark.parametrize(
    "command",
    [
        ["flightstack", "--check", "--state-dir", "none"],
        ["gcs_cli", "fly", "hop", "--out", "run"],
        ["gcs_cli", "test", "hop.toml"],
    ],
    ids=" ".join,
)
def test_a_result_onto_a_full_disk_is_one_sentence(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "hop.toml").write_text('plan = "hop"\n')
    monkeypatch.chdir(tmp_path)
    with Path("/dev/full").open("w") as full:
        done = run(command, stdout=full.fileno())
    assert (done.stderr, done.returncode) == (f"{NAMES[command[0]]}: No space left on device\n", 1)


@pytest.mark.parametrize("program", PROGRAMS)
def test_an_error_into_a_closed_pipe_keeps_its_exit_code(program: str) -> None:
    pipe = closed_pipe()
    wrong = {"gcs_cli": ["--connect", "nonsense", "status"]}.get(program, ["--vehicle", "no_such"])
    assert run([program, *wrong], stderr=pipe).returncode == 2
    os.close(pipe)


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_character_that_cannot_be_encoded_is_replaced(
    program: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "latin-1")
    wrong = {"gcs_cli": ["--connect", "ψ", "status"]}.get(program, ["--vehicle", "ψ"])
    done = run([program, *wrong])
    assert done.returncode == 2
    assert "?" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_vehicle_goes_on_when_its_output_is_closed(tmp_path: Path) -> None:
    with vehicle(tmp_path, "--log", "/dev/full", "--params", "none") as there:
        for stream in (there.stack.stdout, there.stack.stderr):
            assert stream is not None
            stream.close()  # as `head -1` does when it has read enough
        there.wait_until_healthy()
        # arming opens the log, which fails, and the complaint goes nowhere
        for words in (("arm",), ("disarm", "--force"), ("reboot",), ("status",)):
            done = gcs("--connect", there.link, "--timeout", 60, *words)
            assert done.returncode == 0, (words, done.stderr)
        there.stack.terminate()
        assert there.stack.wait(LONG_S) == 0
