"""The ``gcs`` commands over UDP against a scripted vehicle; as processes where a process makes a difference."""

from __future__ import annotations

import functools
import io
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import flightstack
from flightstack.plan import load_plan, save_plan
from flightstack.transports.udp import UdpSocket
from gcs_cli.__main__ import main
from gcs_cli.clients.command_client import CommandClient, CommandTiming
from gcs_cli.link.connection import Connection
from tests.support.commands import gcs
from tests.support.fake_vehicle import ARM, FakeVehicle, serve
from tests.support.plan_items import circle
from tests.support.told import MISSIONS, told
from tests.support.vehicle_processes import vehicle

LONG_S = 30  # a bound for a machine that is busy; nothing is expected to take a second


@pytest.mark.parametrize(
    ("arguments", "line", "command"),
    [
        (["arm"], "armed", (400, (1, 0))),
        (["disarm"], "disarmed", (400, (0, 0))),
        (["disarm", "--force"], "disarmed", (400, (0, 21196))),
        (["land", "--no-wait"], "landing", (21, (0, 0))),
        (["rtl", "--no-wait"], "returning to launch", (20, (0, 0))),
        (["hold"], "holding the position", (176, (1, 4, 3))),
        (["mode", "MISSION"], "mode mission", (176, (1, 4, 4))),
        (["mission", "start"], "mission started", (300, (0, 0))),
    ],
)
def test_an_order_is_carried_out_and_told_in_one_line(
    arguments: list[str], line: str, command: tuple[int, tuple[float, ...]]
) -> None:
    vehicle = FakeVehicle()
    result = told(vehicle, *arguments)
    assert (result.stdout, result.stderr, result.returncode) == (line + "\n", "", 0)
    number, params = command
    assert [(sent, values[: len(params)]) for sent, values in vehicle.commands] == [(number, params)]


def test_takeoff_counts_from_the_ground_below_and_arms() -> None:
    vehicle = FakeVehicle()  # stands 3 m above its home, which is at 488 m
    result = told(vehicle, "takeoff", "--alt", "10")
    first, second = result.stdout.splitlines()
    assert (first, second[:12], result.returncode) == ("taking off to 10 m", "at 10 m afte", 0)
    (takeoff, values), (arm, _) = vehicle.commands
    assert (takeoff, values[6], arm) == (22, 501.0, ARM)


def test_a_refusal_tells_the_vehicles_reason() -> None:
    result = told(FakeVehicle(refusals={ARM: "Command refused: no valid position and attitude yet"}), "arm")
    assert (result.stdout, result.returncode) == ("", 1)
    assert result.stderr == "gcs: arming refused: no valid position and attitude yet\n"


def test_an_unknown_mode_names_the_modes_of_the_vehicle() -> None:
    result = told(FakeVehicle(), "mode", "nonsense")
    assert (result.stdout, result.returncode) == ("", 2)
    assert result.stderr.startswith(
        "gcs: mode: the vehicle has no mode nonsense; choose one of TAKEOFF, HOLD, MIS"
    )


def test_a_vehicle_that_does_not_answer_is_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = functools.partial(CommandClient, timing=CommandTiming(timeout_s=0.02))
    monkeypatch.setattr("gcs_cli.actions.run.CommandClient", quick)
    result = told(FakeVehicle(ignored={ARM}), "arm")
    assert result.returncode == 3
    assert "did not answer MAV_CMD_COMPONENT_ARM_DISARM" in result.stderr


def test_a_mission_goes_up_and_comes_down_the_same(tmp_path: Path) -> None:
    vehicle, copy = FakeVehicle(), tmp_path / "copy.plan"
    assert told(vehicle, "mission", "upload", MISSIONS / "every_item.plan").returncode == 0
    result = told(vehicle, "mission", "download", copy)
    assert (result.stderr, result.returncode) == ("", 0)
    before, after = load_plan(MISSIONS / "every_item.plan"), load_plan(copy)
    assert after.items == before.items
    assert after.home == before.home
    printed = told(vehicle, "mission", "download").stdout
    assert len(printed.splitlines()) == len(before.items) + 1
    assert told(vehicle, "mission", "clear").stdout == "mission cleared\n"
    assert vehicle.items == []


