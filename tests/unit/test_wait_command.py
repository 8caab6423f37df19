"""``gcs wait complete`` of a vehicle that does not report the state of its mission, without I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from flightstack.mavlink.dialect import mavlink
from gcs_cli.actions.conditions import parse_condition
from gcs_cli.commands.wait import wait_for
from gcs_cli.errors import FAILED, NO_ANSWER, CliError, VehicleLostError
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output
from tests.support.folded_vehicle import HOLD_MODE, MISSION_MODE, RETURN_MODE, Vehicle, heartbeat

ARMED = 129


class ScriptedConnection:
    """Stands for a connection: each step folds the next messages of a script, and takes a second."""

    def __init__(self, steps: Iterator[list[Any]], refusal: CliError | None = None) -> None:
        self.steps, self.refusal = steps, refusal
        self.now_s, self.downloads = 0.0, 0
        self.vehicle = Vehicle()
        self.session = SimpleNamespace(view=self.vehicle.view)
        self.fold(heartbeat(mode=HOLD_MODE))

    def fold(self, *messages: Any) -> None:
        for message in messages:
            self.session.view = self.vehicle.send(message, self.now_s)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        end_s = self.now_s + timeout_s
        while not condition():
            messages = next(self.steps, None)
            if messages is None or self.now_s >= end_s:
                return False
            self.now_s += 1.0
            self.fold(*messages)
        return True

    def complete(self, _call: Any, _name: str) -> None:
        self.downloads += 1
        if self.refusal is not None:
            raise self.refusal
        mission_id = self.session.view.mission.mission_id
        command = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
        place = (1, 2, command, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
        self.fold(
            mavlink.MAVLink_mission_count_message(255, 190, 2, 0, mission_id),
            mavlink.MAVLink_mission_item_int_message(255, 190, *place),
        )


@pytest.fixture(autouse=True)
def _no_transfer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs_cli.link.calls.download", lambda _session: None)


def current(seq: int, mission_id: int = 7) -> Any:
    return mavlink.MAVLink_mission_current_message(seq, 2, 0, 0, mission_id)


def flight(mission_id: int = 7) -> Iterator[list[Any]]:
    """Yield the messages of a flight with two items, the last one a return."""
    yield [current(0, mission_id)]
    yield [heartbeat(ARMED, MISSION_MODE), current(0, mission_id)]
    yield [mavlink.MAVLink_mission_item_reached_message(0), current(1, mission_id)]
    yield [heartbeat(ARMED, RETURN_MODE)]
    yield [mavlink.MAVLink_extended_sys_state_message(0, 1), heartbeat(1, HOLD_MODE)]


def waited(connection: ScriptedConnection, timeout_s: float = 60.0) -> float:
    """Wait until the mission is complete, and return when it was."""
    wait_for(cast(Connection, connection), [parse_condition("complete")], timeout_s, Output(as_json=False))
    return connection.now_s


def test_wait_complete_ends_when_the_final_return_begins() -> None:
    connection = ScriptedConnection(flight())
    assert waited(connection) == 4.0
    assert connection.downloads == 1


def test_wait_complete_before_a_flight_waits_for_it() -> None:
    def steps() -> Iterator[list[Any]]:
        yield [current(1), mavlink.MAVLink_extended_sys_state_message(0, 1)]  # where the flight before ended
        yield from flight()

    assert waited(ScriptedConnection(steps())) == 5.0


def test_wait_complete_waits_for_the_second_flight_in_one_shell() -> None:
    def steps() -> Iterator[list[Any]]:
        yield from list(flight())[:-2]
        yield [mavlink.MAVLink_mission_item_reached_message(1)]

    connection = ScriptedConnection(steps())
    assert waited(connection) == 4.0
    connection.fold(heartbeat(1, HOLD_MODE), heartbeat(ARMED, MISSION_MODE), current(0))
    connection.steps = steps()
    assert waited(connection) == 8.0


def test_wait_complete_reads_a_mission_that_is_uploaded_meanwhile() -> None:
    def steps() -> Iterator[list[Any]]:
        yield [current(0)]
        yield from flight(mission_id=8)

    connection = ScriptedConnection(steps())
    assert waited(connection) == 5.0
    assert connection.downloads == 2


def test_wait_complete_goes_on_if_the_mission_cannot_be_read(capsys: pytest.CaptureFixture[str]) -> None:
    def steps() -> Iterator[list[Any]]:
        yield from list(flight())[:-2]
        yield [mavlink.MAVLink_mission_item_reached_message(1)]

    connection = ScriptedConnection(steps(), CliError("mission download refused: busy", FAILED))
    assert waited(connection) == 4.0
    assert connection.downloads == 1
    assert "gcs: wait complete: mission download refused: busy" in capsys.readouterr().err


def test_wait_complete_says_what_is_unknown_after_its_timeout() -> None:
    connection = ScriptedConnection(iter([[current(1)]] * 5))
    with pytest.raises(
        CliError, match=r"not within 3 s.*item 1 \(last 1\).*does not report the state"
    ) as caught:
        waited(connection, 3.0)
    assert caught.value.exit_code == NO_ANSWER


def test_wait_complete_fails_if_the_vehicle_is_lost_during_the_download() -> None:
    connection = ScriptedConnection(
        flight(), VehicleLostError("mission download: the vehicle was lost", FAILED)
    )
    with pytest.raises(VehicleLostError):
        waited(connection)
