"""Connection strings, flags of ``gcs fly``, run directories, and the lines shown in flight."""

from __future__ import annotations

import inspect
import json
import math
import re
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flightstack.core.geodesy import GeoPoint
from flightstack.process.command import run as flightstack_run
from flightstack.testing.instances import free_instance
from gcs_cli.__main__ import main
from gcs_cli.errors import DONE, INTERRUPTED, USAGE, CliError
from gcs_cli.fly.fly_flags import NOT_PASSED, TO_SIMULATOR, TO_STACK, FlyOptions, flag_of
from gcs_cli.fly.fly_options import (
    check_ports,
    checked_plan,
    flown_vehicle,
    home_of,
    outer_rate_hz,
    simulator_arguments,
    stack_arguments,
)
from gcs_cli.link.endpoint import DEFAULT_CONNECTION, VehicleEndpoint, parse_endpoint
from gcs_cli.output import error_line
from gcs_cli.transfers.plan_files import example_plans
from sim_bridge.command import run as sim_bridge_run

MISSIONS = Path(__file__).parents[2] / "missions"
HOP = MISSIONS / "hop.plan"


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        (DEFAULT_CONNECTION, VehicleEndpoint("udpin", "127.0.0.1", 14550)),
        ("udp:14560", VehicleEndpoint("udpin", "127.0.0.1", 14560)),
        ("udpin:10.0.0.1:1", VehicleEndpoint("udpin", "10.0.0.1", 1)),
        ("udpin://0.0.0.0:14540", VehicleEndpoint("udpin", "0.0.0.0", 14540)),
        ("udpout:vehicle.local:18570", VehicleEndpoint("udpout", "vehicle.local", 18570)),
        ("tcp:127.0.0.1:5760", VehicleEndpoint("tcp", "127.0.0.1", 5760)),
        ("tcpin:5760", VehicleEndpoint("tcpin", "127.0.0.1", 5760)),
        ("serial:/dev/ttyACM0", VehicleEndpoint("serial", "/dev/ttyACM0", 57600)),
        ("serial:/dev/ttyUSB0:921600", VehicleEndpoint("serial", "/dev/ttyUSB0", 921600)),
        ("flights/c:1.TLOG", VehicleEndpoint("recording", "flights/c:1.TLOG")),
    ],
)
def test_connection_strings(text: str, endpoint: VehicleEndpoint) -> None:
    assert parse_endpoint(text) == endpoint


@pytest.mark.parametrize(
    "text",
    [
        "",
        "14550",
        "tcp:5760",
        "serial:",
        "serial:/dev/ttyACM0:fast",
        "serial::9600",
        "udp:",
        "udp:x",
        "udp:0",
        "udp:65536",
        "udpout:14550",
        "udp:-1",
        "udp:²",
    ],
)
def test_bad_connection_strings_are_usage_errors(text: str) -> None:
    with pytest.raises(CliError, match="--connect") as error:
        parse_endpoint(text)
    assert error.value.exit_code == USAGE


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--plant flat", "--plant: 'flat' is not one of rigid, paper, multibody"),
        ("--speed fast", "--speed: 'fast' is neither a number nor max"),
        ("--speed 0", "--speed: 0 is outside the allowed range 0.001 to 10000"),
        ("--speed nan", "--speed: nan is outside"),
        ("--wind 3", "--wind: '3' has 1 number, 2 or 3 are needed"),
        ("--wind 3,x", "--wind: '3,x' is not 2 or 3 numbers separated by commas"),
        ("--wind 8,0", "--wind: wind cannot act: the vehicle paper_quad has no drag; add --drag"),
        ("--gust 1", "--gust: wind cannot act: the vehicle paper_quad has no drag; add --drag"),
        ("--wind 8,0 --vehicle x_quad --plant paper", "--wind: wind cannot act: the paper's model"),
        ("--force 1,2", "--force: '1,2' has 2 numbers, 3 are needed"),
        ("--torque a,b,c", "--torque: 'a,b,c' is not 3 numbers"),
        ("--physics-hz 1", "--physics-hz: 1 is outside the allowed range 100 to 100000"),
        ("--fault rotor:9:off", "--fault rotor:9:off: the vehicle has rotors 1 to 4"),
        ("--fault battery:level=2", "--fault battery:level=2: SHARE must be 0 to 1"),
        (
            "--fault state:freeze@2-3",
            "--fault: state:freeze cannot act: the flight stack flies on its sensors",
        ),
        ("--fault state:drop --state truth", "--fault: state:drop needs a flight stack on its own clock"),
        (
            "--fault sensor:gyro:off --state truth",
            "--fault: the fault of the sensor gyro cannot act: the flight",
        ),
        ("--home 89.95,0,0", "--home latitude: 89.95 is outside"),
        ("--home 1,2", "--home: 1,2 must be LATITUDE,LONGITUDE,ALTITUDE"),
        (
            "--param MPC_XY_CRUSE=3",
            "--param: MPC_XY_CRUSE: the vehicle has no such parameter; did you mean MPC_XY_CRU",
        ),
        ("--param MPC_XY_CRUISE=fast", "--param: MPC_XY_CRUISE=fast must be NAME=VALUE with a number"),
        ("--param MPC_XY_CRUISE=1000", "--param: MPC_XY_CRUISE=1000: 1000 is outside 0.1 to 20 m/s"),
        ("--param BST_ROLL_K1=1", "--param: BST_ROLL_K1: the vehicle has no such parameter"),
        ("--controller fuzzy", "--controller: fuzzy: there is no such attitude controller; installed are "),
        ("--gains loud", "loud: is neither"),
        ("--vehicle hexa", "hexa: is neither"),
        ("--state thruth", "--state: thruth: is not one of estimated, truth\n"),
        ("--loops java", "--loops: java is not one of"),
        ("--loops serial:/dev/nope", "--loops: serial:/dev/nope: no such device"),
        ("--loops emulated,free --speed 1", "--loops: emulated,free cannot run by its own timer"),
        ("--drag --vehicle x_quad", "--drag: the file of the vehicle x_quad has no optional_drag"),
        ("--drag --plant paper", "--drag: the paper's model has no drag"),
        ("--inner-hz nan", "--inner-hz: nan"),
        ("--inner-hz 1", "--inner-hz: 1"),
        ("--outer-hz 77", "--outer-hz: 77 does not divide"),
    ],
)
def test_bad_option_is_refused_before_a_flight(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["fly", str(HOP), *words.split()]) == USAGE
    printed = capsys.readouterr()
    assert printed.err.startswith(f"gcs: {said}")
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert list(tmp_path.iterdir()) == []


