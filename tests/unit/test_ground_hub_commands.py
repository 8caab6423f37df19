"""Commands over the hub that concern home and the stream of a log: what they change, and who is told."""

from __future__ import annotations

import math

import pytest

from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import mavlink
from flightstack.params.config import DEFAULT_HOME
from flightstack.services.logs.log_store import NoLogs
from tests.support.hub_net import ACCEPTED, ALICE, BOB, DENIED, NAN, REJECTED, UNSUPPORTED, Net, Station

SET_HOME, GET_HOME = mavlink.MAV_CMD_DO_SET_HOME, mavlink.MAV_CMD_GET_HOME_POSITION
START, STOP = mavlink.MAV_CMD_LOGGING_START, mavlink.MAV_CMD_LOGGING_STOP
HERE = 1.0


@pytest.fixture
def net() -> Net:
    return Net()


def ask_int(station: Station, number: int, frame: int, place: tuple[int, int], z: float) -> int:
    """Send a COMMAND_INT with a place; return the result of its acknowledgement."""
    zeros = (0.0, 0.0, 0.0, 0.0)
    station.send(mavlink.MAVLink_command_int_message(7, 1, frame, number, 0, 0, *zeros, *place, z))
    station.net.poll()
    (ack,) = station.take("COMMAND_ACK")
    return ack.result


def told_home(station: Station) -> tuple[int, int, int]:
    """The newest home that a station was told: 1e-7 degrees twice, millimetres above the sea."""
    told = station.take("HOME_POSITION")[-1]
    return told.latitude, told.longitude, told.altitude


# ---------------------------------------------------------------------- home


@pytest.mark.parametrize(
    ("frame", "z", "altitude_m"),
    [
        (mavlink.MAV_FRAME_GLOBAL, 500.0, 500.0),
        (mavlink.MAV_FRAME_GLOBAL_INT, 500.0, 500.0),
        (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, 12.0, 500.0),
        (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 12.0, 500.0),
    ],
)
def test_home_is_set_to_a_place_and_everybody_is_told_at_once(
    net: Net, frame: int, z: float, altitude_m: float
) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    net.poll()
    for station in (alice, bob):
        station.inbox.clear()
    place = (473_980_000, 85_460_000)
    assert ask_int(alice, SET_HOME, frame, place, z) == ACCEPTED
    for station in (alice, bob):
        assert told_home(station) == (*place, round(altitude_m * 1e3))
    assert net.stack.area.home == GeoPoint(47.398, 8.546, altitude_m)
    assert net.stack.places.frame.origin == DEFAULT_HOME
    assert net.stack.places.home_is_chosen


def test_home_is_set_to_where_the_vehicle_is(net: Net) -> None:
    alice = net.join(ALICE)
    net.stack.now.state[:3] = (30.0, -40.0, -2.0)
    assert alice.ask(SET_HOME, HERE) == ACCEPTED
    home = net.stack.places.home
    assert (home.north_m, home.east_m, home.altitude_m) == pytest.approx((30.0, -40.0, 2.0), abs=1e-6)
    assert not net.stack.places.home_is_chosen
    assert any(text.text == "Home set" for text in alice.take("STATUSTEXT"))


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        ((NAN, 8.5, 488.0), "no such position"),
        ((47.4, math.inf, 488.0), "no such position"),
        ((47.4, 8.5, NAN), "no such position"),
        ((91.0, 8.5, 488.0), "not a place on earth"),
        ((47.4, -181.0, 488.0), "not a place on earth"),
        ((48.5, 8.5, 488.0), "more than 100 km"),
        ((47.4, 8.5, 3e38), "more than 1000 m"),
    ],
)
def test_a_home_that_cannot_be_is_denied_and_the_old_one_stays(
    net: Net, place: tuple[float, float, float], reason: str
) -> None:
    alice = net.join(ALICE)
    assert alice.ask(SET_HOME, 0.0, 0.0, 0.0, 0.0, *place) == DENIED
    assert any(reason in text.text for text in alice.take("STATUSTEXT"))
    assert net.stack.area.home == DEFAULT_HOME


def test_the_present_place_needs_a_state(net: Net) -> None:
    alice = net.join(ALICE)
    net.stack.now.has_state = False
    assert alice.ask(SET_HOME, HERE) == REJECTED
    assert net.stack.area.home == DEFAULT_HOME


def test_home_comes_on_request_to_who_asks(net: Net) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    net.poll()
    for station in (alice, bob):
        station.inbox.clear()
    assert alice.ask(GET_HOME) == ACCEPTED
    assert told_home(alice) == (473_977_420, 85_455_940, 488_000)
    assert bob.take("HOME_POSITION") == []


# ---------------------------------------------------------------------- the stream of a log


class Tail:
    """A log of one definition and one piece of data."""

    def __init__(self) -> None:
        header = b"ULog\x01\x12\x35\x01" + bytes(8)
        self._left = header + b"\x03\x00Fa:b" + b"\x02\x00Dxy"
        self.closed = False

    def read(self, count: int) -> bytes:
        data, self._left = self._left[:count], self._left[count:]
        return data

    @property
    def ended(self) -> bool:
        return False

    def close(self) -> None:
        self.closed = True


class OneLog(NoLogs):
    """A log in progress."""

    def __init__(self, tail: Tail) -> None:
        self.open_tail = lambda: tail


def test_a_log_is_streamed_to_who_asked_until_told_to_stop() -> None:
    tail = Tail()
    net = Net(OneLog(tail))
    alice, bob = net.join(ALICE), net.join(BOB, system=251)
    assert alice.ask(START, 0.0) == ACCEPTED
    net.run(0.1)
    (piece,) = alice.take("LOGGING_DATA_ACKED")
    assert bytes(piece.data[: piece.length]).startswith(b"ULog\x01\x12\x35")
    assert (piece.target_system, piece.target_component) == (255, 190)
    assert bob.take("LOGGING_DATA_ACKED") == []
    assert bob.ask(START, 0.0) == REJECTED
    assert "another client" in "".join(chunk.text for chunk in bob.take("STATUSTEXT"))
    assert alice.ask(STOP) == ACCEPTED
    assert tail.closed
    net.run(1.0)
    assert alice.take("LOGGING_DATA_ACKED") == []
    assert bob.ask(START, 0.0) == ACCEPTED


@pytest.mark.parametrize("log_format", [1.0, -1.0, NAN, math.inf])
def test_a_log_has_no_other_format_than_ulog(net: Net, log_format: float) -> None:
    alice = net.join(ALICE)
    assert alice.ask(START, log_format) == UNSUPPORTED
    assert alice.ask(STOP) == ACCEPTED  # with nothing to stop
