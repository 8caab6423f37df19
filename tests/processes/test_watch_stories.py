"""``gcs watch`` in a real terminal, used as a person uses it, beside simulated vehicles."""

from __future__ import annotations

import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from flightstack.transports.udp import UdpSocket
from tests.support.tmux import Terminal, terminal
from tests.support.vehicle_processes import VehicleProcesses, vehicle

SQUARE = Path(__file__).parents[2] / "missions" / "square.plan"
OPTIONS = ("--log", "none", "--state-dir", "none")
CURSOR_S = re.compile(r"−\d+\.\d+ s")
SPEED = 4
"""Times real time: flights are short, and the screen shows each part of them."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VehicleProcesses]:
    with vehicle(tmp_path_factory.mktemp("vehicle"), *OPTIONS, speed=SPEED) as made:
        made.wait_until_healthy()
        yield made


@contextmanager
def watching(link: str, folder: Path, screen: str = "fly", **options: str) -> Iterator[Terminal]:
    """Yield the view of the vehicles at ``link``, which ends by its key in the end."""
    command = [sys.executable, "-m", "gcs_cli", "watch", "--connect", link, "--screen", screen]
    with terminal(command, folder, **options) as view:
        view.wait("● 100%", "q Quit")
        yield view
        view.press("q")
        view.wait_for_end()


def wait_for_messages(view: Terminal, *texts: str) -> None:
    """Wait for ``texts`` on the screen Messages: the toasts with them disappear after some seconds."""
    view.press("5")
    view.wait("s Severity", *texts)


def test_vehicle_flies_to_a_place_on_the_map(flown: VehicleProcesses, tmp_path: Path) -> None:
    with watching(flown.link, tmp_path) as view:
        view.wait("A Arm")
        view.press("A")
        view.wait("Arm quadrotor", "Arm (y)")
        view.press("y")
        view.wait(" ARMED ", "D Disarm")
        view.press("T")
        view.wait("Take off:", "altitude")
        view.press("Enter")
        view.wait("in air", without="Take off:")
        wait_for_messages(view, "at 5 m after")
        view.press("2")
        view.wait("⌂", "setpoint", "home")
        view.press("Right", "Right", "g")
        view.wait("Fly quadrotor", "at the current altitude")
        view.press("y")
        wait_for_messages(view, "at 47.39")
        view.press("C-p")
        view.wait("Search for commands")
        view.type("Land")
        view.wait("Land here")
        view.press("Enter")
        view.wait("landed and disarmed after", "DISARMED", without="Search for commands")


def test_mission_is_edited_uploaded_paused_and_resumed(flown: VehicleProcesses, tmp_path: Path) -> None:
    with watching(flown.link, tmp_path, "mission") as view:
        view.press("o")
        view.wait("Load a plan")
        view.type(str(SQUARE))
        view.press("Enter")
        view.wait("6 items loaded", "NOT UPLOADED")
        view.press("Down", "Enter")
        view.wait("Item 1", "altitude [m]")
        view.press("Down", "Down", "Down", "C-u")
        view.type("4.5")
        view.press("Enter")
        view.wait("4.5", "NOT UPLOADED", without="altitude [m]")
        view.press("u")
        wait_for_messages(view, "mission of 6 items equal")
        view.press("3")
        view.wait("WAYPOINT", without="NOT UPLOADED")
        view.press("s")
        view.wait("Start the mission?")
        view.press("y")
        view.wait("MISSION", " ARMED ", "▶", "✓")
        view.press("p")
        view.wait(" HOLD ")
        wait_for_messages(view, "holding the position after")
        view.press("3", "s")
        view.wait("✓    4 WAYPOINT", "DISARMED")
        wait_for_messages(view, "mission resumed after")


def test_parameter_is_changed_marked_and_saved(flown: VehicleProcesses, tmp_path: Path) -> None:
    with watching(flown.link, tmp_path, "parameters") as view:
        view.wait("ATT_REF_ACC")
        view.press("/")
        view.type("MIS_TAKEOFF_ALT")
        view.wait("with “MIS_TAKEOFF_ALT”", "1 of")
        view.press("Enter", "Enter")
        view.wait("Enter accepts")
        view.press("C-u")
        view.type("6.5")
        view.press("Enter")
        view.wait("6.5", "1 not at the default", without="Enter accepts")
        view.press("w")
        view.wait("Save all parameters")
        view.press("C-u")
        view.type("tuned.params")
        view.press("Enter")
        wait_for_messages(view, "parameters saved to tuned.params")
    assert "MIS_TAKEOFF_ALT\t6.5" in (tmp_path / "tuned.params").read_text()


def test_plot_is_paused_and_read_at_the_cursor(flown: VehicleProcesses, tmp_path: Path) -> None:
    with watching(flown.link, tmp_path, "plot") as view:
        view.wait("ATTITUDE.roll", "0 s")
        view.press("Enter")
        view.wait("letters of the name")
        view.type("positionnedvz")
        view.wait("LOCAL_POSITION_NED.vz")
        view.press("Enter", "Escape")
        view.wait("LOCAL_POSITION_NED.vz", without="Escape closes")
        view.press("Space")
        view.wait("paused: the space bar continues")
        view.press("Left")
        paused = view.wait_until(CURSOR_S.search, "time of the cursor").splitlines()
        later = view.wait("ATTITUDE.roll", without=paused[0]).splitlines()
        assert later[2:20] == paused[2:20]  # the rows above the toasts
        view.press("S-Left")
        (cursor_s,) = CURSOR_S.findall("\n".join(paused))
        view.wait("ATTITUDE.roll", without=cursor_s)


def test_view_reports_the_loss_and_the_return_of_a_vehicle(tmp_path: Path) -> None:
    with vehicle(tmp_path, *OPTIONS, speed=1) as first:
        first.wait_until_healthy()
        with watching(first.link, tmp_path) as view:
            first.stack.send_signal(signal.SIGKILL)
            view.wait("VEHICLE LOST")
            first.simulator.kill()
            first.simulator.communicate()
            with vehicle(tmp_path, *OPTIONS, speed=1, instance=first.instance):
                view.wait("● ", "t 0:0", without="VEHICLE LOST")
                view.wait("A Arm")


def test_all_vehicles_take_one_order_while_the_window_shrinks(tmp_path: Path) -> None:
    free = UdpSocket("127.0.0.1")
    port = free.address[1]
    free.close()
    one, two = tmp_path / "one", tmp_path / "two"
    one.mkdir()
    two.mkdir()
    options = (*OPTIONS, "--gcs-port", port)
    with vehicle(one, *options, speed=1) as first, vehicle(two, *options, speed=1) as second:
        ids = first.instance + 1, second.instance + 1
        inherited = {
            "COLUMNS": "120",
            "LINES": "35",
        }  # from a shell: the view follows its terminal all the same
        with watching(f"udpin:127.0.0.1:{port}", tmp_path, **inherited) as view:
            view.wait("v Vehicles", "of 2")
            view.press("v")
            view.wait("all of them", f"{ids[0]}  quadrotor", f"{ids[1]}  quadrotor")
            view.press("End", "Enter")
            view.wait("COMMANDS TO ALL 2")
            view.press("A")
            view.wait("Arm: all 2 vehicles")
            view.resize(80, 24)
            view.press("y")
            view.wait("ARMED", "COMMANDS TO ALL 2", without="Arm: all")
            view.press("]")
            view.wait(" ARMED ", "of 2", without="COMMANDS TO ALL")
            view.press("v")
            view.wait("all of them", without="disarmed")
            view.press("End", "Enter")
            view.wait("COMMANDS TO ALL 2")
            view.press("D")
            view.wait("Disarm: all 2 vehicles")
            view.press("y")
            view.wait("DISARMED", without="Disarm: all 2 vehicles")
            view.resize(200, 50)
            view.wait("Last 2 minutes")
            wait_for_messages(view, f"{ids[0]}: disarmed after", f"{ids[1]}: disarmed after")