def test_a_plan_goes_up_and_comes_down_with_its_geofence_and_rally_points(tmp_path: Path) -> None:
    vehicle, copy = FakeVehicle(), tmp_path / "copy.plan"
    result = told(vehicle, "mission", "upload", MISSIONS / "fenced_square.plan")
    assert result.stdout.splitlines() == [
        "geofence of 5 items uploaded",
        "list of rally points of 1 items uploaded",
        "mission of 6 items uploaded",
    ]
    assert vehicle.uploaded == [1, 2, 0]
    assert [len(vehicle.plans[kind]) for kind in (0, 1, 2)] == [6, 5, 1]
    assert told(vehicle, "mission", "download", copy).returncode == 0
    before, after = load_plan(MISSIONS / "fenced_square.plan"), load_plan(copy)
    assert (after.items, after.fence, after.rally) == (before.items, before.fence, before.rally)
    assert told(vehicle, "mission", "clear", "--type", "fence").stdout == "geofence cleared\n"
    assert [len(vehicle.plans[kind]) for kind in (0, 1, 2)] == [6, 0, 1]
    told(vehicle, "mission", "clear", "--type", "all")
    assert not any(vehicle.plans.values())


def test_a_plan_replaces_another_whole_or_not_at_all(tmp_path: Path) -> None:
    """On a real vehicle: each fence refuses the other's mission, and a plan that is refused leaves the one before."""
    fenced, home = load_plan(MISSIONS / "fenced_square.plan"), load_plan(MISSIONS / "hop.plan")
    small = replace(home, fence=(circle((0.0, 0.0), 3.0),))
    refused = replace(fenced, fence=small.fence, rally=())
    for name, plan in (("small", small), ("refused", refused)):
        save_plan(tmp_path / f"{name}.plan", plan)
    with vehicle(tmp_path) as stack:
        for plan in (
            MISSIONS / "fenced_square.plan",
            tmp_path / "small.plan",
            MISSIONS / "fenced_square.plan",
        ):
            assert gcs("--connect", stack.link, "mission", "upload", plan).returncode == 0
        result = gcs("--connect", stack.link, "mission", "upload", tmp_path / "refused.plan")
        assert result.returncode == 1
        assert "refused.plan refused: item " in result.stderr
        assert "geofence; the vehicle holds its former plans" in result.stderr
        assert gcs("--connect", stack.link, "mission", "download", tmp_path / "held.plan").returncode == 0
    held = load_plan(tmp_path / "held.plan")
    assert (held.items, held.fence, held.rally) == (fenced.items, fenced.fence, fenced.rally)


def contents(vehicle: FakeVehicle) -> dict[int, list[tuple[float, ...]]]:
    return {
        kind: [(item.command, item.param1, item.x, item.y, item.z) for item in plan]
        for kind, plan in vehicle.plans.items()
    }


@pytest.mark.parametrize(("refused", "name"), [(0, "mission"), (1, "geofence"), (2, "list of rally points")])
def test_a_refused_part_leaves_the_plans_of_before(tmp_path: Path, refused: int, name: str) -> None:
    plan, changed = load_plan(MISSIONS / "fenced_square.plan"), tmp_path / "changed.plan"
    save_plan(changed, replace(plan, items=plan.items[:4], fence=plan.fence[:4], rally=plan.rally * 2))
    vehicle = FakeVehicle()
    assert told(vehicle, "mission", "upload", MISSIONS / "fenced_square.plan").returncode == 0
    assert told(vehicle, "mission", "clear", "--type", "rally").returncode == 0
    before = contents(vehicle)
    vehicle.refused_type = refused
    result = told(vehicle, "mission", "upload", changed)
    assert (result.returncode, result.stdout) == (1, "")
    assert ("gcs: restoring the vehicle's former plans\n" in result.stderr) is (
        name != "geofence"
    )  # the first part
    assert f"gcs: upload of the {name} of {changed} refused: " in result.stderr
    assert result.stderr.endswith("; the vehicle holds its former plans\n")
    assert contents(vehicle) == before


