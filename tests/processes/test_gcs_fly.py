"""``gcs fly`` with real simulator and flight stack: good ends, bad ends in order, and never an orphan."""

from __future__ import annotations

import functools
import json
import os
import re
import select
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink import mavutil

from flightstack.core.port_numbers import simulator_port, vehicle_ground_port
from flightstack.process.signing_file import create_key
from flightstack.testing.instances import free_instance
from flightstack.transports.udp import UdpSocket
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.processes import Child, Children
from gcs_cli.report.analysis import read_flight
from gcs_cli.tui.fly.panels import SEVERITIES, clock_text
from tests.support.commands import Ended, gcs
from tests.support.plugin_site import installed_site
from tests.support.process import await_output, children_of, ends_of
from tests.support.programs import NEW_INTERPRETERS, Program
from tests.support.warm_children import warm_children

LONG_S = 120.0  # a bound for a busy machine that compiles the kernels anew; a flight takes two seconds
MISSIONS = Path(__file__).parents[2] / "missions"
SIGNED = 0x01  # MAVLINK_IFLAG_SIGNED, in the third byte of a frame
SENSORS = ("--state", "estimated")
PATIENT = ["--speed", "1"]  # leaves time to interfere


@functools.cache
def instance() -> int:
    """Return the instance of these tests, which is free when the first of them begins."""
    return free_instance()


def command(out: Path, *flags: str, plan: str = "hop.plan") -> list[str]:
    """Return a flight on the true state; ``flags`` with another ``--state`` come later and win."""
    fly = ["fly", str(MISSIONS / plan), "--out", str(out), "--instance", str(instance())]
    return [*fly, "--state", "truth", *flags]


def run(out: Path, *flags: str, plan: str = "hop.plan") -> Ended:
    """Fly within the test; simulator and flight stack are processes, forked from the warm server."""
    with warm_children():
        return gcs(*command(out, *flags, plan=plan))


@contextmanager
def flight(out: Path, *flags: str) -> Iterator[tuple[Program, dict[str, int]]]:
    """Begin a flight and wait until it is in the air; no child may be left afterwards."""
    process = Program("gcs_cli", command(out, *flags, *PATIENT))
    try:
        await_output(process, "Takeoff detected")
        children = children_of(process.pid)
        assert set(children) == {"sim_bridge", "flightstack"}
        with ends_of(*children.values()):
            yield process, children
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def summary_of(out: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((out / "summary.json").read_text())
    return found


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ended]:
    """A whole flight, whose children are new interpreters: its directory and what it printed."""
    out = tmp_path_factory.mktemp("flown") / "run"
    flags = ("--json", "--seed", "5", "--controller", "backstepping", "--inner-hz", "250", *SENSORS)
    return out, gcs(*command(out, *flags))


@pytest.mark.smoke
def test_a_mission_is_flown_from_plan_to_report(
    flown: tuple[Path, Ended],
) -> None:
    out, result = flown
    assert result.returncode == 0, result.stderr
    summary = json.loads(result.stdout)
    assert summary.pop("directory") == str(out)
    assert summary == summary_of(out)
    assert summary["outcome"] == "completed"
    assert (summary["controller"], summary["seed"], summary["inner_hz"]) == ("backstepping", 5, 250.0)
    assert [row["reached"] for row in summary["waypoints"]] == [True, True]
    assert summary["sim_time_s"] > 3.0
    files = {path.name: path.stat().st_size for path in out.iterdir()}
    results = {"flight.ulg", "gcs.tlog", "summary.json", "report.html"}
    assert set(files) == results | {"sim-bridge.log", "flightstack.log"}
    assert all(files.values())


def text_lines(printed: str) -> list[str]:
    return [line for line in printed.splitlines() if re.match(r"\d+:\d\d\.\d  [A-Z]+: ", line)]


def test_equal_flights_print_equal_texts_and_log_equal_bytes(tmp_path: Path) -> None:
    (loaded, *one), (again, *other) = (
        text_lines(run(tmp_path / name, *SENSORS).stdout) for name in ("one", "other")
    )
    # the vehicle's clock runs during the upload, whose duration is the machine's: the log begins after it
    assert loaded.partition("  ")[2] == again.partition("  ")[2] == "NOTE: Mission loaded, items: 2"
    assert one == other
    assert not [line for line in one if "WARN" in line]
    logs = [(tmp_path / name / "flight.ulg").read_bytes() for name in ("one", "other")]
    assert logs[0] == logs[1]
    flight = read_flight(tmp_path / "one" / "flight.ulg")
    logged = [
        f"{clock_text(round(flight.start_s + text.time_s, 6))}  {SEVERITIES[text.level]}: {text.text}"
        for text in flight.texts
    ]
    assert one == logged


