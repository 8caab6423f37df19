"""``gcs param`` against a scripted vehicle, its table, its files and the metadata it reads."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.param_values import Parameter
from flightstack.mavlink.signing import timestamp_of
from gcs_cli.autopilots.ardupilot import ARDUPILOT
from gcs_cli.clients.param_client import ParamTiming
from gcs_cli.transfers.param_calls import Changes, change_all
from gcs_cli.vehicle.param_info import UNKNOWN, load_parameters
from tests.support.commands import Ended, gcs
from tests.support.fake_vehicle import serve
from tests.support.param_vehicle import ParamVehicle

PAIR = ("MPC_THR_LEAST", "MPC_THR_MOST")


@dataclass
class PairVehicle(ParamVehicle):
    """Keeps one parameter below another."""

    has_metadata: bool = False
    values: dict[str, float] = field(default_factory=lambda: {"MPC_THR_LEAST": 10.0, "MPC_THR_MOST": 20.0})

    def _on_param_set(self, message: Any) -> None:
        wanted = {**self.values, message.param_id: message.param_value}
        if wanted["MPC_THR_LEAST"] <= wanted["MPC_THR_MOST"]:
            self.values = wanted
        else:
            self._out.append(mavlink.MAVLink_param_error_message(255, 190, message.param_id.encode(), -1, 2))
        self._send_value(message.param_id)


@pytest.fixture
def vehicle() -> ParamVehicle:
    return ParamVehicle()


def told(vehicle: ParamVehicle, *arguments: object) -> Ended:
    with serve(vehicle) as socket:
        return gcs("--connect", f"udpout:127.0.0.1:{socket.address[1]}", "param", *arguments)


EVIL_NAMES = {"\x1b[2J": 1.0, "A\tB\nC": 2.0, "X\x07\x08\rY": 3.0, "[red]R[/]": 4.0, "\x7f\x00Z": 5.0}


def test_names_from_the_vehicle_cannot_command_the_terminal(vehicle: ParamVehicle) -> None:
    vehicle.values.update(EVIL_NAMES)
    for words in (["list"], ["list", "--json"], ["diff"], ["diff", "--json"]):
        result = told(vehicle, *words)
        assert result.returncode == 0, result.stderr
        assert all(line.isprintable() for line in result.stdout.splitlines())
    names = {json.loads(line)["name"] for line in told(vehicle, "list", "--json").stdout.splitlines()}
    assert names > {"�[2J", "A B C", "X�� Y", "[red]R[/]", "�"}
    assert "[red]R[/]" in told(vehicle, "list").stdout


def test_names_from_the_vehicle_cannot_add_lines_to_a_file(vehicle: ParamVehicle, tmp_path: Path) -> None:
    vehicle.values.update({**EVIL_NAMES, "A\t9\t9\n1\t1\tB": 6.0})
    result = told(vehicle, "save", tmp_path / "saved.params")
    assert result.stdout == f"3 parameters saved to {tmp_path / 'saved.params'}\n"
    assert result.stderr.startswith("gcs: not saved, not valid as parameter names: ")
    assert result.stderr.rstrip("\n").isprintable()
    assert set(load_parameters(tmp_path / "saved.params")) == {"MPC_XY_CRUISE", "MPC_YAW_MODE", "ROLL_P"}


def test_the_list_shows_value_unit_range_and_help(vehicle: ParamVehicle) -> None:
    result = told(vehicle, "list")
    assert (result.stderr, result.returncode) == ("", 0)
    line = next(line for line in result.stdout.splitlines() if line.startswith("MPC_XY_CRUISE"))
    assert line.split() == [
        "MPC_XY_CRUISE",
        "4",
        "m/s",
        "0.1",
        "to",
        "20",
        "Horizontal",
        "speed",
        "in",
        "auto",
        "modes",
    ]
    assert "default" not in result.stdout  # all have it: no column for it


def test_the_list_shows_the_default_of_what_was_changed(vehicle: ParamVehicle) -> None:
    vehicle.values["MPC_XY_CRUISE"] = 7.5
    lines = told(vehicle, "list", "cruise").stdout.splitlines()
    assert "default" in lines[0]
    assert lines[-1].split()[:4] == ["MPC_XY_CRUISE", "7.5", "m/s", "4"]
    assert len(lines) == 3


def test_a_vehicle_without_metadata_is_listed_all_the_same() -> None:
    result = told(ParamVehicle(has_metadata=False), "list", "MPC_*")
    assert result.returncode == 0
    assert [line.split() for line in result.stdout.splitlines()[-2:]] == [
        ["MPC_XY_CRUISE", "4"],
        ["MPC_YAW_MODE", "0"],
    ]


def test_the_list_as_json(vehicle: ParamVehicle) -> None:
    facts = json.loads(told(vehicle, "list", "yaw", "--json").stdout)
    assert facts == {
        "event": "parameter", "name": "MPC_YAW_MODE", "value": 0, "default": 0.0, "min": 0.0, "max": 5.0,
        "unit": None, "help": "Heading of waypoints without yaw", "details": None,
        "choices": {"0": "Towards the waypoint", "5": "Unchanged"},
    }  # fmt: skip


def test_a_pattern_that_matches_nothing(vehicle: ParamVehicle) -> None:
    result = told(vehicle, "list", "NOTHING")
    assert (result.stderr, result.returncode) == ("gcs: no parameter matches NOTHING\n", 1)


def test_get_tells_all_about_one(vehicle: ParamVehicle) -> None:
    assert told(vehicle, "get", "mpc_xy_cruise").stdout == (
        "MPC_XY_CRUISE = 4 m/s\n  Horizontal speed in auto modes\n  default 4, range 0.1 to 20\n"
    )
    assert told(vehicle, "get", "MPC_YAW_MODE").stdout == (
        "MPC_YAW_MODE = 0\n  Heading of waypoints without yaw\n  default 0, takes effect after a restart\n"
        "  0: Towards the waypoint\n  5: Unchanged\n"
    )
    assert json.loads(told(vehicle, "get", "ROLL_P", "--json").stdout)["value"] == 0.38729835


def test_get_of_an_unknown_name(vehicle: ParamVehicle) -> None:
    result = told(vehicle, "get", "NONE")
    assert (result.stderr, result.returncode) == ("gcs: NONE refused: the vehicle has no such parameter\n", 1)


def test_get_of_a_misspelt_name_suggests_similar_ones(vehicle: ParamVehicle) -> None:
    result = told(vehicle, "get", "MPC_XY_CRUIS")
    assert result.returncode == 1
    assert result.stderr.endswith("the vehicle has no such parameter; did you mean MPC_XY_CRUISE?\n")
    assert "did you mean MPC_XY_CRUISE" in told(vehicle, "set", "MPC_XY_CRUSE", "3").stderr


def test_misspelt_name_downloads_no_list(vehicle: ParamVehicle) -> None:
    vehicle.ignored.add("PARAM_REQUEST_LIST")
    assert "did you mean MPC_XY_CRUISE?" in told(vehicle, "get", "MPC_XY_CRUIS").stderr


def test_get_takes_patterns(vehicle: ParamVehicle) -> None:
    result = told(vehicle, "get", "mpc_*", "MPC_XY_CRUISE", "--json")
    names = [json.loads(line)["name"] for line in result.stdout.splitlines()]
    assert "MPC_XY_CRUISE" in names
    assert len(names) == len(set(names)) > 1
    assert all(name.startswith("MPC_") for name in names)
    assert told(vehicle, "get", "NIX*").stderr == "gcs: no parameter matches NIX*\n"


def test_search_finds_by_description(vehicle: ParamVehicle) -> None:
    found = told(vehicle, "search", "horizontal", "sped", "--json").stdout.splitlines()
    assert [json.loads(line)["name"] for line in found] == ["MPC_XY_CRUISE"]
    assert told(vehicle, "search", "battery").returncode == 1


def test_set_says_what_it_changed(vehicle: ParamVehicle) -> None:
    assert told(vehicle, "set", "MPC_XY_CRUISE", "5.5").stdout == "MPC_XY_CRUISE = 5.5 m/s (was 4)\n"
    assert vehicle.values["MPC_XY_CRUISE"] == 5.5
    assert told(vehicle, "set", "MPC_XY_CRUISE", "5.5").stdout == "MPC_XY_CRUISE is 5.5 m/s already\n"
    assert told(vehicle, "set", "MPC_YAW_MODE", "5").stdout == (
        "MPC_YAW_MODE = 5 (was 0); it takes effect after a restart\n"
    )
    assert vehicle.values["MPC_YAW_MODE"] == 5


@pytest.mark.parametrize(
    ("arguments", "sentence", "code"),
    [
        (["MPC_XY_CRUISE", "25"], "MPC_XY_CRUISE = 25 refused: 25 is outside 0.1 to 20", 1),
        (["MPC_XY_CRUISE", "-1"], "MPC_XY_CRUISE = -1 refused: -1 is outside 0.1 to 20", 1),
        (["MPC_YAW_MODE", "0.5"], "MPC_YAW_MODE = 0.5 refused: the parameter is an integer", 1),
        (["NONE", "1"], "NONE refused: the vehicle has no such parameter", 1),
        (["MPC_XY_CRUISE", "fast"], "fast: expected a number", 2),
        (["MPC_XY_CRUISE", "nan"], "nan: expected a number", 2),
    ],
)
def test_a_refused_set_is_one_sentence(
    vehicle: ParamVehicle, arguments: list[str], sentence: str, code: int
) -> None:
    before = dict(vehicle.values)
    result = told(vehicle, "set", *arguments)
    assert (result.stderr, result.returncode) == (f"gcs: {sentence}\n", code)
    assert result.stdout == ""
    assert vehicle.values == before


def test_reset_of_some(vehicle: ParamVehicle) -> None:
    vehicle.values.update(MPC_XY_CRUISE=9.0, MPC_YAW_MODE=5)
    result = told(vehicle, "reset", "MPC_XY_CRUISE", "ROLL_P")
    assert result.stdout == "MPC_XY_CRUISE = 4 m/s (was 9)\nROLL_P is 0.38729835 already\n"
    assert (vehicle.values["MPC_XY_CRUISE"], vehicle.values["MPC_YAW_MODE"]) == (4.0, 5)


@pytest.mark.parametrize("names", [PAIR, PAIR[::-1]])
def test_parameters_that_limit_each_other_reset_in_any_order(
    names: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    infos = {name: UNKNOWN._replace(default=default) for name, default in zip(PAIR, (1.0, 2.0), strict=True)}
    monkeypatch.setattr("gcs_cli.transfers.param_calls.fetch_metadata", lambda _connection: infos)
    vehicle = PairVehicle()
    result = told(vehicle, "reset", *names)
    assert (result.stderr, result.returncode) == ("", 0)
    assert vehicle.values == {"MPC_THR_LEAST": 1.0, "MPC_THR_MOST": 2.0}


def test_counters_of_arducopter_are_not_loaded() -> None:
    """MIS_TOTAL is the number of stored mission items: a file that was saved before an upload was refused."""
    session = SimpleNamespace(view=SimpleNamespace(autopilot=ARDUPILOT))
    connection: Any = SimpleNamespace(session=session)
    present = {"MIS_TOTAL": Parameter("MIS_TOTAL", 8.0, True, 0, 1)}
    assert change_all(connection, {"MIS_TOTAL": 0.0}, present) == Changes((), ())


def test_reset_of_all(vehicle: ParamVehicle) -> None:
    vehicle.values.update(MPC_XY_CRUISE=9.0, MPC_YAW_MODE=5)
    assert told(vehicle, "reset", "--all").stdout == "all parameters have their defaults\n"
    assert (vehicle.values["MPC_XY_CRUISE"], vehicle.values["MPC_YAW_MODE"]) == (4.0, 0)


def test_reset_needs_to_know_what(vehicle: ParamVehicle) -> None:
    for arguments in ((), ("ROLL_P", "--all")):
        result = told(vehicle, "reset", *arguments)
        assert (result.stderr, result.returncode) == (
            "gcs: reset: expected names of parameters, or --all\n",
            2,
        )


def test_reset_without_known_defaults_changes_nothing() -> None:
    vehicle = ParamVehicle(has_metadata=False)
    vehicle.values["MPC_XY_CRUISE"] = 9.0
    result = told(vehicle, "reset", "MPC_XY_CRUISE")
    assert result.returncode == 1
    assert "does not send its default" in result.stderr
    assert vehicle.values["MPC_XY_CRUISE"] == 9.0


def test_what_was_saved_is_loaded(vehicle: ParamVehicle, tmp_path: Path) -> None:
    file = tmp_path / "tuned.params"
    vehicle.values.update(MPC_XY_CRUISE=9.25, MPC_YAW_MODE=5)
    assert told(vehicle, "save", file).stdout == f"3 parameters saved to {file}\n"
    assert "1\t1\tMPC_XY_CRUISE\t9.25\t9\n1\t1\tMPC_YAW_MODE\t5\t6\n" in file.read_text()
    assert told(vehicle, "diff", file).stdout == f"all parameters are as in {file}\n"
    other = ParamVehicle()
    difference = told(other, "diff", file).stdout.splitlines()
    assert difference[0].split() == ["name", "value", "unit", "file", "range", "help"]
    assert difference[2].split()[:4] == ["MPC_XY_CRUISE", "4", "m/s", "9.25"]
    assert told(other, "load", file).stdout == "2 of 3 parameters changed\n"
    assert other.values == vehicle.values
    assert told(other, "load", file).stdout == "0 of 3 parameters changed\n"


def written(folder: Path, **values: float) -> Path:
    """Write a parameter file."""
    file = folder / "other.params"
    kinds = {"MPC_YAW_MODE": 6}
    file.write_text(
        "".join(f"1\t1\t{name}\t{value:g}\t{kinds.get(name, 9)}\n" for name, value in values.items())
    )
    return file


def test_unknown_parameters_are_named_and_the_rest_is_loaded(vehicle: ParamVehicle, tmp_path: Path) -> None:
    file = written(tmp_path, FOREIGN=1, MPC_YAW_MODE=5)
    result = told(vehicle, "load", file)
    assert (result.returncode, result.stdout) == (1, "1 of 2 parameters changed\n")
    assert result.stderr.splitlines() == [
        "gcs: FOREIGN: the vehicle has no such parameter",
        f"gcs: 1 of 2 parameters of {file} were not set",
    ]
    assert vehicle.values["MPC_YAW_MODE"] == 5


def test_a_refused_value_undoes_the_load(vehicle: ParamVehicle, tmp_path: Path) -> None:
    before = dict(vehicle.values)
    file = written(tmp_path, FOREIGN=1, MPC_YAW_MODE=5, MPC_XY_CRUISE=99, ROLL_P=0.5)
    result = told(vehicle, "load", file)
    assert (result.returncode, result.stdout) == (1, "0 of 4 parameters changed\n")
    assert result.stderr.splitlines() == [
        "gcs: FOREIGN: the vehicle has no such parameter",
        "gcs: MPC_XY_CRUISE = 99 refused: 99 is outside 0.1 to 20",
        f"gcs: no parameter of {file} was set",
    ]
    assert vehicle.values == before


@pytest.mark.parametrize("names", [PAIR, PAIR[::-1]])
@pytest.mark.parametrize("values", [(30.0, 40.0), (1.0, 2.0)])
def test_parameters_that_limit_each_other_load_in_any_order(
    names: tuple[str, str], values: tuple[float, float], tmp_path: Path
) -> None:
    vehicle = PairVehicle()
    wanted = dict(zip(PAIR, values, strict=True))
    file = written(tmp_path, **{name: wanted[name] for name in names})
    result = told(vehicle, "load", file)
    assert (result.stderr, result.returncode) == ("", 0)
    assert result.stdout == "2 of 2 parameters changed\n"
    assert vehicle.values == wanted


def test_a_crossed_pair_is_refused_and_undone(tmp_path: Path) -> None:
    vehicle = PairVehicle()
    result = told(vehicle, "load", written(tmp_path, MPC_THR_LEAST=15.0, MPC_THR_MOST=12.0))
    assert result.returncode == 1
    assert vehicle.values == {"MPC_THR_LEAST": 10.0, "MPC_THR_MOST": 20.0}


def test_diff_from_the_defaults(vehicle: ParamVehicle) -> None:
    assert told(vehicle, "diff").stdout == "all parameters have their defaults\n"
    vehicle.values["MPC_XY_CRUISE"] = 9.0
    lines = told(vehicle, "diff").stdout.splitlines()
    assert lines[-1].split()[:4] == ["MPC_XY_CRUISE", "9", "m/s", "4"]
    assert len(lines) == 3
    result = told(ParamVehicle(has_metadata=False), "diff")
    assert result.returncode == 1
    assert "name a file" in result.stderr


def test_a_bad_file_is_a_usage_error_before_anything_is_asked(tmp_path: Path) -> None:
    for command in ("load", "diff"):
        result = gcs("param", command, tmp_path / "none.params")
        assert result.returncode == 2
        assert "none.params: no such file" in result.stderr


def test_a_vehicle_that_does_not_answer_about_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs_cli.transfers.param_calls.TIMING", ParamTiming(timeout_s=0.1, retries=1))
    vehicle = ParamVehicle(ignored={"PARAM_REQUEST_READ"})
    result = told(vehicle, "get", "ROLL_P")
    assert (result.returncode, result.stdout) == (3, "")
    assert "did not answer about ROLL_P" in result.stderr


# ---------------------------------------------------------------------- signed links

KEY = bytes(range(32))


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "gcs.key"
    path.write_text(KEY.hex())
    path.chmod(0o600)
    return path


def signed_vehicle(key: bytes) -> ParamVehicle:
    """A vehicle whose pymavlink signs, and takes signed messages only."""
    vehicle = ParamVehicle()
    signing = vehicle.codec.signing
    signing.secret_key, signing.sign_outgoing = key, True
    signing.timestamp = timestamp_of(time.time())
    return vehicle


def told_signed(vehicle: ParamVehicle, key_file: Path, *arguments: object) -> Ended:
    with serve(vehicle) as socket:
        link = f"udpout:127.0.0.1:{socket.address[1]}"
        return gcs("--connect", link, "--timeout", "1", "--signing-key", key_file, *arguments)


def test_a_signed_vehicle_is_commanded_with_its_key(key_file: Path) -> None:
    vehicle = signed_vehicle(KEY)
    for value in ("5", "6"):  # the second run goes on with its timestamps
        result = told_signed(vehicle, key_file, "param", "set", "MPC_XY_CRUISE", value)
        assert (result.stderr, result.returncode) == ("", 0)
    assert vehicle.values["MPC_XY_CRUISE"] == 6.0
    assert vehicle.codec.signing.goodsig_count > 0
    assert vehicle.codec.signing.badsig_count == 0


@pytest.mark.parametrize("vehicle", [signed_vehicle(KEY[::-1]), ParamVehicle()], ids=["another", "none"])
def test_a_vehicle_with_another_key_or_none_is_not_heard(key_file: Path, vehicle: ParamVehicle) -> None:
    vehicle.codec.signing.allow_unsigned_callback = lambda *_: True  # it talks to anybody
    result = told_signed(vehicle, key_file, "arm")
    assert result.returncode == 3
    assert "does not sign with this key" in result.stderr
    assert not vehicle.armed


def test_a_key_that_others_may_read_is_a_usage_error(key_file: Path) -> None:
    key_file.chmod(0o644)
    result = gcs("--signing-key", key_file, "arm")
    assert (result.returncode, result.stdout) == (2, "")
    assert f"chmod 600 {key_file}" in result.stderr