def test_an_upload_names_the_parts_that_stay_on_the_vehicle() -> None:
    vehicle = FakeVehicle()
    assert told(vehicle, "mission", "upload", "fenced_square").returncode == 0
    assert told(vehicle, "mission", "upload", "hop").stdout.splitlines()[1:] == [
        "the vehicle keeps its geofence of 5 items",
        "the vehicle keeps its list of rally points of 1 items",
    ]


def test_a_refusal_by_a_geofence_that_is_not_in_the_file_names_it() -> None:
    vehicle = FakeVehicle()
    assert told(vehicle, "mission", "upload", "fenced_square").returncode == 0
    vehicle.refused_type, vehicle.mission_refusal = 0, "Mission refused: item 2 is outside the geofence"
    result = told(vehicle, "mission", "upload", "square")
    assert result.returncode == 1
    assert result.stderr.endswith(
        "refused: item 2 is outside the geofence; the vehicle keeps its geofence of 5 items, which is not in the "
        "file: remove it with `gcs mission clear --type fence`\n"
    )


@pytest.mark.parametrize("signals", [1, 2])
def test_an_interrupted_upload_says_what_the_vehicle_holds(signals: int) -> None:
    """One signal as the mission begins; the second as the former geofence, the first part, is restored."""
    vehicle = FakeVehicle()
    assert told(vehicle, "mission", "upload", "fenced_square").returncode == 0
    before, ask = contents(vehicle), vehicle.ask_next_item
    kinds = [0, 1][:signals]

    def interrupt() -> None:
        ask()
        if kinds and vehicle.plan_type == kinds[0]:
            os.kill(os.getpid(), signal.SIGTERM)
            kinds.pop(0)

    vehicle.ask_next_item = interrupt  # type: ignore[method-assign]
    result = told(vehicle, "mission", "upload", "fenced_square")
    assert result.returncode == 130
    if signals == 1:
        assert result.stderr.endswith(": interrupted (SIGTERM); the vehicle holds its former plans\n")
        assert contents(vehicle) == before
    else:
        assert result.stderr.endswith(
            ": interrupted; the vehicle holds: geofence new, list of rally points new, mission former\n"
        )


def test_a_vehicle_without_geofence_is_downloaded_from() -> None:
    vehicle = FakeVehicle(unknown_types=(1, 2))
    result = told(vehicle, "mission", "download")
    assert (result.returncode, result.stdout) == (0, "mission of 0 items downloaded\n")


def test_files_are_checked_as_the_vehicle_checks_them(tmp_path: Path) -> None:
    good = gcs("mission", "check", MISSIONS / "fenced_square.plan")
    assert (good.returncode, good.stdout.splitlines()[1]) == (0, "geofence of 5 items: good")
    bad = tmp_path / "bad.plan"
    text = (MISSIONS / "fenced_square.plan").read_text()
    bad.write_text(text.replace('"radius": 4.0', '"radius": 15.0'))
    result = gcs("mission", "check", bad)
    assert result.returncode == 2
    assert "good" not in result.stdout
    assert "mission: item 1 (NAV_WAYPOINT)" in result.stdout + result.stderr


def test_a_refused_mission_names_the_item() -> None:
    vehicle = FakeVehicle(mission_result=3, mission_refusal="Mission refused: item 2 is not supported")
    result = told(vehicle, "mission", "upload", MISSIONS / "hop.plan")
    assert result.returncode == 1
    assert "item 2 is not supported" in result.stderr


def test_status_as_json() -> None:
    result = told(FakeVehicle(), "status", "--json")
    facts = json.loads(result.stdout)
    assert (facts["mode"], facts["armed"], facts["landed"]) == ("HOLD", False, "on ground")
    assert facts["pos_ned_m"] == [1.0, 2.0, -3.0]
    assert facts["battery_remaining"] is None
    assert result.returncode == 0


