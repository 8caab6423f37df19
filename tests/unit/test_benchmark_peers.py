"""The peers of ``python -m benchmarks --against``: which paths are accepted, and what counts as a flight."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks import report, simulators
from benchmarks.measure import figure
from benchmarks.peer_error import PeerError
from benchmarks.peers import PEERS, peers_of
from benchmarks.simulator_flights.answering import SIDE_M, SPEED_M_S, place_m
from benchmarks.simulators import SIMULATORS, Flight, Simulator


def built(folder: Path) -> Path:
    program = folder / "build" / "sitl" / "bin" / "arducopter"
    program.parent.mkdir(parents=True)
    program.touch()
    return folder


def any_python(package: str) -> Simulator:
    return Simulator(package, f"{package}>=1", "none.py", ())


def test_peers_are_named_with_their_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PEERS, "jax", any_python("json"))
    checkout = built(tmp_path / "copter")
    found = peers_of(f"ardupilot={checkout},jax={sys.executable}")
    assert found == {"ardupilot": checkout, "jax": Path(sys.executable)}


def test_python_of_a_virtual_environment_is_not_resolved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PEERS, "jax", any_python("json"))
    link = tmp_path / "python"
    link.symlink_to(sys.executable)
    assert peers_of(f"jax={link}") == {"jax": link}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("gazebo=/opt", "'gazebo=/opt' is not NAME=PATH with a NAME of ardupilot, px4, rotorpy"),
        ("rotorpy", "'rotorpy' is not NAME=PATH"),
        ("px4=/nowhere", "/nowhere has no build/px4_sitl_default/bin/px4: build it first"),
        ("rotorpy=/nowhere/python", "/nowhere/python is no Python: give that of a virtual environment with"),
    ],
)
def test_path_that_cannot_fly_is_refused(text: str, problem: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as refused:
        peers_of(text)
    assert str(refused.value).startswith(problem)


def test_peer_with_two_paths_is_refused(tmp_path: Path) -> None:
    checkout = built(tmp_path)
    with pytest.raises(argparse.ArgumentTypeError, match="ardupilot has two paths"):
        peers_of(f"ardupilot={checkout},ardupilot={checkout}")


def test_python_without_the_package_is_refused_with_the_command_that_installs_it() -> None:
    problem = any_python("no_such_simulator").problem(Path(sys.executable))
    command = f'{sys.executable} -m pip install "no_such_simulator>=1"'
    assert problem == f"{sys.executable} has no no_such_simulator: {command}"


def test_each_simulator_has_its_script() -> None:
    for simulator in SIMULATORS.values():
        script = Path(simulators.__file__).parent / "simulator_flights" / simulator.script
        assert f"from {simulator.package}" in script.read_text(encoding="utf-8")


class Answers:
    """A process that answers once."""

    def __init__(self, answer: str) -> None:
        self.answer, self.asked = answer, ""

    def ask(self, line: str) -> str:
        self.asked = line
        return self.answer

    def last_error(self) -> str:
        return "No module named 'numpy'"


def test_factor_is_simulated_time_by_processor_time() -> None:
    process: Any = Answers('{"simulated_s": 40.0, "processor_s": 0.5, "error_m": 0.2}')
    assert simulators.fly(Flight("one", 10.0), process) == 80.0
    assert process.asked == "10"


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        ("", "one: No module named 'numpy'"),
        (
            '{"simulated_s": 4.0, "processor_s": 0.5, "error_m": 3.0}',
            "one did not fly the square: 3 m from it at the end",
        ),
        ('{"simulated_s": 4.0, "processor_s": 0.5, "error_m": NaN}', "one did not fly the square"),
    ],
)
def test_flight_that_failed_has_no_factor(answer: str, problem: str) -> None:
    process: Any = Answers(answer)
    with pytest.raises(PeerError) as failed:
        simulators.fly(Flight("one", 10.0), process)
    assert str(failed.value).startswith(problem)


def test_square_is_flown_side_after_side() -> None:
    side_s = SIDE_M / SPEED_M_S
    corners = [place_m(number * side_s)[:2] for number in range(5)]
    assert corners == [(0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0)]
    assert place_m(0.5 * side_s)[:2] == (0.5 * SIDE_M, 0.0)


def test_report_has_a_table_of_each_group_of_peers() -> None:
    measured = {"autopilots": {"one": figure([2.0])}, "simulators": {"another": figure([3.0])}}
    machine = {"system": "any", "cores": 2, "python": "3", "used_by_others": 0.0}
    text = "\n".join(report.texts({"peers": measured}, machine))
    assert "WITH OTHER AUTOPILOTS" in text
    assert "WITHOUT AUTOPILOT" in text
