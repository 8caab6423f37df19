"""Simulator, flight stack and ground station as real processes: the same flight everywhere, and who is lost is named.

Waits are for events (a line of output, the end of a process); their bounds only keep a broken run from hanging.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pyulog import ULog

from flightstack.core.port_numbers import ground_station_port
from flightstack.params.config import TRUTH
from flightstack.testing import World
from flightstack.testing.instances import free_instance
from tests.support.commands import flightstack_command, gcs
from tests.support.inertial_sensors import x_quad_with_imus
from tests.support.process import BOUND_S, Process
from tests.support.tools import NIGHTLY
from tests.support.vehicle_processes import INNER_HZ, wait_until_healthy
from tests.support.warm_children import warm_children

MISSIONS = Path(__file__).resolve().parents[2] / "missions"


Start = Callable[..., Process]


@pytest.fixture
def start() -> Iterator[Start]:
    processes: list[Process] = []

    def begin(module: str, *arguments: str) -> Process:
        processes.append(Process(module, *arguments))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()


def fly(out: Path, instance: int, *options: str) -> tuple[dict[str, object], bytes]:
    with warm_children():
        run = gcs("fly", MISSIONS / "hop.plan", "--json", "--out", out, "--instance", instance, *options)
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    log = (out / "flight.ulg").read_bytes()
    assert summary["log_sha256"] == hashlib.sha256(log).hexdigest()
    return summary, log


def test_the_same_flight_gives_the_same_log_at_any_speed_and_in_one_process(tmp_path: Path) -> None:
    logs, instance = [], free_instance()
    gusts = ("--gust", "1", "--torque-gust", "0.1", "--seed", "7")
    for speed in ("max", "1"):
        summary, log = fly(tmp_path / speed, instance, "--speed", speed, "--vehicle", "x_quad", *gusts)
        assert summary["outcome"] == "completed"
        logs.append(log)
    assert logs[0] == logs[1]
    system_id = instance + 1  # a parameter, and so in the log
    world = World(vehicle="x_quad", gust=1.0, torque_gust=0.1, seed=7, params={"MAV_SYS_ID": system_id})
    world.upload("hop.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed")
    assert world.flight().log.content == logs[0]


def test_flight_on_sensors_gives_the_same_log_in_three_processes_and_in_one(tmp_path: Path) -> None:
    instance = free_instance()
    _, log = fly(tmp_path / "flight", instance, "--vehicle", "x_quad", "--seed", "7", "--state", "estimated")
    with World(vehicle="x_quad", state="estimated", seed=7, params={"MAV_SYS_ID": instance + 1}) as world:
        assert world.fly("hop").log.content == log


FAULTS = [
    ("--state", "truth", "--fault", "clock:jump=1.5@8.3"),
    ("--vehicle", "two imus", "--fault", "sensor:imu:off@8.301-9"),
    ("--outer-hz", "62.5", "--fault", "sensor:baro:freeze@4.1-7"),
    ("--param", "COM_VEL_FS_EVH=0.2", "--fault", "sensor:gnss:off@4-20"),
]
MORE_FAULTS = [
    ("--state", "estimated", "--fault", "clock:jump=0.5@8.5"),
    ("--seed", "1", "--fault", "sensor:imu:freeze@5-5.3"),
    ("--seed", "1", "--fault", "sensor:mag:turn=170@3.3-9"),
    ("--outer-hz", "62.5", "--fault", "sensor:baro:off@3.5"),
]


@pytest.mark.parametrize(
    "options", FAULTS + NIGHTLY * MORE_FAULTS, ids=lambda options: options[3].partition("@")[0]
)
def test_what_the_simulator_does_to_a_flight_has_the_same_log_at_any_speed(
    options: tuple[str, ...], tmp_path: Path
) -> None:
    """At full speed the exchanges run without Python; at another one each runs in Python."""
    words = [x_quad_with_imus(tmp_path) if word == "two imus" else word for word in options]
    common = (MISSIONS / "square.plan", "--instance", free_instance(), *words)
    logs = []
    for number, speed in enumerate(("max", "8", "max")):
        out = tmp_path / str(number)
        with warm_children():
            run = gcs("fly", *common, "--out", out, "--speed", speed)
        logs.append((out / "flight.ulg").read_bytes())
        assert f" {options[3]}" in run.stdout
    assert logs[0] == logs[1] == logs[2]


def test_a_barometer_that_fails_before_takeoff_is_reported_at_the_same_time_at_any_speed(
    tmp_path: Path,
) -> None:
    """The fault counts from takeoff on, between two outer ticks, while the health stays as it is."""
    content = json.loads((MISSIONS / "hop.plan").read_text())
    items = content["mission"]["items"]
    wait = {"autoContinue": True, "command": 93, "frame": 2, "params": [4.0, -1, -1, -1, 0, 0, 0]}
    items.insert(0, {"type": "SimpleItem", **wait})
    for number, item in enumerate(items, start=1):
        item["doJumpId"] = number
    plan, instance, logs = tmp_path / "wait.plan", free_instance(), []
    plan.write_text(json.dumps(content))
    for speed in ("max", "1"):
        options = ("--outer-hz", "62.5", "--fault", "sensor:baro:off@3.5", "--speed", speed, "--limit", 40)
        with warm_children():
            gcs("fly", plan, "--out", tmp_path / speed, "--instance", instance, *options)
        logs.append((tmp_path / speed / "flight.ulg").read_bytes())
    assert logs[0] == logs[1]
    assert b"Barometer is stuck or missing" in logs[0]


GCS_LOSS_S = 5
"""As ``gcs fly`` has it. The station is there before the mission and heard each second until a test ends it."""


@pytest.fixture
def flying(start: Start, tmp_path: Path) -> dict[str, Process]:
    """Three processes in the middle of a mission, started one by one as in three terminals."""
    instance = free_instance()
    port = ground_station_port(instance)
    processes = {
        "simulator": start("sim_bridge", "--instance", str(instance), "--speed", "2"),
        "stack": start(
            "flightstack", "--instance", str(instance), "--gcs-port", str(port), "--log", str(tmp_path / "flight.ulg"),
            "--params", "none", "--exit-on-gcs-loss", str(GCS_LOSS_S),
        ),
        "station": start("gcs_cli", "--connect", f"udp:{port}", "--timeout", str(BOUND_S), "watch"),
    }  # fmt: skip
    processes["stack"].wait_for("flightstack: paper_quad")
    processes["station"].wait_for("HOLD")
    link = f"udpout:127.0.0.1:{18570 + instance}"
    wait_until_healthy(link)
    for arguments in (("upload", MISSIONS / "square.plan"), ("start",)):
        done = gcs("--connect", link, "--timeout", BOUND_S, "mission", *arguments)
        assert done.returncode == 0, done.stderr
    processes["station"].wait_for("MISSION")
    assert (
        gcs("--connect", link, "--timeout", BOUND_S, "wait", "in-air").returncode == 0
    )  # the log has content
    return processes


def test_a_killed_simulator_is_named_and_the_log_stays(flying: dict[str, Process], tmp_path: Path) -> None:
    flying["simulator"].kill()
    assert flying["stack"].end() == 1
    assert "simulator lost at t=" in flying["stack"].output
    assert "CRIT: Simulator lost at t=" in flying["station"].wait_for("imulator")
    flying["station"].wait_for("vehicle has shut down")
    assert_log_is_readable(tmp_path / "flight.ulg")


def test_a_simulator_shut_down_in_flight_is_named_and_the_flight_failed(flying: dict[str, Process]) -> None:
    flying["simulator"].interrupt()
    assert flying["simulator"].end() == 0
    assert flying["stack"].end() == 1
    said = flying["stack"].lines[-1]
    assert said.startswith("flightstack: the simulator was shut down at t=")
    assert said.endswith(" s while the vehicle was armed")
    assert "CRIT: The simulator was shut down at t=" in flying["station"].wait_for("imulator")


def test_a_killed_flight_stack_is_named(flying: dict[str, Process], tmp_path: Path) -> None:
    flying["stack"].kill()
    assert flying["simulator"].end() == 1
    assert "flight stack lost at t=" in flying["simulator"].output
    flying["station"].wait_for("lost")
    assert_log_is_readable(tmp_path / "flight.ulg")


def test_a_killed_ground_station_is_named_by_a_stack_that_must_not_outlive_it(
    flying: dict[str, Process], tmp_path: Path
) -> None:
    flying["station"].kill()
    assert flying["stack"].end() == 1
    assert "ground station lost" in flying["stack"].output
    assert flying["simulator"].end() == 1
    assert "flight stack lost at t=" in flying["simulator"].output
    assert_log_is_readable(tmp_path / "flight.ulg")


def test_ctrl_c_in_flight_leaves_a_readable_log_and_everyone_ends_in_order(
    flying: dict[str, Process], tmp_path: Path
) -> None:
    flying["stack"].interrupt()
    assert flying["stack"].end() == 0
    assert flying["simulator"].end() == 0
    assert_log_is_readable(tmp_path / "flight.ulg")


def test_without_a_simulator_the_stack_says_so(start: Start) -> None:
    instance = free_instance()
    stack = start(
        "flightstack",
        "--instance",
        str(instance),
        "--sim-timeout",
        "0.2",
        "--log",
        "none",
        "--params",
        "none",
    )
    assert stack.end() == 3
    assert f"no simulator at 127.0.0.1:{4560 + instance} within 0.2 s" in stack.output


def test_a_busy_port_is_named(start: Start) -> None:
    instance = free_instance()
    first = start("flightstack", "--instance", str(instance), "--log", "none", "--params", "none")
    first.wait_for("flightstack: paper_quad")
    second = start("flightstack", "--instance", str(instance), "--log", "none", "--params", "none")
    assert second.end() == 2
    assert f"UDP port {18570 + instance} on 127.0.0.1 is in use" in second.output


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--vehicle", "no_such"], "is neither a file nor a built-in vehicle (paper_quad, x_quad)"),
        (["--controller", "no_such"], "installed are backstepping, pid"),
        (["--gains", "no_such"], "nor built-in gains (backstepping_poles, paper, paper_rate_fed, tuned)"),
        (["--inner-hz", "0"], "is outside 10 to 20000"),
        (["--inner-hz", "300"], "does not make a whole number of microseconds"),
        (["--outer-hz", "333"], "does not divide the inner rate"),
        (["--home", "95,0,0"], "is not a place on earth"),
        (["--param", "MPC_XY_CRUISE=-3"], "is outside 0.1 to 20 m/s"),
        (["--param", "NO_SUCH=1"], "the vehicle has no such parameter"),
        (["--clock", "sundial"], "is not one of lockstep, realtime"),
        (["--loops", "fortran"], "is not one of python, c, host"),
    ],
)
def test_bad_arguments_are_one_sentence_and_exit_2(arguments: list[str], sentence: str) -> None:
    done = flightstack_command("--state-dir", "none", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1


def test_real_time_clock_flies_with_a_simulator_that_does_not_wait(start: Start, tmp_path: Path) -> None:
    """Without lockstep, a vehicle whose loops get no processor time falls: they are as cheap as possible here."""
    log = tmp_path / "flight.ulg"
    instance = free_instance()
    port = ground_station_port(instance)
    start("sim_bridge", "--instance", str(instance))
    stack = start(
        "flightstack",
        *("--instance", str(instance)),
        *("--gcs-port", str(port)),
        *("--clock", "realtime"),
        *("--state", TRUTH),
        *("--inner-hz", str(INNER_HZ)),
        *("--log", str(log)),
        *("--params", "none"),
    )
    stack.wait_for("flightstack: paper_quad")
    link = f"udpout:127.0.0.1:{18570 + instance}"
    wait_until_healthy(link)
    for arguments in (("takeoff", "--alt", 1), ("arm",)):
        done = gcs("--connect", link, *arguments)
        assert done.returncode == 0, done.stderr
    station = start("gcs_cli", "--connect", f"udp:{port}", "watch")
    station.wait_for("armed  N")
    perf = gcs("--connect", link, "perf", "--json")
    assert perf.returncode == 0, perf.stderr
    figures = json.loads(perf.stdout)
    assert figures["lockstep"] is False
    assert figures["ticks"] > 100


def assert_log_is_readable(path: Path) -> None:
    log = ULog(str(path))
    attitude = next(topic for topic in log.data_list if topic.name == "vehicle_attitude")
    assert len(attitude.data["timestamp"]) > 50  # a tenth of a second
