"""A reboot by command: the vehicle begins anew, and keeps what it was given."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.gcs import gcs
from tests.support.vehicle_processes import vehicle

MISSION = Path(__file__).parents[2] / "missions" / "square.plan"


@pytest.mark.parametrize(
    "options", [(), ("--clock", "realtime"), ("--wait-for-start",), ("--loops", "host")], ids=" ".join
)
def test_a_reboot_keeps_plan_and_parameters(tmp_path: Path, options: tuple[str, ...]) -> None:
    with vehicle(tmp_path, "--log", "flight.ulg", "--params", "none", *options) as there:

        def run(*words: object) -> str:
            ended = gcs("--connect", there.link, "--timeout", 60, *words)
            assert ended.returncode == 0, ended.stderr
            return ended.stdout

        run("mission", "upload", MISSION)
        run("param", "set", "MIS_TAKEOFF_ALT", 4.5)
        run("reboot")
        assert "4.5" in run("param", "get", "MIS_TAKEOFF_ALT")
        run("mission", "download", tmp_path / "after.plan")
        if "--wait-for-start" not in options:
            assert gcs("--connect", there.link, "arm").returncode == 0
            assert gcs("--connect", there.link, "disarm", "--force").returncode == 0
        there.stack.terminate()
        _, errors = there.stack.communicate(timeout=60)
        assert there.stack.returncode == 0
        assert errors.count("flightstack: rebooted") == 1


def test_no_reboot_in_the_air(tmp_path: Path) -> None:
    with vehicle(tmp_path, "--log", "none", "--params", "none", speed="max") as there:
        assert gcs("--connect", there.link, "takeoff", "--alt", 3).returncode == 0
        refused = gcs("--connect", there.link, "reboot")
        assert refused.returncode == 1
        assert "armed" in refused.stderr or "in the air" in refused.stderr


def test_a_reboot_while_no_simulator_is_there_is_a_reboot_too(tmp_path: Path) -> None:
    with vehicle(tmp_path, "--log", "none", "--params", "none", with_simulator=False) as there:
        for _ in range(2):
            ended = gcs("--connect", there.link, "--timeout", 60, "reboot")
            assert ended.returncode == 0, ended.stderr
        assert (
            gcs("--connect", there.link, "--timeout", 60, "param", "get", "MIS_TAKEOFF_ALT").returncode == 0
        )
        there.stack.terminate()
        _, errors = there.stack.communicate(timeout=60)
        assert there.stack.returncode == 0
        assert errors.count("flightstack: rebooted") == 2
        assert "Traceback" not in errors
