"""Commands that change what an armed vehicle flies by ask on a terminal, and need --yes elsewhere."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from flightstack.mavlink.dialect import mavlink
from tests.support.fake_vehicle import FakeVehicle
from tests.support.told import MISSIONS, told

CHANGES = {
    "mission upload": (MISSIONS / "hop.plan",),
    "mission clear": (),
    "fence upload": (MISSIONS / "fenced_square.plan",),
    "fence clear": (),
    "rally upload": (MISSIONS / "fenced_square.plan",),
    "rally clear": (),
    "param load": (Path("vehicle.params"),),
    "param reset": ("--all",),
}


@pytest.fixture
def vehicle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeVehicle:
    """An armed vehicle; a parameter file is in the working directory."""
    monkeypatch.chdir(tmp_path)
    Path("vehicle.params").write_text("1\t1\tMPC_XY_CRUISE\t4.0\t9\n")
    armed = FakeVehicle()
    armed.armed = True
    return armed


@pytest.mark.parametrize(("command", "words"), CHANGES.items(), ids=list(CHANGES))
def test_change_of_armed_vehicle_needs_yes(
    vehicle: FakeVehicle, command: str, words: tuple[object, ...]
) -> None:
    result = told(vehicle, *command.split(), *words)
    assert (result.stdout, result.returncode) == ("", 2)
    assert result.stderr.startswith("gcs: the vehicle is armed, and ")
    assert result.stderr.endswith(": add --yes\n")
    assert not {"MISSION_COUNT", "MISSION_CLEAR_ALL", "PARAM_SET"} & {*vehicle.heard}
    assert mavlink.MAV_CMD_PREFLIGHT_STORAGE not in [number for number, _ in vehicle.commands]


def test_change_of_armed_vehicle_is_made_with_yes(vehicle: FakeVehicle) -> None:
    assert told(vehicle, "mission", "upload", MISSIONS / "hop.plan", "--yes").returncode == 0
    assert told(vehicle, "mission", "clear", "-y").stdout == "mission cleared\n"


@pytest.mark.parametrize("answer", ["y", "n"])
def test_question_keeps_the_link_until_the_answer(
    vehicle: FakeVehicle, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    """Without heartbeats of its only ground station the vehicle would begin a failsafe."""

    class Terminal:
        """Standard input on which the user answers after the next heartbeat."""

        def isatty(self) -> bool:
            return True

        def readline(self) -> str:
            vehicle.heard.clear()
            while "HEARTBEAT" not in vehicle.heard:
                pass
            return f"{answer}\n"

    monkeypatch.setattr(sys, "stdin", Terminal())
    result = told(vehicle, "mission", "clear")
    if answer == "y":
        assert (result.stdout, result.returncode) == ("mission cleared\n", 0)
    else:
        assert (result.stdout, result.returncode) == ("", 1)
        assert result.stderr.endswith("gcs: cancelled: nothing was changed\n")
