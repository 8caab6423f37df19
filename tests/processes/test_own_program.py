"""Our programs start one another, whatever lies in the working directory."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

import flightstack
from flightstack.process.command_line import own_program
from flightstack.process.supervised import supervised


@pytest.mark.parametrize("inside", [False, True], ids=["elsewhere", "in the checkout"])
def test_folders_of_the_same_name_are_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inside: bool
) -> None:
    (tmp_path / "flightstack").mkdir()
    (tmp_path / "flightstack" / "__init__.py").write_text("raise SystemExit('the wrong one')")
    monkeypatch.chdir(Path(flightstack.__file__).parents[1] if inside else tmp_path)
    done = subprocess.run(
        own_program("flightstack", "--version"), capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == (f"flightstack {flightstack.__version__}\n", "")


def test_supervised_program_ends_when_its_pipe_closes() -> None:
    inherited, own_end = os.pipe()
    program = supervised("code", descriptor=inherited)
    with subprocess.Popen(
        program, stdin=subprocess.PIPE, stderr=subprocess.PIPE, pass_fds=[inherited]
    ) as child:
        os.close(inherited)
        assert child.stderr is not None
        assert child.stderr.readline()
        os.close(own_end)
        assert child.wait() == -signal.SIGTERM
