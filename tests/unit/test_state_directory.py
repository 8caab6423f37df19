"""The directory of parameters and plans: one vehicle holds it, and no saved parameter is lost."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from flightstack.process.state_directory import StateDirectory
from tests.support.commands import flightstack_command

SAVED = "1\t1\tMPC_XY_CRUISE\t50\t9\n"
REFUSED = "line 1: MPC_XY_CRUISE: 50 is outside 0.1 to 20 m/s"
IN_USE = "is in use by another vehicle: give each its own --instance or --state-dir DIR"


@pytest.fixture(autouse=True)
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    return tmp_path / "runs"


def start(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Start a vehicle that ends at its parameter file, in a process: the lock ends with it."""
    command = [sys.executable, "-m", "flightstack", "--log", "none", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_parameters_of_an_earlier_version_are_adopted(runs: Path) -> None:
    (runs / "params-3.params").write_text(SAVED)
    check = ("--instance", "3", "--check")
    assert flightstack_command(*check).stderr == f"flightstack: runs/params-3.params: {REFUSED}\n"
    assert os.listdir(runs) == ["params-3.params"]  # a check changes nothing
    new = "runs/state-3/vehicle.params"
    moved = f"flightstack: runs/params-3.params was moved to {new}\n"
    assert start("--instance", "3").stderr == f"{moved}flightstack: {new}: {REFUSED}\n"
    assert flightstack_command(*check).stderr == f"flightstack: {new}: {REFUSED}\n"
    directory = StateDirectory(None, 3)
    assert directory.open() is None  # nothing is moved again
    directory.close()
    assert os.listdir(runs) == ["state-3"]


def test_adoption_spares_newer_parameters_and_named_places(runs: Path) -> None:
    old = runs / "params-0.params"
    old.write_text(SAVED)
    for directory in (StateDirectory(Path("named"), 0), StateDirectory(None, 0, has_params=False)):
        assert directory.open() is None
        directory.close()
    (runs / "state-0" / "vehicle.params").write_text("newer")
    directory = StateDirectory(None, 0)
    assert directory.open() is None
    assert (directory.params.read_text(), old.read_text()) == ("newer", SAVED)
    directory.close()


def test_a_second_vehicle_is_refused_a_state_directory(tmp_path: Path) -> None:
    first = StateDirectory(Path("state"), 0)
    assert first.open() is None
    (tmp_path / "other").symlink_to("state")
    for name in ("state", "other"):
        done = flightstack_command("--log", "none", "--instance", "3", "--state-dir", name)
        assert (done.returncode, done.stderr) == (2, f"flightstack: --state-dir: {name} {IN_USE}\n")
    first.close()
    second = StateDirectory(Path("state"), 1)
    assert second.open() is None
    second.close()


def test_a_directory_that_cannot_be_made_is_refused_if_named(runs: Path) -> None:
    (runs / "state-0").write_text("")
    assert StateDirectory(None, 0).open() is None
    with pytest.raises(ConfigError, match="cannot be created: File exists"):
        StateDirectory(runs / "state-0", 0).open()
