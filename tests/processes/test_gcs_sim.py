"""``gcs sim`` as a process: ready vehicles, their end together, and a process that dies."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import pytest

from flightstack.testing.instances import free_instance
from tests.support.commands import gcs
from tests.support.process import Process, children_of, ends_of
from tests.support.programs import NEW_INTERPRETERS
from tests.support.terminal import terminal


def test_sim_serves_vehicles_until_interrupted(tmp_path: Path) -> None:
    first = free_instance(count=2)
    sim = Process(
        "gcs_cli", "sim", "--json", "--vehicles", "2", "--instance", str(first), "--speed", "10",
        "--log", str(tmp_path / "a.ulg"), "--state-dir", str(tmp_path / "state"),
    )  # fmt: skip
    try:
        sim.wait_for('"ready"')
        events = [json.loads(line) for line in sim.lines if line.startswith("{")]
        assert [event["event"] for event in events] == ["vehicle_ready", "vehicle_ready", "ready"]
        assert [event["instance"] for event in events[:2]] == [first, first + 1]
        for event in events[:2]:
            assert gcs("--connect", event["gcs"], "--timeout", 60, "arm").returncode == 0
        sim.interrupt()
        assert sim.end() == 0
        assert json.loads(sim.lines[-1]) == {"event": "ended", "reason": "interrupted"}
    finally:
        sim.kill()
    assert sorted(path.name for path in (tmp_path / "state").iterdir()) == [
        f"instance-{first}",
        f"instance-{first + 1}",
    ]
    assert (tmp_path / f"instance-{first}" / "a.ulg").stat().st_size > 0


def test_sim_ends_all_when_one_process_dies() -> None:
    first = free_instance()
    sim = Process("gcs_cli", "sim", "--instance", str(first), "--log", "none", "--state-dir", "none")
    try:
        sim.wait_for("Ctrl-C ends the simulation")
        os.kill(children_of(sim.popen.pid)["flightstack"], signal.SIGKILL)
        assert sim.end() == 1
        assert (
            f"gcs: vehicle {first + 1} (instance {first}): flightstack was killed by signal 9" in sim.output
        )
    finally:
        sim.kill()


def test_killed_sim_ends_its_vehicle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(NEW_INTERPRETERS, "1")
    sim = Process(
        "gcs_cli", "sim", "--instance", str(free_instance()), "--log", "none", "--state-dir", "none"
    )
    try:
        sim.wait_for("Ctrl-C ends the simulation")
        with ends_of(*children_of(sim.popen.pid).values()):
            sim.kill()
    finally:
        sim.kill()


def test_ctrl_c_in_the_view_of_sim_ends_all() -> None:
    instance = str(free_instance())
    words = [
        "-m",
        "gcs_cli",
        "sim",
        "--watch",
        "--instance",
        instance,
        "--log",
        "none",
        "--state-dir",
        "none",
    ]
    with terminal(words) as screen:
        screen.read_until(b"Position")
        children = children_of(screen.process.pid)
        assert set(children) == {"sim_bridge", "flightstack", "gcs_cli"}
        with ends_of(*children.values()):
            screen.type(b"\x03")
        screen.read_until(b"simulation ended")
        assert screen.process.wait() == 0
        assert screen.is_restored()
        assert b"Traceback" not in screen.seen