def test_status_prints_units_and_rounds() -> None:
    lines = dict(line.split(maxsplit=1) for line in told(FakeVehicle(), "status").stdout.splitlines())
    assert lines["vehicle"] == "quadrotor, system 1"
    assert lines["attitude"] == "roll 5.7°, pitch -2.9°, yaw 85.9°"
    assert lines["position"] == "north 1.00 m, east 2.00 m, down -3.00 m"
    assert lines["place"] == "47.3977420°, 8.5455940°, 491.0 m above sea level"
    assert lines["rotors"] == "2310, 2290, 2305, 2400 rpm"
    assert lines["battery"] == "—"


def test_perf_shows_the_loops() -> None:
    table = told(FakeVehicle(), "perf").stdout
    for part in ("500 Hz", "100 Hz", "lockstep", "52.5×", "12.0", "90.0"):
        assert part in table
    assert "overruns" not in table  # in lockstep a tick has no deadline
    timing = json.loads(told(FakeVehicle(), "perf", "--json").stdout)
    assert (timing["execution_p99_us"], timing["lockstep"]) == (20.0, True)


def test_perf_of_a_vehicle_without_loop_timing() -> None:
    result = told(FakeVehicle(unsent={"FS_LOOP_TIMING"}), "--timeout", "0.3", "perf")
    assert result.returncode == 3
    assert "FS_LOOP_TIMING" in result.stderr


def test_a_vehicle_that_sends_first_is_met_on_the_listening_port() -> None:
    with UdpSocket("127.0.0.1") as free:
        port = free.address[1]
    with serve(FakeVehicle(), to_port=port):
        assert gcs("arm", "--connect", f"udpin:127.0.0.1:{port}").stdout == "armed\n"


@pytest.mark.parametrize("command", [["arm"], ["status"], ["perf"], ["mission", "clear"], ["watch"]])
def test_no_vehicle(command: list[str]) -> None:
    with UdpSocket("127.0.0.1") as silent:
        result = gcs("--timeout", "0.2", "--connect", f"udpout:127.0.0.1:{silent.address[1]}", *command)
    assert (result.stdout, result.returncode) == ("", 3)
    name = "" if command == ["watch"] else f"{' '.join(command)}: "
    assert result.stderr.startswith(f"gcs: {name}no vehicle answered at UDP 127.0.0.1:")


def test_watch_in_a_pipe_says_on_stderr_what_it_waits_for(monkeypatch: pytest.MonkeyPatch) -> None:
    said = list[str]()

    def end(line: str) -> None:
        said.append(line)
        raise KeyboardInterrupt

    monkeypatch.setattr("gcs_cli.commands.watch.EXPLAIN_S", 0.2)
    monkeypatch.setattr("gcs_cli.commands.watch.complain", end)
    with UdpSocket("127.0.0.1") as silent:
        port = silent.address[1]
        assert gcs("--connect", f"udpout:127.0.0.1:{port}", "watch")[2] == 0
    (line,) = said
    assert line.startswith(f"gcs: watch: no vehicle answered at UDP 127.0.0.1:{port} within 0.2 s: ")
    assert line.endswith("; still waiting")


def test_a_busy_port_is_named_with_the_way_round() -> None:
    with UdpSocket("127.0.0.1") as taken:
        port = taken.address[1]
        result = gcs("--connect", f"udpin:127.0.0.1:{port}", "status")
    assert result.returncode == 2
    assert f"UDP port {port} on 127.0.0.1 is in use" in result.stderr
    assert "--connect udpout:127.0.0.1:18570" in result.stderr


