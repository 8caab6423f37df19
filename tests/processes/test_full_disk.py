"""A disk that fills up in flight: the ground station hears of it once, and the flight goes on."""

from __future__ import annotations

import io
import resource
from pathlib import Path

from pyulog import ULog

from tests.support.commands import gcs
from tests.support.process import Process
from tests.support.vehicle_processes import LONG_S, vehicle

ROOM = 60_000
"""Bytes that a file may have: the kernel refuses more, as a full disk does."""


def test_a_disk_full_in_flight_is_told_once_and_the_flight_goes_on(tmp_path: Path) -> None:
    with vehicle(tmp_path, "--log", "flight.ulg", "--params", "none", speed=10) as there:
        limits = resource.prlimit(there.stack.pid, resource.RLIMIT_FSIZE, (ROOM, resource.RLIM_INFINITY))
        link = ("--connect", there.link, "--timeout", "60")
        watch = Process("gcs_cli", *link, "watch")
        watch.wait_for("HOLD")
        there.wait_until_healthy()
        assert gcs(*link, "takeoff", "--alt", 3).returncode == 0
        watch.wait_for("Logging stopped: File too large")
        there.wait_until_in_air()
        assert gcs(*link, "hold").returncode == 0
        assert gcs(*link, "land").returncode == 0
        watch.wait_for("Disarmed")
        resource.prlimit(there.stack.pid, resource.RLIMIT_FSIZE, limits)
        assert gcs(*link, "arm").returncode == 0  # the next flight has a log again
        assert gcs(*link, "disarm", "--force").returncode == 0
        watch.interrupt()
        watch.end()
        there.stack.terminate()
        _, errors = there.stack.communicate(timeout=LONG_S)
    assert there.stack.returncode == 0
    assert errors.splitlines() == [
        "flightstack: warning: the log flight.ulg ends early: File too large",
        "flightstack: stopped",
    ]
    assert watch.output.count("Logging stopped") == 1
    first, second = ((tmp_path / name).read_bytes() for name in ("flight.ulg", "flight-2.ulg"))
    assert ROOM - 2000 < len(first) <= ROOM  # a message has at most 0.5 kB
    for content in (first, second):
        log = ULog(io.BytesIO(content))
        assert not log.file_corruption
        assert log.data_list


def test_a_log_that_cannot_be_begun_is_told_once(tmp_path: Path) -> None:
    with vehicle(tmp_path, "--log", "/dev/full", "--params", "none", speed=10) as there:
        link = ("--connect", there.link, "--timeout", "60")
        there.wait_until_healthy()
        assert gcs(*link, "takeoff", "--alt", 3).returncode == 0
        there.wait_until_in_air()
        for mode in ("hold", "land", "hold"):
            assert gcs(*link, mode).returncode == 0
        there.stack.terminate()
        _, errors = there.stack.communicate(timeout=LONG_S)
    assert errors.count("/dev/full ends early: No space left on device") == 1
    assert "Traceback" not in errors
