"""Our programs start one another, whatever lies in the working directory."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

import flightstack
from flightstack.process.command_line import own_program


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
