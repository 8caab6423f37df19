"""A parameter file that is named and missing: the process says so, begins it, and keeps changes there."""

from __future__ import annotations

from pathlib import Path

from tests.support.commands import gcs
from tests.support.vehicle_processes import vehicle


def test_a_missing_parameter_file_is_begun_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "new" / "my.params"
    with vehicle(
        tmp_path, "--log", "none", "--params", path, "--sim-timeout", 600, with_simulator=False
    ) as there:
        assert path.is_file()
        done = gcs("--connect", there.link, "--timeout", 60, "param", "set", "MIS_TAKEOFF_ALT", 4.5)
        assert done.returncode == 0, done.stderr
        there.stack.terminate()
        _, errors = there.stack.communicate(timeout=60)
    assert errors.startswith(f"flightstack: warning: {path}: no such file")
    assert "MIS_TAKEOFF_ALT\t4.5" in path.read_text()
