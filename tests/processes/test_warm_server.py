"""Programs from the warm server: they see PYTHONPATH, and end with a test process that is killed."""

from __future__ import annotations

import os
import select
import subprocess
import sys
from pathlib import Path

import pytest

from flightstack.testing.instances import free_instance
from tests.support.plugin_site import install
from tests.support.process import children_of, ends_of
from tests.support.programs import ROOT, Program

CLIENT = """
import sys
from tests.support.programs import Program
program = Program("sim_bridge", ["--port", "0"])
print(program.stdout.readline() and program.pid, flush=True)
sys.stdin.read()
"""


def test_a_program_finds_packages_on_its_pythonpath(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The server, which an earlier program has started, had another path."""
    told = []
    for path in ("", str(install(tmp_path))):
        monkeypatch.setenv("PYTHONPATH", path)
        told.append(Program("flightstack", ["--controller", "lqr", "--check"]).communicate())
    assert "there is no such attitude controller" in told[0][1]
    assert "with lqr" in told[1][0]


def test_programs_of_a_killed_test_process_end() -> None:
    """A vehicle in real time would take a core from later runs."""
    client = subprocess.Popen(
        [sys.executable, "-c", CLIENT], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with client:
        assert client.stdout is not None
        program = os.pidfd_open(int(client.stdout.readline()))
        client.kill()
    assert select.select([program], [], [], 60.0)[0]
    os.close(program)


def test_a_signal_to_a_program_whose_end_is_not_reported_yet_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    program = Program("sim_bridge", ["--version"])
    program.communicate(timeout=60)
    monkeypatch.setattr(program, "poll", lambda: None)  # its process is gone, the server has not said so
    program.kill()
    assert program.returncode == 0


def test_children_of_a_program_are_found_and_end_with_it(tmp_path: Path) -> None:
    arguments = ["sim", "--instance", str(free_instance()), "--log", "none", "--state-dir", "none"]
    sim = Program("gcs_cli", arguments, tmp_path)
    while "Ctrl-C ends" not in (line := sim.stdout.readline()):
        assert line, "gcs sim ended at its start"
    children = children_of(sim.pid)
    assert set(children) == {"sim_bridge", "flightstack"}
    with ends_of(*children.values()):
        sim.kill()
    sim.communicate()
