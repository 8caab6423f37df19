"""``gcs sim``: options, files, start positions and addresses of each vehicle, without processes."""

from __future__ import annotations

import contextlib
import math
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from flightstack.core.geodesy import LocalFrame
from flightstack.params.config import DEFAULT_HOME
from flightstack.process.console import complain
from flightstack.process.options import RunOptions
from gcs_cli.errors import USAGE, CliError
from gcs_cli.output import Output
from gcs_cli.sim import sim_run
from gcs_cli.sim.sim_flags import TO_STACK, SimOptions
from gcs_cli.sim.sim_vehicles import connections, name_of, ready_text, stack_arguments, start_of, vehicles_of
from tests.support.commands import gcs


def test_vehicles_stand_spaced_to_the_east() -> None:
    fleet = vehicles_of(SimOptions(vehicles=3, spacing=5.0))
    places = [LocalFrame(DEFAULT_HOME).to_ned(start_of(vehicle)) for vehicle in fleet]
    assert [place.x for place in places] == [0.0, 0.0, 0.0]
    assert [round(place.y, 6) for place in places] == [0.0, 5.0, 10.0]
    assert start_of(fleet[0]) == DEFAULT_HOME


def test_each_vehicle_has_an_instance_and_a_seed() -> None:
    fleet = vehicles_of(SimOptions(vehicles=2, instance=7, seed=3))
    assert [(vehicle.instance, vehicle.seed) for vehicle in fleet] == [(7, 3), (8, 4)]


def test_one_vehicle_has_the_files_that_were_given() -> None:
    (only,) = vehicles_of(SimOptions(log="a/b.ulg", state_dir="s", params=Path("p.params")))
    assert {"--log=a/b.ulg", "--state-dir=s", "--params=p.params"} <= set(stack_arguments(only))


def test_several_vehicles_share_no_file() -> None:
    fleet = vehicles_of(SimOptions(vehicles=2, log="a/b.ulg", state_dir="s"))
    assert [vehicle.log for vehicle in fleet] == ["a/instance-0/b.ulg", "a/instance-1/b.ulg"]
    assert [vehicle.state_dir for vehicle in fleet] == ["s/instance-0", "s/instance-1"]


def test_several_vehicles_only_read_the_parameter_file(tmp_path: Path) -> None:
    file = tmp_path / "tuned.params"
    file.write_text("1\t1\tMPC_XY_CRUISE\t3\t9\n1\t1\tMAV_SYS_ID\t9\t6\n")
    for vehicle in vehicles_of(SimOptions(vehicles=2, params=file, param=["MPC_Z_VEL_MAX_UP=2"])):
        arguments = stack_arguments(vehicle)
        assert [text for text in arguments if text.startswith("--param")] == [
            "--param=MPC_XY_CRUISE=3",
            "--param=MPC_Z_VEL_MAX_UP=2",
        ]


def test_files_are_those_of_flightstack_by_default() -> None:
    for vehicle in vehicles_of(SimOptions(vehicles=2)):
        flags = {text.partition("=")[0] for text in stack_arguments(vehicle)}
        assert not flags & {"--log", "--state-dir", "--params"}


def test_none_means_no_files_for_all_vehicles() -> None:
    for vehicle in vehicles_of(SimOptions(vehicles=2, log="none", state_dir="none", params=Path("none"))):
        assert {"--log=none", "--state-dir=none", "--params=none"} <= set(stack_arguments(vehicle))


def test_instances_beyond_the_last_one_are_refused() -> None:
    with pytest.raises(CliError, match="--vehicles 3: the last instance would be 250") as error:
        vehicles_of(SimOptions(vehicles=3, instance=248))
    assert error.value.exit_code == USAGE


def test_addresses_are_those_of_the_instance() -> None:
    first, second = vehicles_of(SimOptions(vehicles=2))
    assert connections(first)["mavsdk"] == "udpin://127.0.0.1:14540"
    assert connections(second) | {"longitude_deg": 0.0} == {
        "instance": 1,
        "system_id": 2,
        "mavsdk": "udpin://127.0.0.1:14541",
        "ground_station_port": 14550,
        "gcs": "udpout:127.0.0.1:18571",
        "tcp": "tcp:127.0.0.1:5770",
        "latitude_deg": DEFAULT_HOME.latitude_deg,
        "longitude_deg": 0.0,
        "altitude_m": DEFAULT_HOME.altitude_m,
    }
    assert "gcs --instance 1 status" in ready_text(second)
    (signed,) = vehicles_of(SimOptions(signing_key=Path("my key")))
    assert "gcs --signing-key 'my key' status" in ready_text(signed)


def test_the_default_speed_is_real_time() -> None:
    assert SimOptions().speed_factor == 1.0
    assert math.isinf(SimOptions(speed="max").speed_factor)


def test_passed_options_are_options_of_the_flight_stack() -> None:
    assert set(TO_STACK) <= set(RunOptions.__dataclass_fields__)


def test_several_vehicles_send_to_one_ground_station() -> None:
    first, second = vehicles_of(SimOptions(vehicles=2, instance=3))
    for vehicle in (first, second):
        assert "--gcs=127.0.0.1:14553" in stack_arguments(vehicle)
        assert sim_run.view_link(vehicle) == ["--connect", "udpin:127.0.0.1:14553"]
    assert "gcs --instance 3 status" in ready_text(first)
    assert "UDP 14553, added as a link" in ready_text(second)


