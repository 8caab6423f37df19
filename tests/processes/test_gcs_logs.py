"""``gcs log``, ``gcs report`` and ``gcs replay`` on files and on a real vehicle."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.testing.instances import free_instance
from gcs_cli.clients.log_client import LogEntry
from gcs_cli.transfers import log_calls
from tests.support.commands import gcs
from tests.support.fake_vehicle import FakeVehicle
from tests.support.process import Process
from tests.support.sample_logs import small_tlog, small_ulog
from tests.support.told import told
from tests.support.vehicle_processes import vehicle


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    (tmp_path / "a.ulg").write_bytes(small_ulog())
    (tmp_path / "b.tlog").write_bytes(small_tlog())
    return tmp_path


@pytest.mark.parametrize(("name", "form"), [("a.ulg", "ULog"), ("b.tlog", "tlog")])
def test_log_info_prints_a_line_of_json_for_each_fact(logs: Path, name: str, form: str) -> None:
    ended = gcs("log", "info", logs / name, "--json")
    about, *others = map(json.loads, ended.stdout.splitlines())
    assert (ended.returncode, about["event"], about["format"]) == (0, "log", form)
    assert about["topics"] == sum(line["event"] == "topic" for line in others)
    assert gcs("log", "info", logs / name).stdout.startswith("log           ")


def test_log_plot_writes_pages_and_pictures(logs: Path) -> None:
    page, picture = logs / "p.html", logs / "p.png"
    fields = ("local_position.z", "vehicle_attitude.q")
    assert gcs("log", "plot", logs / "a.ulg", *fields, "--html", page, "--png", picture).returncode == 0
    assert "vehicle_attitude" in page.read_text()
    assert picture.read_bytes().startswith(b"\x89PNG")
    again = gcs("log", "plot", logs / "a.ulg", *fields, "--html", page)
    assert (again.returncode, "--overwrite" in again.stderr) == (2, True)


def test_log_plot_prints_samples_as_json(logs: Path) -> None:
    ended = gcs("log", "plot", logs / "b.tlog", "ATTITUDE.yaw", "--from", 1, "--to", 2, "--json")
    (line,) = map(json.loads, ended.stdout.splitlines())
    assert line["name"] == "ATTITUDE.yaw"
    assert len(line["values"]) == len(line["time_s"]) == 10
    assert all(1.0 <= at_s <= 2.0 for at_s in line["time_s"])
    assert gcs("log", "plot", logs / "b.tlog", "ATTITUDE.yaw", "--from", 2, "--to", 1).returncode == 2


def test_report_of_a_log_alone(logs: Path) -> None:
    ended = gcs("report", logs / "a.ulg", "--json")
    (line,) = map(json.loads, ended.stdout.splitlines())
    assert (ended.returncode, line["file"]) == (0, str(logs / "a.html"))
    assert line["summary"]["outcome"] is None
    assert line["summary"]["flight_time_s"] > 20.0
    assert "Path in space" in (logs / "a.html").read_text()
    assert gcs("report", logs / "a.ulg").returncode == 2
    ended = gcs("report", logs / "b.tlog", "-o", logs / "c.html")
    assert (ended.returncode, "b.tlog: is a tlog; give a ULog (.ulg)" in ended.stderr) == (2, True)


def test_report_of_a_damaged_log_warns(logs: Path) -> None:
    content = (logs / "a.ulg").read_bytes()
    (logs / "a.ulg").write_bytes(content[: len(content) // 2])
    ended = gcs("report", logs / "a.ulg")
    assert (ended.returncode, "the log is damaged" in ended.stderr) == (0, True)


def test_erase_removes_logs_of_a_disarmed_vehicle(tmp_path: Path) -> None:
    for name in ("1.ulg", "2.ulg"):
        (tmp_path / name).write_bytes(small_ulog()[:1000])
    with vehicle(tmp_path, "--log", tmp_path / "now.ulg", "--params", "none") as there:
        there.wait_until_healthy()
        link = ("--connect", there.link, "--timeout", 60)
        listed = map(json.loads, gcs(*link, "log", "list", "--json").stdout.splitlines())
        assert {line["name"] for line in listed} == {None}  # both have the same size
        refused = gcs(*link, "log", "erase")
        assert (refused.returncode, "--yes" in refused.stderr) == (2, True)
        assert gcs(*link, "arm").returncode == 0
        armed = gcs(*link, "log", "erase", "--yes")
        assert (armed.returncode, armed.stderr) == (1, "gcs: log erase: the vehicle is armed\n")
        assert gcs(*link, "disarm", "--force").returncode == 0
        erased = gcs(*link, "log", "erase", "--yes", "--json")
        assert erased.returncode == 0, erased.stderr
        assert json.loads(erased.stdout) == {"event": "erased", "erased": 3, "left": 0}
    assert list(tmp_path.glob("*.ulg")) == []


@pytest.mark.parametrize("name", ["a.ulg", "b.tlog"])
def test_replay_is_a_vehicle_that_refuses_commands(logs: Path, name: str) -> None:
    instance = str(free_instance())
    replay = Process("gcs_cli", "replay", str(logs / name), "--instance", instance, "--loop", "--json")
    try:
        replay.wait_for('"replaying"')
        status = gcs("--instance", instance, "--timeout", 60, "status")
        assert status.returncode == 0, status.stderr
        refused = gcs("--instance", instance, "--timeout", 60, "arm")
        assert refused.returncode == 1
        assert "this is the replay of a log" in refused.stderr
        value = gcs("--instance", instance, "--timeout", 60, "param", "get", "MPC_XY_CRUISE")
        assert value.stdout.startswith("MPC_XY_CRUISE = "), value.stderr
        replay.interrupt()
        assert replay.end() == 0
        assert json.loads(replay.lines[-1])["refused"] == 1
    finally:
        replay.kill()


def test_replay_ends_with_the_log(logs: Path) -> None:
    instance = free_instance()
    ended = gcs("replay", logs / "b.tlog", "--instance", instance, "--speed", 1000)
    assert ended.returncode == 0
    assert ended.stdout.splitlines()[-1] == "replay ended at 3.9 s"


def test_download_of_all_logs_goes_on_after_one_that_exists(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = tuple(LogEntry(number, 3, 0) for number in range(3))
    monkeypatch.setattr(log_calls, "fetch_list", lambda _: logs)
    monkeypatch.setattr(log_calls, "fetch_files", lambda _: ())
    monkeypatch.setattr(log_calls, "fetch_log", lambda *_: b"new")
    grown = tmp_path / "log_1.ulg"
    grown.write_bytes(b"ab")
    result = told(FakeVehicle(), "log", "download", "--all", "--out", tmp_path)
    assert (result.returncode, grown.read_bytes()) == (1, b"ab")
    assert result.stderr.startswith(f"gcs: {grown}: exists already with another size: ")
    assert [(tmp_path / f"log_{number}.ulg").read_bytes() for number in (0, 2)] == [b"new", b"new"]
    assert told(FakeVehicle(), "log", "download", "--all", "--overwrite", "-o", tmp_path).returncode == 0
    assert grown.read_bytes() == b"new"


def test_logs_of_ardupilot_are_named_bin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_calls, "fetch_list", lambda _: (LogEntry(1, 3, 0),))
    monkeypatch.setattr(log_calls, "fetch_files", lambda _: ())
    monkeypatch.setattr(log_calls, "fetch_log", lambda *_: b"new")
    vehicle = FakeVehicle(autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    assert told(vehicle, "log", "download", "-o", tmp_path).returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["log_1.bin"]


@pytest.mark.parametrize("cause", ["armed", "grown", "finished"])
def test_download_of_a_log_that_is_being_written_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cause: str
) -> None:
    sizes = iter([3, 9] if cause == "grown" else [3, 3])
    monkeypatch.setattr(log_calls, "fetch_list", lambda _: (LogEntry(1, next(sizes), 0),))
    monkeypatch.setattr(log_calls, "fetch_files", lambda _: ())
    monkeypatch.setattr(log_calls, "fetch_log", lambda *_: b"new")
    vehicle = FakeVehicle()
    vehicle.armed = cause == "armed"
    result = told(vehicle, "log", "download", "-o", tmp_path)
    assert result.returncode == 0
    assert ("still writing this log" in result.stdout) == (cause != "finished")