@pytest.mark.parametrize("command", [["arm"], ["--timeout", "20", "watch"]])
def test_vehicle_is_found_beside_a_ground_station_on_the_default_port(
    monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    vehicle = FakeVehicle()
    monkeypatch.setattr("gcs_cli.commands.watch.watch_lines", lambda _connection: print("watching"))
    with UdpSocket("127.0.0.1") as taken, UdpSocket("127.0.0.1") as silent, serve(vehicle) as socket:
        ports = [taken.address[1], silent.address[1], socket.address[1]]
        monkeypatch.setattr("gcs_cli.settings.DEFAULT_CONNECTION", f"udp:127.0.0.1:{ports[0]}")
        others = tuple(f"udpout:127.0.0.1:{port}" for port in ports[1:])
        monkeypatch.setattr("gcs_cli.vehicle_link.OTHER_CONNECTIONS", others)
        result = gcs(*command)
    tried = f"UDP 127.0.0.1:{ports[1]}, UDP 127.0.0.1:{ports[2]}"
    said = f"gcs: UDP 127.0.0.1:{ports[0]} is in use: trying {tried}\n"
    assert result == ("armed\n" if command == ["arm"] else "watching\n", said, 0)
    assert vehicle.codec.total_packets_received > 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["frobnicate"], "No such command"),
        (["arm", "--frobnicate"], "No such option"),
        (["takeoff", "--alt", "-3"], "--alt: -3 is outside the allowed range 0.1 to 10000"),
        (["takeoff", "--alt", "high"], "--alt: 'high' is not a number; give 0.1 to 10000"),
        (["fly", "--seed", "x"], "--seed: 'x' is not a whole number; give 0 to 2147483647"),
        (["fly", "--seed", "1.5"], "--seed: '1.5' is not a whole number"),
        (["--connect", "tcp:1", "status"], "expected udp:PORT"),
        (["--connect", "nowhere.tlog", "status"], "nowhere.tlog: cannot be read: No such file"),
        (["--connect", "nowhere.tlog", "arm"], "arm: nowhere.tlog is a recording, which takes no commands"),
        (["--connect", "serial:/dev/none", "status"], "/dev/none: no such device"),
        (["--timeout", "0", "status"], "--timeout: 0 is outside the allowed range 0.1 to 86400"),
        (["goto", "--", "91", "0"], "latitude: 91 is outside the allowed range -90 to 90"),
        (["goto", "--", "0", "nan"], "longitude: nan is outside the allowed range -180 to 180"),
        (["--connect", "udpout:no.such.host.invalid:1", "status"], "no host named"),
        (["mission", "upload", "nowhere.plan"], "nowhere.plan: cannot be read: No such file"),
        (["fly", "nowhere.plan"], "nowhere.plan: cannot be read: No such file"),
        (["fly", "--speed", "fast", "hop"], "--speed: 'fast' is neither a number nor max"),
        (["--connect", "udp:1", "fly", "nowhere.plan"], "fly starts a vehicle of its own"),
    ],
)
def test_wrong_usage_is_one_sentence_and_exit_code_2(arguments: list[str], said: str) -> None:
    result = gcs(*arguments)
    assert (result.stdout, result.returncode) == ("", 2)
    assert result.stderr.startswith("gcs: ")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_an_interrupted_wait_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Connection, "wait_for_vehicle", interrupt)
    with UdpSocket("127.0.0.1") as silent:
        result = gcs("--connect", f"udpout:127.0.0.1:{silent.address[1]}", "arm")
    assert result == ("", "gcs: interrupted\n", 130)


@pytest.mark.parametrize("group", [[], ["mission"]])
def test_without_a_command_the_help_is_shown(group: list[str]) -> None:
    result = gcs(*group)
    assert (result.stdout, result.returncode) == ("", 2)
    assert result.stderr.startswith("Usage: gcs")


def test_the_version() -> None:
    assert gcs("--version") == (f"gcs {flightstack.__version__}\n", "", 0)


def test_an_output_without_special_letters_gets_question_marks(monkeypatch: pytest.MonkeyPatch) -> None:
    octets = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(octets, encoding="ascii"))
    with serve(FakeVehicle()) as socket:
        assert main(["--connect", f"udpout:127.0.0.1:{socket.address[1]}", "perf"]) == 0
    assert b"52.5? real time" in octets.getvalue()


def test_a_full_disk_behind_the_output_is_one_sentence() -> None:
    command = [sys.executable, "-m", "gcs_cli", "--help"]
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=LONG_S, check=False)
    assert (result.stderr, result.returncode) == (b"gcs: No space left on device\n", 1)