def test_text_of_a_vehicle_names_system_id_and_instance() -> None:
    (alone,), (twentieth,) = vehicles_of(SimOptions()), vehicles_of(SimOptions(instance=20))
    assert ready_text(alone).startswith("vehicle 1 is ready: paper_quad\n")
    assert ready_text(twentieth).startswith("vehicle 21 (instance 20) is ready: paper_quad\n")
    assert [name_of(vehicle) for vehicle in vehicles_of(SimOptions(vehicles=2))] == [
        "vehicle 1 (instance 0)",
        "vehicle 2 (instance 1)",
    ]


def test_view_of_vehicles_with_a_remote_ground_station_shows_the_first() -> None:
    first, _ = vehicles_of(SimOptions(vehicles=2, gcs=["192.168.1.9:14550"]))
    assert stack_arguments(first).count("--gcs=192.168.1.9:14550") == 1
    assert sim_run.view_link(first) == ["--instance", "0"]
    assert "UDP 192.168.1.9:14550\n" in ready_text(first)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--watch --json", "give either --watch or --json"),
        ("--vehicles 0", "--vehicles: 0 is outside the allowed range 1 to 250"),
        ("--plant flat", "--plant: 'flat' is not one of"),
        ("--wind 3", "--wind: '3' has 1 number"),
        ("--param MPC_XY_CRUSE=3", "--param: MPC_XY_CRUSE"),
        ("--home 1,2", "--home: 1,2"),
        ("--log a.ulg --vehicles 2 --gains loud", "loud: is neither"),
    ],
)
def test_bad_options_are_refused_before_anything_starts(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = gcs("sim", *words.split())
    assert ended.returncode == USAGE
    assert "ready" not in ended.stdout
    assert ended.stderr.startswith(f"gcs: {said}")
    assert list(tmp_path.iterdir()) == []


def test_view_is_a_process_that_ends_with_the_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[tuple[str, ...]] = []

    def program(*words: str, descriptor: int) -> list[str]:
        assert descriptor > 2
        started.append(words)
        return [sys.executable, "-c", "import signal; signal.pause()"]

    monkeypatch.setattr(sim_run, "supervised", program)
    with sim_run.opened_view(SimOptions(instance=3, signing_key=Path("k")), wanted=True) as view:
        assert view is not None
        assert view.poll() is None
    assert view.returncode == -signal.SIGTERM
    assert started == [("gcs_cli", "--signing-key", "k", "--instance", "3", "watch")]
    with sim_run.opened_view(SimOptions(), wanted=False) as nothing:
        assert nothing is None


def test_notices_are_printed_after_the_view(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The view draws on the same terminal."""
    notices: list[str] = []

    class NoisyChildren(contextlib.nullcontext[None]):
        """Children that write a warning while the view runs."""

        def __init__(self, *_: object) -> None:
            super().__init__()

        def start(self, *_: object) -> None:
            pass

        def notices(self) -> list[str]:
            new = list(notices)
            notices.clear()
            return new

        def ended(self) -> list[object]:
            return []

        def __enter__(self) -> NoisyChildren:  # type: ignore[override]
            return self

    class View:
        """A view that ends after two steps."""

        steps = 0

        def poll(self) -> int | None:
            self.steps += 1
            return None if self.steps < 3 else 0

    @contextlib.contextmanager
    def view(*_: object) -> Iterator[View]:
        notices.append("WARNING low battery")
        yield View()
        complain("view ended")

    def become_ready(processes: sim_run.VehicleProcesses, _now_s: float) -> bool:
        processes.is_ready = True
        return False

    monkeypatch.setattr(sim_run, "opened_view", view)
    monkeypatch.setattr(sim_run, "Children", NoisyChildren)
    monkeypatch.setattr(sim_run, "check_ports", lambda _vehicle: None)
    monkeypatch.setattr(sim_run.VehicleProcesses, "poll", become_ready)
    sim_run.simulate(SimOptions(), Output(as_json=False), watch=True)
    assert capsys.readouterr().err == "view ended\nWARNING low battery\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--log folder", "folder: cannot be written: Is a directory"),
        ("--log file/flight.ulg", "file/flight.ulg: cannot be written: Not a directory"),
        ("--log file", "file: exists already: name another file or give --overwrite"),
        (
            "--vehicles 2 --log file/flight.ulg",
            "file/instance-0/flight.ulg: cannot be written: Not a directory",
        ),
        ("--state here", "--state: here is not one of estimated, truth; the directory is --state-dir"),
        ("--state-dir file", "file: cannot be written: Not a directory"),
        ("--params file/new.params", "file/new.params: cannot be written: Not a directory"),
        ("--vehicles 2 --params missing.params", "missing.params: no such file"),
        ("--params folder", "--params folder: is a directory"),
        ("--gcs station", "--gcs: station must be HOST:PORT"),
        ("--gcs 127.0.0.1:99999", "--gcs: 99999 is outside 1 to 65535"),
        ("--listen nowhere.invalid", "--listen: nowhere.invalid is not a host with an IPv4 address"),
    ],
)
def test_bad_option_is_refused_before_a_process_starts(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    monkeypatch.setattr(sim_run, "Fleet", lambda: pytest.fail("a vehicle is started"))
    assert gcs("sim", *words.split()) == ("", f"gcs: {said}\n", 2)


def test_the_flight_stack_alone_mentions_a_new_parameter_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sim_run, "check_ports", lambda _vehicle: None)
    sim_run.check_vehicle(SimOptions(params=tmp_path / "new.params"))
    assert capsys.readouterr().err == ""
    (tmp_path / "new.params").write_text("1\t1\tMPC_XY_CRUISE\t3\t9\n")
    sim_run.check_vehicle(SimOptions(params=tmp_path / "new.params"))
    assert capsys.readouterr().err == ""
