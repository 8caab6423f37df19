"""Our programs start one another, whatever lies in the working directory."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

import flightstack
from flightstack.process.supervised import order, own_program, prepared, supervised
from gcs_cli.fly.processes import Children, prepare


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


def test_a_prepared_program_runs_what_it_is_given_and_ends_with_its_pipe(tmp_path: Path) -> None:
    output = tmp_path / "output.log"
    output.touch()
    with subprocess.Popen(prepared("flightstack"), stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        process.stdin.write(order(str(output), "flightstack", "--version"))
        process.stdin.flush()
        assert process.wait() == 0
    assert output.read_text() == f"flightstack {flightstack.__version__}\n"


def test_a_prepared_program_that_is_not_needed_ends_with_its_pipe() -> None:
    with subprocess.Popen(prepared("flightstack"), stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.communicate() == (None, b"")
    assert process.returncode == 0


def test_a_prepared_program_that_cannot_be_imported_says_so_in_its_output(tmp_path: Path) -> None:
    output = tmp_path / "output.log"
    output.touch()
    with subprocess.Popen(prepared("flightstack.missing"), stdin=subprocess.PIPE) as process:
        process.communicate(order(str(output), "flightstack", "--version"))
    assert process.returncode == 1
    assert output.read_text().splitlines()[-1] == "ModuleNotFoundError: No module named 'flightstack.missing'"


def test_each_prepared_program_is_taken_once(tmp_path: Path) -> None:
    with prepare() as programs, Children(tmp_path, programs) as children:
        simulator = children.start("sim-bridge", "sim_bridge", ["--version"])
        first = children.start("flightstack", "flightstack", ["--version"])
        assert children.wait(60.0)
        assert first.last_line == f"flightstack {flightstack.__version__}"
        assert simulator.last_line == f"sim-bridge {flightstack.__version__}"
        assert programs.take("sim_bridge", [], tmp_path / "sim-bridge.log") is None
        again = children.start("second", "flightstack", ["--version"])
        assert children.wait(60.0)
        assert again.last_line == first.last_line
        assert len({child.pid for child in children.ended()}) == 3


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