def test_geofence_and_rally_points_of_the_plan_fly_along(tmp_path: Path) -> None:
    result = run(tmp_path / "run", plan="fenced_square.plan")
    assert result.returncode == 0, result.stderr
    loaded = [line for line in result.stdout.splitlines() if " loaded, items: " in line]
    assert [line.split()[2] for line in loaded] == ["Geofence", "List", "Mission"]


def test_fly_works_beside_a_ground_station_that_holds_its_port(tmp_path: Path) -> None:
    """The vehicle calls both; forces and parameters reach the children, whose warnings are shown once."""
    parameters = tmp_path / "my.params"
    parameters.write_text("1\t1\tSYS_AUTOSTART\t4001\t6\n")
    flags = ("--params", str(parameters), "--param", "MIS_TAKEOFF_ALT=4", "--force", "0.1,0,0")
    with UdpSocket("127.0.0.1", FlyOptions(Path(), instance=instance()).gcs_port) as station:
        result = run(tmp_path / "run", *flags)
        heard = b"".join(data for data, _ in station.receive())
    assert result.returncode == 0, result.stderr
    assert bytes((1 + instance(), 1, 0, 0, 0)) in heard  # a heartbeat of the vehicle's autopilot
    assert result.stdout.count("flightstack: warning: ") == 1
    summary = summary_of(tmp_path / "run")
    assert (summary["param"], summary["force_n"]) == (["MIS_TAKEOFF_ALT=4"], [0.1, 0.0, 0.0])


def test_signing_key_signs_both_ends_of_the_link(tmp_path: Path) -> None:
    key = tmp_path / "my.key"
    create_key(key)
    with UdpSocket("127.0.0.1", FlyOptions(Path(), instance=instance()).gcs_port) as station:
        with warm_children():
            result = gcs("--signing-key", key, *command(tmp_path / "run"))
        heard = [data for data, _ in station.receive()]
    assert result.returncode == 0, result.stderr
    assert heard
    assert all(data[2] & SIGNED for data in heard)
    assert (tmp_path / f"{key.name}.gcs.timestamp").exists()


def test_missing_signing_key_is_refused_before_the_flight(tmp_path: Path) -> None:
    result = gcs("--signing-key", tmp_path / "no.key", *command(tmp_path / "run"))
    assert result == ("", f"gcs: {tmp_path / 'no.key'}: No such file or directory\n", 2)
    assert not (tmp_path / "run").exists()


def test_overwrite_replaces_another_flight(tmp_path: Path) -> None:
    out = tmp_path / "run"
    out.mkdir()
    (out / "flight.ulg").write_bytes(b"x")
    refused = run(out)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.endswith("choose another one, or give --overwrite\n")
    assert run(out, "--overwrite").returncode == 0
    assert summary_of(out)["outcome"] == "completed"


def test_the_tlog_holds_both_directions(flown: tuple[Path, Ended]) -> None:
    log = mavutil.mavlink_connection(str(flown[0] / "gcs.tlog"))
    senders: dict[int, set[str]] = {1 + instance(): set(), 255: set()}
    while (message := log.recv_match()) is not None:
        if message.get_srcSystem():  # 0: not in pymavlink's dialect
            senders[message.get_srcSystem()].add(message.get_type())
    log.close()
    assert senders[255] >= {"HEARTBEAT", "MISSION_COUNT", "MISSION_ITEM_INT", "COMMAND_LONG"}
    answers = {"MISSION_ACK", "COMMAND_ACK"}
    assert senders[1 + instance()] >= {"HEARTBEAT", "STATUSTEXT", "MISSION_CURRENT", *answers}


def test_a_flight_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "flight.ulg").write_bytes(b"precious")
    result = run(tmp_path)
    assert (result.stdout, result.returncode) == ("", 2)
    assert "flight.ulg of another flight is there" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["flight.ulg"]
    assert (tmp_path / "flight.ulg").read_bytes() == b"precious"


