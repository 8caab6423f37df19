"""``gcs`` actions, ``gcs mode`` and ``gcs wait`` over UDP, against scripted vehicles."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from flightstack.mavlink.link import Message
from flightstack.transports.udp import UdpSocket
from gcs_cli.actions.run import ActionRun
from tests.support.commands import Ended, gcs
from tests.support.fake_arducopter import FakeArduCopter
from tests.support.fake_vehicle import ARM, LAND_NOW, FakeVehicle, serve

SPEED = 10.0
"""Speed of ArduCopter's clock in these tests."""


def told(vehicle: FakeVehicle, *arguments: object) -> Ended:
    """Run ``gcs`` with the link to ``vehicle``."""
    with serve(vehicle) as socket:
        return gcs("--connect", f"udpout:127.0.0.1:{socket.address[1]}", *arguments)


@contextmanager
def arducopter(vehicle: FakeArduCopter) -> Iterator[str]:
    """Run ArduCopter on a free port in a thread, ten times as fast as real time; yield its address."""
    socket, stopped = UdpSocket("127.0.0.1"), threading.Event()

    def run() -> None:
        begun_s, peer = time.monotonic(), None
        while not stopped.is_set():
            socket.wait(0.01)
            for data, sender in socket.receive():
                peer = sender
                vehicle.receive(data)
            for frame in vehicle.advance((time.monotonic() - begun_s) * SPEED):
                if peer is not None:
                    socket.send(frame, peer)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield f"udpout:127.0.0.1:{socket.address[1]}"
    finally:
        stopped.set()
        thread.join()
        socket.close()


def test_arducopter_is_flown_from_the_command_line() -> None:
    vehicle = FakeArduCopter()
    with arducopter(vehicle) as link:
        ready = gcs("--connect", link, "wait", "ready", "--timeout", "20")
        took_off = gcs("--connect", link, "takeoff", "--alt", "6")
        held = gcs("--connect", link, "hold")
        high = gcs("--connect", link, "wait", "altitude>5", "in-air", "mode=BRAKE")
        landed = gcs("--connect", link, "land", "--json")
    assert [step.returncode for step in (ready, took_off, held, high, landed)] == [0] * 5
    assert took_off.stdout.startswith("taking off to 6 m\nat 6 m after ")
    assert held.stdout == "holding the position\n"
    states = [json.loads(line)["state"] for line in landed.stdout.splitlines()]
    assert states == ["acknowledged", "done"]
    assert not vehicle.armed


def test_logs_of_an_armed_arducopter_are_refused_at_once() -> None:
    with arducopter(FakeArduCopter(armed=True)) as link:
        ended = gcs("--connect", link, "log", "list")
    assert ended.returncode == 1
    assert ended.stderr == (
        "gcs: log list refused: ArduPilot sends no logs while it is armed: disarm it first\n"
    )


def test_a_refusal_is_an_object_in_json_and_a_sentence_on_stderr() -> None:
    result = told(FakeVehicle(refusals={ARM: "Command refused: no valid position yet"}), "arm", "--json")
    facts = json.loads(result.stdout)
    assert (facts["event"], facts["exit_code"]) == ("error", 1)
    assert result[1:] == ("gcs: arming refused: no valid position yet\n", 1)


def test_land_ends_when_the_vehicle_has_disarmed() -> None:
    vehicle = FakeVehicle()
    vehicle.armed = True
    result = told(vehicle, "land")
    assert result.returncode == 0
    assert result.stdout.startswith("landing\nlanded and disarmed after ")
    assert vehicle.commands[-1][0] == LAND_NOW


def test_an_interrupted_action_says_that_the_vehicle_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    poll = ActionRun.poll

    def interrupt(run: ActionRun, now_s: float) -> list[Message]:
        messages = poll(run, now_s)
        if run.acknowledged:
            raise KeyboardInterrupt
        return messages

    vehicle = FakeVehicle()
    vehicle.armed = True
    monkeypatch.setattr(ActionRun, "poll", interrupt)
    result = told(vehicle, "land")
    assert (result.stderr, result.returncode) == (
        "gcs: interrupted while landing: the vehicle continues\n",
        130,
    )


@pytest.mark.parametrize("arguments", [["terminate"], ["disarm", "--force"]])
def test_dangerous_actions_need_yes_without_a_terminal(arguments: list[str]) -> None:
    vehicle = FakeVehicle()
    vehicle.armed = True
    result = told(vehicle, *arguments)
    assert (result.returncode, vehicle.commands) == (2, [])
    assert result.stderr.endswith("add --yes\n")


def test_mode_without_a_name_lists_the_modes_of_the_table_if_the_vehicle_lists_none() -> None:
    lines = [json.loads(line) for line in told(FakeVehicle(), "mode", "--json").stdout.splitlines()]
    modes = {facts["mode"]: facts for facts in lines}
    assert modes["HOLD"]["current"]
    assert not modes["HOLD"]["listed_by_vehicle"]
    assert "TERMINATION" not in modes


def test_wait_ends_at_once_if_the_condition_holds() -> None:
    result = told(FakeVehicle(), "wait", "disarmed", "altitude>2")
    assert (result.stdout, result.returncode) == ("disarmed, altitude>2\n", 0)


def test_a_mode_to_wait_for_must_exist() -> None:
    result = told(FakeVehicle(), "wait", "mode=nix")
    assert result.returncode == 2
    assert "wait mode=nix: the vehicle has no such mode; choose one of" in result.stderr


def test_wait_names_the_last_value_after_its_timeout() -> None:
    result = told(FakeVehicle(), "wait", "armed", "altitude>9", "--timeout", "1.5")
    assert result.returncode == 3
    assert result.stderr == "gcs: wait: not within 1.5 s: armed: disarmed; altitude>9: 3 m\n"


def test_wait_ends_when_the_vehicle_shuts_down() -> None:
    vehicle = FakeVehicle()
    vehicle.powered_off = True
    result = told(vehicle, "wait", "armed")
    assert (result.stderr, result.returncode) == ("gcs: wait armed: the vehicle shut down\n", 1)


def test_wait_for_a_condition_that_is_not_understood_is_wrong_usage() -> None:
    result = gcs("wait", "flying")
    assert result.returncode == 2
    assert "flying: not a condition; give armed, disarmed" in result.stderr