def test_bad_parameter_file_is_refused_before_a_flight(tmp_path: Path, capsys: Any) -> None:
    file, out = tmp_path / "my.params", tmp_path / "run"
    file.write_text("1\t1\tMPC_XY_CRUISE\tfast\t9\n")
    assert main(["fly", str(HOP), "--params", str(file), "--out", str(out)]) == USAGE
    assert capsys.readouterr().err.startswith(f"gcs: {file}: ")
    assert not out.exists()


@pytest.mark.parametrize(
    ("flag", "value"),
    [
        ("--gust", -1.0),
        ("--torque-gust", math.inf),
        ("--seed", -1),
        ("--battery-start", 101.0),
        ("--battery-capacity", 0.0),
        ("--battery-drain", math.nan),
        ("--instance", 250),
        ("--limit", math.nan),
        ("--timeout", 0.0),
    ],
)
@pytest.mark.parametrize("words", [["fly"], ["pil", "fly"]], ids=" ".join)
def test_option_out_of_range_is_a_usage_error(words: list[str], flag: str, value: float, capsys: Any) -> None:
    assert main([*words, str(HOP), flag, str(value)]) == USAGE
    printed = capsys.readouterr()
    assert re.fullmatch(rf"gcs: {flag}: \S+ is outside the allowed range \S+ to \d+\n", printed.err)
    assert main([*words, "--help"]) == DONE
    assert "<=x<=" in capsys.readouterr().out.partition(f"  {flag} ")[2][:200]


def test_a_plan_that_the_vehicle_would_refuse_is_not_flown(tmp_path: Path) -> None:
    plan = tmp_path / "far.waypoints"
    home = "0\t1\t0\t16\t0\t0\t0\t0\t47.397742\t8.545594\t488\t1"
    plan.write_text(f"QGC WPL 110\n{home}\n1\t0\t3\t16\t0\t0\t0\t0\t48.0\t8.5\t10\t1\n")
    with pytest.raises(
        CliError, match=r"far.waypoints: mission: item 0 \(NAV_WAYPOINT\): is \d+ m from home"
    ) as error:
        checked_plan(FlyOptions(plan))
    assert error.value.exit_code == USAGE