@pytest.mark.parametrize("number", [vehicle_ground_port, simulator_port])
def test_a_busy_port_is_named_and_nothing_is_started(tmp_path: Path, number: Callable[[int], int]) -> None:
    port, kind = number(instance()), "TCP" if number is simulator_port else "UDP"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if kind == "UDP" else socket.SOCK_STREAM) as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # past links of the port are no matter
        taken.bind(("127.0.0.1", port))
        if kind == "TCP":
            taken.listen(1)
        result = run(tmp_path / "run")
    assert (result.stdout, result.returncode) == ("", 2)
    assert f"{kind} port {port} on 127.0.0.1 is in use" in result.stderr
    assert "--instance" in result.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("victim", "number", "said"),
    [
        ("sim_bridge", signal.SIGKILL, "sim-bridge was killed by signal 9"),
        ("flightstack", signal.SIGKILL, "flightstack was killed by signal 9"),
        ("sim_bridge", signal.SIGINT, "sim-bridge ended with code 0: stopped"),
        ("sim_bridge", signal.SIGTERM, "sim-bridge ended with code 0: stopped"),
        ("flightstack", signal.SIGTERM, "flightstack ended with code 0: stopped"),
    ],
)
def test_a_child_that_ends_is_named_and_ends_the_flight(
    tmp_path: Path, victim: str, number: signal.Signals, said: str
) -> None:
    out = tmp_path / "run"
    with flight(out) as (process, children):
        os.kill(children[victim], number)
        _, errors = process.communicate(timeout=LONG_S)
    assert process.returncode == 1
    assert errors.startswith(f"gcs: {said}")
    assert errors.count("\n") == 1
    assert summary_of(out)["outcome"] == "process_ended"
    assert said in str(summary_of(out)["outcome_text"])
    assert (out / "report.html").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_flight_is_ended_in_order(tmp_path: Path, number: signal.Signals) -> None:
    out = tmp_path / "run"
    with flight(out) as (process, _):
        process.send_signal(number)
        _, errors = process.communicate(timeout=LONG_S)
    assert process.returncode == 130
    assert errors.startswith("gcs: interrupted")
    assert summary_of(out)["outcome"] == "interrupted"
    assert (out / "flight.ulg").stat().st_size
    assert (out / "report.html").exists()


def test_killed_fly_ends_its_vehicle_and_its_log_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(NEW_INTERPRETERS, "1")
    out = tmp_path / "run"
    with flight(out) as (process, _):
        process.kill()
        process.communicate(timeout=LONG_S)
    assert "ground station lost" not in (out / "flightstack.log").read_text()  # which takes GCS_LOSS_S
    assert not read_flight(out / "flight.ulg").damaged


def test_a_reader_that_goes_away_does_not_end_the_flight(tmp_path: Path) -> None:
    process = Program("gcs_cli", command(tmp_path / "run"))
    process.stdout.readline()
    process.stdout.close()
    assert process.communicate(LONG_S) == ("", "")
    assert process.returncode == 0
    assert summary_of(tmp_path / "run")["outcome"] == "completed"


def test_no_vehicle_in_time(tmp_path: Path) -> None:
    result = gcs(*command(tmp_path / "run", "--timeout", "0.1"))  # new interpreters start in more than 0.1 s
    assert result.returncode == 3
    assert "within 0.1 s" in result.stderr
    assert "outcome  no_vehicle\n" in result.stdout
    assert "—" not in result.stdout
    assert "within 0.1 s" not in result.stdout  # each sentence is printed once
    assert summary_of(tmp_path / "run")["outcome"] == "no_vehicle"
    assert "within 0.1 s" in str(summary_of(tmp_path / "run")["outcome_text"])
    assert "within 0.1 s" in (tmp_path / "run" / "report.html").read_text()  # also without a log


@pytest.mark.parametrize("is_there", [False, True])
def test_controller_that_does_not_compile_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_there: bool
) -> None:
    site, out = installed_site(tmp_path / "site", monkeypatch), tmp_path / "new" / "run"
    module = site / "lqr_controller.py"
    module.write_text(module.read_text().replace("+ ahead.x", "+ ahead_x"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]))
    if is_there:
        out.mkdir(parents=True)
    result = run(out, "--controller", "lqr")
    assert result.returncode == 2
    assert "name 'ahead_x' is not defined (lqr_controller.py, line 40)" in result.stderr
    assert result.stderr.count("\n") == 1
    assert "—" not in result.stdout
    assert out.parent.exists() == is_there
    assert not is_there or not list(out.iterdir())


def test_a_child_that_cannot_start_says_why(tmp_path: Path) -> None:
    with Children(tmp_path) as children:
        child = children.start("sim-bridge", "sim_bridge", ["--plant=flat"])
        assert children.wait(LONG_S)
        assert child.exit_code == 2
        assert child.end_reason.startswith("sim-bridge ended with code 2: --plant: 'flat' is not one of")


def test_a_child_that_does_not_listen_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "deaf.py").write_text(
        "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "pipe = open('told', 'w')\nprint('deaf', file=pipe, flush=True)\n"
        "while True:\n    signal.pause()\n"
    )
    os.mkfifo(tmp_path / "told")
    told = os.open(tmp_path / "told", os.O_RDONLY | os.O_NONBLOCK)
    monkeypatch.chdir(tmp_path)
    child = Child.start("deaf", [sys.executable, str(tmp_path / "deaf.py")], tmp_path / "deaf.log")
    assert select.select([told], [], [], LONG_S)[0]
    os.close(told)
    with Children(tmp_path) as children:
        children.add(child)
        children.stop(timeout_s=0.1)
    assert child.exit_code == -signal.SIGKILL
    assert child.end_reason == "deaf was killed by signal 9"
