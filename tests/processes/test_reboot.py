"""A reboot by command: the vehicle restarts, and keeps plans, home and parameters."""

from __future__ import annotations

from pathlib import Path

import pytest
from pyulog import ULog

from tests.support.commands import gcs
from tests.support.tools import NIGHTLY
from tests.support.vehicle_processes import vehicle

MISSION = Path(__file__).parents[2] / "missions" / "square.plan"


@pytest.mark.parametrize(
    "options",
    [("--clock", "realtime"), ("--loops", "host")] + NIGHTLY * [(), ("--wait-for-start",)],
    ids=" ".join,
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
            there.wait_until_healthy()
            assert gcs("--connect", there.link, "arm").returncode == 0
            assert gcs("--connect", there.link, "disarm", "--force").returncode == 0
        there.stack.terminate()
        _, errors = there.stack.communicate(timeout=60)
        assert there.stack.returncode == 0
        assert errors.count("flightstack: rebooted") == 1


def test_many_reboots_at_full_speed_lose_no_state(tmp_path: Path) -> None:
    """A state that was received but not taken when the reboot came was lost: both processes waited for ever."""
    with vehicle(tmp_path, "--log", "none", "--params", "none", speed="max") as there:
        for _ in range(12):
            there.wait_until_healthy()
            assert gcs("--connect", there.link, "--timeout", 60, "reboot").returncode == 0
        there.wait_until_healthy()


def test_no_reboot_in_the_air(tmp_path: Path) -> None:
    with vehicle(tmp_path, "--log", "none", "--params", "none", speed="max") as there:
        there.wait_until_healthy()
        assert gcs("--connect", there.link, "takeoff", "--alt", 3).returncode == 0
        refused = gcs("--connect", there.link, "reboot")
        assert refused.returncode == 1
        assert "taking off" in refused.stderr or "in the air" in refused.stderr


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


def test_a_bad_parameter_file_refuses_the_reboot_and_the_vehicle_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.params"
    with vehicle(tmp_path, "--log", "none", "--params", file) as there:

        def run(*words: object) -> tuple[int, str]:
            ended = gcs("--connect", there.link, "--timeout", 60, *words)
            return ended.returncode, ended.stdout + ended.stderr

        assert run("param", "get", "MIS_TAKEOFF_ALT")[0] == 0
        good = file.read_text()
        file.write_text(f"{there.instance + 1}\t1\tMIS_TAKEOFF_ALT\tnonsense\t9\n")
        code, said = run("reboot")
        assert code == 1, said
        assert "not rebooted" in said
        assert "vehicle.params" in said
        there.wait_until_healthy()
        assert run("arm")[0] == 0
        assert run("disarm", "--force")[0] == 0
        file.write_text(good)
        assert run("reboot")[0] == 0
        assert run("param", "get", "MIS_TAKEOFF_ALT")[0] == 0
        there.stack.terminate()
        _, errors = there.stack.communicate(timeout=60)
        assert there.stack.returncode == 0
        assert errors.count("flightstack: rebooted") == 1
        assert errors.count("flightstack: not rebooted: ") == 1


@pytest.mark.parametrize("clock", ["lockstep", "realtime"])
def test_the_log_after_a_reboot_has_the_loops_timing(tmp_path: Path, clock: str) -> None:
    options = ("--log", "flight.ulg", "--params", "none", "--clock", clock, "--param", "COM_DISARM_PRFLT=3")
    with vehicle(tmp_path, *options, speed=3) as there:

        def run(*words: object) -> str:
            ended = gcs("--connect", there.link, "--timeout", 60, *words)
            assert ended.returncode == 0, ended.stderr
            return ended.stdout

        for flight in range(2):
            if flight:
                run("reboot")
            there.wait_until_healthy()
            run("arm")
            run("wait", "disarmed")  # by itself
    for name in ("flight.ulg", "flight-2.ulg"):
        log = ULog(str(tmp_path / name))
        seconds = (log.last_timestamp - log.start_timestamp) // 1_000_000
        assert seconds == 3
        assert len(log.get_dataset("loop_timing").data["timestamp"]) in (seconds, seconds + 1)