def _fenced(tmp_path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Write ``fenced_square.plan`` with a change."""
    document = json.loads((MISSIONS / "fenced_square.plan").read_text())
    change(document)
    path = tmp_path / "changed.plan"
    path.write_text(json.dumps(document))
    return path


def _shrink_fence(document: dict[str, Any]) -> None:
    home = document["mission"]["plannedHomePosition"][:2]
    document["geoFence"]["circles"] = [
        {"circle": {"center": home, "radius": 5.0}, "inclusion": True, "version": 1}
    ]
    document["geoFence"]["polygons"] = []


def _cross_fence(document: dict[str, Any]) -> None:
    polygon = document["geoFence"]["polygons"][0]["polygon"]
    polygon[0], polygon[1] = polygon[1], polygon[0]


def _rally_far_out(document: dict[str, Any]) -> None:
    document["rallyPoints"]["points"] = [[47.5, 8.545594, 10.0]]


def _no_mission(document: dict[str, Any]) -> None:
    document["mission"]["items"] = []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_shrink_fence, r"mission: item 1 \(NAV_WAYPOINT\): is outside the geofence"),
        (_cross_fence, r"geofence: item \d \(.*\): the polygon crosses itself"),
        (_rally_far_out, r"list of rally points: item 0 \(.*\): is outside the geofence"),
        (_no_mission, "has no mission items"),
    ],
)
def test_geofence_and_rally_points_are_checked_before_anything_starts(
    tmp_path: Path, change: Callable[[dict[str, Any]], None], said: str
) -> None:
    plan = _fenced(tmp_path, change)
    with pytest.raises(CliError, match=f"^{re.escape(str(plan))}: {said}") as error:
        checked_plan(FlyOptions(plan))
    assert error.value.exit_code == USAGE


@pytest.mark.parametrize("first", [(21, 47.3978, 8.5456, 0), (20, 0, 0, 0)])
def test_a_plan_that_begins_with_the_end_of_a_flight_is_not_flown(
    tmp_path: Path, first: tuple[float, ...]
) -> None:
    plan = tmp_path / "hover.waypoints"
    home = "0\t1\t0\t16\t0\t0\t0\t0\t47.397742\t8.545594\t488\t1"
    code, *position = first
    item = "\t".join(map(str, (1, 0, 3, code, 0, 0, 0, 0, *position, 1)))
    plan.write_text(f"QGC WPL 110\n{home}\n{item}\n")
    with pytest.raises(
        CliError, match=r"hover.waypoints: the mission begins with a landing or a return"
    ) as error:
        checked_plan(FlyOptions(plan))
    assert error.value.exit_code == USAGE


@pytest.mark.parametrize(
    ("inner_hz", "outer_hz"), [(500.0, 100.0), (1000.0, 100.0), (250.0, 125.0), (400.0, 100.0), (50.0, 50.0)]
)
def test_the_outer_rate_follows_the_inner_one(inner_hz: float, outer_hz: float) -> None:
    options = FlyOptions(HOP, inner_hz=inner_hz)
    assert outer_rate_hz(options) == outer_hz
    assert checked_plan(options).items


@pytest.mark.parametrize("mission", sorted(example_plans().values()), ids=lambda path: path.name)
def test_our_missions_pass_the_check(mission: Path) -> None:
    assert checked_plan(FlyOptions(mission)).items


def test_the_children_are_told_everything() -> None:
    options = FlyOptions(
        HOP,
        "backstepping",
        "paper",
        "paper",
        "4",
        1000.0,
        250.0,
        9,
        "3,-1",
        0.5,
        0.02,
        "x_quad",
        2,
        True,
        12.0,
        loops="c",
    )
    home = GeoPoint(47.1, -8.2, 3.5)
    assert simulator_arguments(options, home) == [
        "--vehicle=x_quad", "--plant=paper", "--speed=4", "--instance=2", "--seed=9", "--wind=3,-1", "--gust=0.5",
        "--torque-gust=0.02", "--ideal-rotors", "--state=estimated", "--port=4562", "--home=47.1,-8.2,3.5",
        "--timeout=12", "--clock=lockstep", "--head-start=1.1",
    ]  # fmt: skip
    assert stack_arguments(options, home, Path("runs/x"), 40_000) == [
        "--vehicle=x_quad", "--controller=backstepping", "--gains=paper", "--loops=c", "--state=estimated",
        "--inner-hz=1000.0", "--instance=2", "--ideal-rotors", "--outer-hz=250.0", "--sim-port=4562",
        "--sim-timeout=12", "--gcs=127.0.0.1:40000", f"--gcs=127.0.0.1:{options.gcs_port}", "--log=runs/x/flight.ulg",
        "--home=47.1,-8.2,3.5", "--exit-on-gcs-loss=5", "--params=none", "--state-dir=none", "--wait-for-start",
    ]  # fmt: skip


def test_a_parameter_file_is_passed_on_and_must_be_there(tmp_path: Path) -> None:
    path = tmp_path / "my.params"
    with pytest.raises(CliError, match=f"--params {path}: no such file") as error:
        checked_plan(FlyOptions(HOP, params=path))
    assert error.value.exit_code == USAGE
    path.write_text("")
    checked_plan(FlyOptions(HOP, params=path))
    assert f"--params={path}" in stack_arguments(
        FlyOptions(HOP, params=path), GeoPoint(0.0, 0.0, 0.0), tmp_path, 40_000
    )


def test_wind_acts_on_the_papers_vehicle_with_drag() -> None:
    windy = FlyOptions(HOP, wind="8,0", drag=True)
    checked_plan(windy)
    checked_plan(FlyOptions(HOP, wind="0,0", gust=0.0))
    assert "--drag" in simulator_arguments(windy, GeoPoint(47.1, -8.2, 3.5))
    assert flown_vehicle(windy).linear_drag_n_s_m == (0.153, 0.153, 0.153)


def test_the_simulator_is_told_about_battery_and_faults() -> None:
    faults = ("rotor:2:off@12.5", "battery:level=0.1@20")
    options = FlyOptions(HOP, battery_start=40.0, battery_drain=3.5, faults=faults)
    told = simulator_arguments(options, GeoPoint(47.1, -8.2, 3.5))
    assert set(told) >= {
        "--battery-start=40.0", "--battery-drain=3.5", "--fault=rotor:2:off@12.5", "--fault=battery:level=0.1@20"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("child", "fields"),
    [(sim_bridge_run, TO_SIMULATOR), (flightstack_run, TO_STACK)],
    ids=["sim-bridge", "flightstack"],
)
def test_gcs_fly_passes_on_every_option_of_its_children(
    child: Callable[..., None], fields: tuple[str, ...], capsys: Any
) -> None:
    """A new option of a child fails here until it is passed on, or listed with the reason why not."""
    offered = {flag_of(name) for name in inspect.signature(child).parameters if name != "context"}
    passed_on = {flag_of(name) for name in fields}
    assert passed_on <= offered
    assert {flag for flag in offered - passed_on if flag[2:].replace("-", "_") not in NOT_PASSED} == set()
    assert main(["fly", "--help"]) == DONE
    shown = capsys.readouterr().out
    assert [flag for flag in passed_on if f"  {flag} " not in shown] == []


def test_parameters_forces_and_home_reach_the_children() -> None:
    options = FlyOptions(
        HOP, param=["MPC_XY_CRUISE=3", "RTL_TYPE=0"], force="1,0,0", torque="0,0,0.1", physics_hz=2000.0,
        home="47.3977,8.5456,400", view=True,
    )  # fmt: skip
    home = home_of(options, checked_plan(options))
    assert home == GeoPoint(47.3977, 8.5456, 400.0)
    told = simulator_arguments(options, home)
    assert set(told) >= {"--force=1,0,0", "--torque=0,0,0.1", "--physics-hz=2000.0", "--view"}
    assert "--home=47.3977,8.5456,400.0" in told
    told = stack_arguments(options, home, Path("runs/x"), 40_000)
    assert set(told) >= {"--param=MPC_XY_CRUISE=3", "--param=RTL_TYPE=0", "--home=47.3977,8.5456,400.0"}


@pytest.mark.parametrize(("kind", "base"), [(socket.SOCK_STREAM, 4560), (socket.SOCK_DGRAM, 18570)])
def test_a_busy_port_is_named(kind: socket.SocketKind, base: int) -> None:
    instance = free_instance()
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # past links of the port are no matter
        taken.bind(("127.0.0.1", base + instance))
        if kind == socket.SOCK_STREAM:
            taken.listen(1)
        with pytest.raises(CliError, match=f"port {base + instance} .* is in use: .*--instance") as error:
            check_ports(FlyOptions(HOP, instance=instance))
    assert error.value.exit_code == USAGE


@pytest.mark.parametrize("words", [[], ["mission"], ["param"], ["log"], ["pil"]], ids=" ".join)
def test_no_line_of_the_help_is_cut(words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*words, "--help"]) == DONE
    usage, *lines = capsys.readouterr().out.splitlines()
    assert usage.startswith("Usage: gcs ")
    assert len(lines) > 5
    assert [line for line in lines if line.endswith("...")] == []


def test_unknown_word_of_a_choice_is_named_without_the_words_of_a_library(capsys: Any) -> None:
    assert main(["mission", "new", "sqare"]) == USAGE
    error = capsys.readouterr().err
    assert "'sqare' is not one of 'square'" in error
    assert "Value error" not in error


def test_interrupt_during_the_imports_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupted:
        def __getattr__(self, name: str) -> object:
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "gcs_cli.program", Interrupted())
    assert main(["status"]) == INTERRUPTED
    assert capsys.readouterr() == ("", "gcs: interrupted\n")
    assert main(["status", "--json"]) == INTERRUPTED
    assert capsys.readouterr() == (error_line("interrupted", INTERRUPTED) + "\n", "gcs: interrupted\n")
