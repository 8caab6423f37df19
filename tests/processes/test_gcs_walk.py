"""Every command of ``gcs`` for a vehicle, once, against a real one: simulator and flight stack as processes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.commands import gcs
from tests.support.gcs_commands import ON_VEHICLE, PLAN
from tests.support.vehicle_processes import VehicleProcesses, vehicle

STEPS = [
    ("wait", "ready", "ready"),
    ("status", "", "mode        HOLD"),
    ("mode", "", "Hold (current)"),
    ("perf", "", "250"),
    ("watch", "--once", "DISARMED"),
    ("messages", "--duration 0", ""),
    ("listen", "ATTITUDE --field roll --count 1", ""),
    ("send", "COMMAND_LONG command=REQUEST_MESSAGE param1=30", "accepted"),
    ("record", "r.tlog --duration 0.5", "recorded in r.tlog"),
    ("param list", "", "MPC_XY_CRUISE"),
    ("param search", "cruise", "MPC_XY_CRUISE"),
    ("param set", "MPC_XY_CRUISE 3", "MPC_XY_CRUISE = 3 m/s (was 4)"),
    ("param get", "MPC_XY_CRUISE", "MPC_XY_CRUISE = 3"),
    ("param diff", "", "MPC_XY_CRUISE"),
    ("param save", "x.params", "saved to x.params"),
    ("param reset", "MPC_XY_CRUISE", "MPC_XY_CRUISE = 4"),
    ("param load", "x.params", "1 of"),
    ("fence upload", f"{PLAN}", "uploaded"),
    ("fence verify", f"{PLAN}", "equal"),
    ("fence show", "", "FENCE_"),
    ("fence download", "f.plan", "downloaded to f.plan"),
    ("rally upload", f"{PLAN}", "uploaded"),
    ("rally verify", f"{PLAN}", "equal"),
    ("rally show", "", "RALLY_POINT"),
    ("rally download", "y.plan", "downloaded to y.plan"),
    ("rally clear", "", "cleared"),
    ("mission upload", f"{PLAN}", "uploaded"),
    ("mission verify", f"{PLAN}", "equal"),
    ("mission check", f"{PLAN} --vehicle", "good"),
    ("mission show", "", "NAV_WAYPOINT"),
    ("mission download", "m.plan", "downloaded to m.plan"),
    ("arm", "", "armed"),
    ("disarm", "", "disarmed"),
    ("takeoff", "--alt 3", "at 3 m after"),
    ("set-home", "", "home is the present position"),
    ("goto", "47.39776 8.54562", "at 47.3977600 8.5456200 after"),
    ("yaw", "90", "pointing to 90 degrees"),
    ("speed", "2", "accepted: speed 2 m/s"),
    ("hold", "", "holding the position"),
    ("mission start", "", "mission started"),
    ("mission pause", "", "mission paused"),
    ("mission jump", "2", "item 2 is the current one"),
    ("mission resume", "", "mission resumed"),
    ("rtl", "--no-wait", "returning to launch"),
    ("land", "", "landed and disarmed after"),
    ("mission clear", "", "cleared"),
    ("fence clear", "", "cleared"),
    ("inject", "motor off --number 2", "accepted"),
    ("inject", "motor ok --number 2", "accepted"),
    ("shell", "-c status -c arm", "armed"),
    ("terminate", "--yes", "flight terminated"),
    ("log list", "", ".ulg"),
    ("log download", "--out l.ulg", "written to l.ulg"),
    ("log erase", "--yes", ""),
    ("reboot", "", "rebooted"),
]  # fmt: skip
"""Command, arguments, and a part of what it prints."""


@pytest.fixture(scope="module")
def flying(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VehicleProcesses]:
    with vehicle(tmp_path_factory.mktemp("walk"), "--param", "SYS_FAILURE_EN=1", speed=10) as processes:
        processes.wait_until_healthy()
        yield processes


def test_walk_has_every_command_for_a_vehicle() -> None:
    assert {name for name, _, _ in STEPS} == set(ON_VEHICLE)


@pytest.mark.long
def test_every_command_works_on_a_real_vehicle(
    flying: VehicleProcesses, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(flying.folder)
    failed = []
    for name, words, said in STEPS:
        ended = gcs("--connect", flying.link, *name.split(), *words.split())
        if ended.returncode or ended.stderr or said not in ended.stdout:
            failed.append((name, ended))
    assert not failed
