"""Gains files: the built-in ones, and one sentence for each thing that can be wrong with one."""

from __future__ import annotations

import math
import pickle
import re
from pathlib import Path

import pytest

from flightstack.control.attitude_backstepping import CONTROLLER as BACKSTEPPING
from flightstack.control.attitude_pid import CONTROLLER as PID
from flightstack.control.loops import PythonLoops
from flightstack.core.errors import ConfigError
from flightstack.params.gains_file import BUILT_IN, built_in_gains, open_gains
from flightstack.params.vehicle import load_vehicle

TUNED = (BUILT_IN / "tuned.toml").read_text(encoding="utf-8")
VEHICLE = load_vehicle("paper_quad")


def make(gains: str, controller=PID) -> PythonLoops:
    return PythonLoops(VEHICLE, controller, open_gains(gains), 500.0, 100.0, math.radians(45.0))


def changed(pattern: str, replacement: str) -> str:
    text, times = re.subn(pattern, replacement, TUNED, count=1, flags=re.MULTILINE)
    assert times, pattern
    return text


def without(table: str) -> str:
    return re.sub(rf"\[{table}\][^[]*(?:\[[^\]\n]*[,\]][^[]*)*?(?=^\[|\Z)", "", TUNED, flags=re.MULTILINE)


@pytest.mark.parametrize("controller", [PID, BACKSTEPPING], ids=lambda controller: controller.name)
@pytest.mark.parametrize("name", built_in_gains())
def test_built_in_gains_fit_both_controllers(name: str, controller) -> None:
    assert built_in_gains() == ["backstepping_poles", "paper", "paper_rate_fed", "tuned"]
    assert make(name, controller).name == "python"


def test_tables_of_other_controllers_are_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text(TUNED + "\n[attitude_lqr]\nq = 3.0\n")
    make(str(path))


BAD = {
    "negative gain": (
        changed(r"^kp = 8.75", "kp = -8.75"),
        "position.kp: -8.75 is outside the allowed range 0 to 1000",
    ),
    "unknown key": (changed(r"^kp = 8.75", "kp = 8.75\nkpp = 1"), "position.kpp: is not a known key"),
    "unknown key of the altitude loop": (
        changed(r"^kd = 6.5", "kd = 6.5\nkq = 1"),
        "altitude.kq: is not a known",
    ),
    "unknown table": ("[atitude]\nkp = 1\n" + TUNED, "atitude: is not a known key"),
    "missing gain": (changed(r"^kd = 5.5\n", ""), "position.kd: is missing"),
    "unknown convention": (
        changed(r'convention = "acceleration"', 'convention = "mine"'),
        "altitude.convention: 'mine' is not one of acceleration, paper",
    ),
    "two gains for three axes": (
        changed(r"^kp = \[225.*\]", "kp = [225.0, 225.0]"),
        "attitude_pid.kp: must be a list of 3 numbers",
    ),
    "unknown key of the controller": (
        changed(r'^convention = "angular_acceleration"', 'convention = "angular_acceleration"\nkf = 2'),
        "attitude_pid.kf: is not a known key",
    ),
    "too fast a filter": (
        changed(r"^bandwidth_rad_s = 60.0", "bandwidth_rad_s = 1e6"),
        "attitude_reference.bandwidth_rad_s: 1000000 is outside the allowed range 0 to 1000",
    ),
    "no position loop": (without("position"), "position: is missing"),
    "no filter": (without("attitude_reference"), "attitude_reference: is missing"),
    "nothing for the controller": (without("attitude_pid"), "attitude_pid.kp: is missing"),
    "controller that is no table": (
        "attitude_pid = 3\n" + without("attitude_pid"),
        "attitude_pid: must be a table",
    ),
    "not TOML": ("kp = = 3", "is not valid TOML: "),
}


@pytest.mark.parametrize("name", BAD)
def test_errors_name_file_key_and_range(tmp_path: Path, name: str) -> None:
    text, sentence = BAD[name]
    path = tmp_path / "my.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        make(str(path))
    assert str(error.value).startswith(f"{path}: {sentence}")
    assert "\n" not in str(error.value)


def test_gains_that_are_not_there() -> None:
    with pytest.raises(
        ConfigError,
        match=r"^soft: is neither a file nor built-in gains \(backstepping_poles, paper, paper_rate_fed, tuned\)$",
    ):
        open_gains("soft")
    with pytest.raises(ConfigError, match=r"^no/such.toml: cannot be read: No such file or directory$"):
        open_gains("no/such.toml")


def test_a_directory_does_not_hide_built_in_gains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "paper").mkdir()
    monkeypatch.chdir(tmp_path)
    assert open_gains("paper").text("description") == open_gains(str(BUILT_IN / "paper.toml")).text(
        "description"
    )
    (tmp_path / "soft").write_text(TUNED)
    make("./soft")


def test_the_error_of_a_file_travels_between_processes() -> None:
    error = ConfigError(Path("my.toml"), "position.kp", "is missing")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is ConfigError
    assert str(again) == str(error) == "my.toml: position.kp: is missing"
