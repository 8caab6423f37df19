"""The whole vehicle with signed links, and parameters over them: raw pymavlink is the ground station."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import common

from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.signing import NO_KEY, Signing, timestamp_of
from flightstack.services.routing.hub import MAX_PEERS
from flightstack.services.routing.peer import PeerAddress
from tests.support.truth import World

KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))
HERE, ELSEWHERE = "127.0.0.1", "192.0.2.7"
NOW_S = 1.75e9
STARTS_S = itertools.count(0.0, 1000.0)
REQUEST_LIST = common.MAVLink_param_request_list_message(1, 1)


class Station:
    """A ground station at ``host``; it signs if it has a key."""

    def __init__(
        self, vehicle: SignedVehicle, key: bytes | None, host: str = HERE, system: int = 255
    ) -> None:
        self.hub, self.address = vehicle.world.engine.stack.ground, PeerAddress(GROUND, host, 5000 + system)
        self.codec = common.MAVLink(None, system, 190)
        self.codec.robust_parsing = True
        self.now_s = vehicle.began_s
        if key is not None:
            self.codec.signing.secret_key, self.codec.signing.sign_outgoing = key, True
            self.codec.signing.timestamp = timestamp_of(NOW_S)

    def frame(self, message: Any) -> bytes:
        self.codec.seq = (self.codec.seq + 1) % 256
        return bytes(message.pack(self.codec))

    def ask(self, *messages: Any) -> list[Any]:
        """Send messages and return what comes back to this station within a second."""
        return self.send(*(self.frame(message) for message in messages))

    def send(self, *frames: bytes) -> list[Any]:
        for frame in frames:
            self.hub.receive(self.address, frame, self.now_s)
        answers: list[Any] = []
        for _ in range(100):
            self.now_s += 0.01
            for address, data in list(self.hub.poll(self.now_s)):
                if address == self.address:
                    answers += self.codec.parse_buffer(bytearray(data)) or ()
        return answers


def of_type(messages: list[Any], kind: str) -> list[Any]:
    return [message for message in messages if message.get_type() == kind]


class SignedVehicle(NamedTuple):
    world: World
    signing: Signing
    stored: list[bytes]
    """Keys that were kept for the next start."""
    heard_before_s: float
    began_s: float
    """Start of the test on the clock of the links, which never goes back."""


@pytest.fixture(scope="module")
def shared() -> World:
    return World()


@pytest.fixture
def vehicle(shared: World) -> SignedVehicle:
    """The vehicle on the ground, with a key and no peers."""
    for address, _ in shared.engine.stack.ground.addresses():
        shared.engine.stack.ground.drop_peer(address)
    heard_s = shared.engine.stack.ground.last_heard_s
    signed = SignedVehicle(shared, Signing(KEY, lambda: NOW_S), [], heard_s, next(STARTS_S))
    shared.engine.stack.ground.use_signing(signed.signing, signed.stored.append)
    return signed


def test_the_parameter_list_comes_signed_to_who_signs(vehicle: SignedVehicle) -> None:
    values = of_type(Station(vehicle, KEY).ask(REQUEST_LIST), "PARAM_VALUE")
    store = vehicle.world.engine.stack.params
    assert [value.param_id for value in values] == ["_HASH_CHECK", *store.specs]
    assert all(value.get_signed() for value in values)
    assert {value.get_link_id() for value in values} == {0}


@pytest.mark.parametrize("key", [None, OTHER_KEY])
def test_who_does_not_sign_with_the_key_is_not_heard(vehicle: SignedVehicle, key: bytes | None) -> None:
    station = Station(vehicle, key)
    assert station.ask(REQUEST_LIST) == []
    set_frame = station.frame(common.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 9.0, 9))
    station.send(set_frame)
    assert vehicle.world.engine.stack.params.value("MIS_TAKEOFF_ALT") != 9.0


RADIO_STATUS = common.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)


def test_an_unsigned_radio_status_admits_no_peer(vehicle: SignedVehicle) -> None:
    radio = Station(vehicle, None, ELSEWHERE, system=51)
    assert radio.ask(RADIO_STATUS) == []
    assert vehicle.world.engine.stack.ground.addresses() == []
    assert vehicle.world.engine.stack.ground.last_heard_s == vehicle.heard_before_s


def test_an_unsigned_radio_status_does_not_keep_a_peer_alive(vehicle: SignedVehicle) -> None:
    """It may come from anywhere with the address of a peer, which would be streamed to for ever."""
    station = Station(vehicle, KEY)
    station.ask(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    radio = Station(vehicle, None, system=51)
    radio.address = station.address
    for _ in range(8):
        station.send(radio.frame(RADIO_STATUS))
    answers = station.send(radio.frame(RADIO_STATUS))
    assert {message.get_type() for message in answers} == {"HEARTBEAT"}


def test_an_unsigned_radio_status_teaches_no_route(vehicle: SignedVehicle) -> None:
    station, other = Station(vehicle, KEY), Station(vehicle, KEY, system=77)
    other.ask(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    station.ask(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    radio = Station(vehicle, None, system=51)
    other.send(radio.frame(RADIO_STATUS))
    command = station.frame(common.MAVLink_param_request_list_message(51, 0))
    station.hub.receive(station.address, command, station.now_s)
    assert command not in [data for _, data in station.hub.poll(station.now_s)]


def test_unsigned_strangers_take_no_peer_slot(vehicle: SignedVehicle) -> None:
    for system in range(1, MAX_PEERS + 10):
        station = Station(vehicle, None, ELSEWHERE, system=system)
        station.send(station.frame(RADIO_STATUS), station.frame(REQUEST_LIST))
    assert vehicle.world.engine.stack.ground.addresses() == []
    assert of_type(Station(vehicle, KEY).ask(REQUEST_LIST), "PARAM_VALUE") != []


def test_a_replay_from_another_address_takes_no_peer_slot(vehicle: SignedVehicle) -> None:
    station = Station(vehicle, KEY)
    frame = station.frame(REQUEST_LIST)
    station.send(frame)
    Station(vehicle, KEY, ELSEWHERE, system=77).send(frame)
    assert [address for address, _ in vehicle.world.engine.stack.ground.addresses()] == [station.address]


def test_where_unsigned_is_allowed_it_admits_a_peer(vehicle: SignedVehicle) -> None:
    vehicle.signing.allow_unsigned = True
    assert of_type(Station(vehicle, None).ask(REQUEST_LIST), "PARAM_VALUE") != []


def test_a_heard_command_cannot_be_sent_again_from_another_port(vehicle: SignedVehicle) -> None:
    station = Station(vehicle, KEY)
    first, second = (
        station.frame(common.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", value, 9))
        for value in (9.0, 8.0)
    )
    station.send(first, second)
    Station(vehicle, KEY, system=77).send(first)  # another address: another link
    assert vehicle.world.engine.stack.params.value("MIS_TAKEOFF_ALT") == 8.0
    vehicle.world.engine.stack.params.reset()


def test_a_key_from_this_machine_is_taken_and_kept(vehicle: SignedVehicle) -> None:
    station = Station(vehicle, KEY)
    message = common.MAVLink_setup_signing_message(1, 1, list(OTHER_KEY), timestamp_of(NOW_S))
    station.codec.signing.allow_unsigned_callback = lambda *_: True  # it has yet to take the new key itself
    texts = [text.text for text in of_type(station.ask(message), "STATUSTEXT")]
    assert texts == ["Signing is on: a new key is in use"]
    assert vehicle.stored == [OTHER_KEY]
    assert of_type(Station(vehicle, KEY, system=78).ask(REQUEST_LIST), "PARAM_VALUE") == []
    assert of_type(Station(vehicle, OTHER_KEY, system=79).ask(REQUEST_LIST), "PARAM_VALUE") != []


def test_a_key_from_a_network_is_refused(vehicle: SignedVehicle) -> None:
    message = common.MAVLink_setup_signing_message(1, 1, list(NO_KEY), 0)
    texts = [text.text for text in of_type(Station(vehicle, KEY, ELSEWHERE).ask(message), "STATUSTEXT")]
    assert texts == ["Signing key refused: the link is not local"]
    assert vehicle.signing.is_on


def test_a_router_on_this_machine_brings_no_key(vehicle: SignedVehicle) -> None:
    """Where unsigned messages are taken, a new key still needs the old one."""
    vehicle.signing.allow_unsigned = True
    message = common.MAVLink_setup_signing_message(1, 1, list(NO_KEY), 0)
    answers = of_type(Station(vehicle, None).ask(message), "STATUSTEXT")
    assert "".join(text.text for text in answers) == (
        "Signing key refused: the message is not signed with the present key"
    )
    assert vehicle.signing.is_on
    assert vehicle.stored == []


def test_a_vehicle_without_a_key_file_says_that_it_takes_none() -> None:
    world = World()
    world.gcs.send(common.MAVLink_setup_signing_message(1, 1, list(KEY), 0))
    world.run_for(0.1)
    assert world.texts == ["Signing key refused: flightstack was started without --signing-key"]


def test_a_key_for_another_vehicle_is_not_passed_on(vehicle: SignedVehicle) -> None:
    other = Station(vehicle, KEY, system=2)
    other.ask(common.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
    station = Station(vehicle, KEY)
    frames: list[bytes] = []
    for message in (
        common.MAVLink_setup_signing_message(2, 190, list(OTHER_KEY), 0),
        common.MAVLink_param_request_list_message(2, 190),
    ):
        station.hub.receive(station.address, station.frame(message), 3.0)
        frames += [bytes(data) for address, data in station.hub.poll(3.0) if address == other.address]
    numbers = [int.from_bytes(frame[7:10], "little") for frame in frames]
    assert REQUEST_LIST.id in numbers
    assert common.MAVLINK_MSG_ID_SETUP_SIGNING not in numbers


def test_a_refused_parameter_is_explained_in_a_text(vehicle: SignedVehicle) -> None:
    answers = Station(vehicle, KEY).ask(common.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 1e9, 9))
    assert [error.error for error in of_type(answers, "PARAM_ERROR")] == [2]
    said = "".join(text.text for text in of_type(answers, "STATUSTEXT"))
    assert said == "Parameter MIS_TAKEOFF_ALT refused: 1000000000 is outside 0.2 to 100 m"


def test_all_parameters_are_reset_by_command_but_not_while_armed(vehicle: SignedVehicle) -> None:
    assert vehicle.world.engine.stack.params.set("MIS_TAKEOFF_ALT", 9.0) is None
    reset = common.MAVLink_command_long_message(1, 1, 245, 0, 2.0, 0, 0, 0, 0, 0, 0)
    status = vehicle.world.engine.stack.now.status
    vehicle.world.engine.stack.now.status = status._replace(armed=True)
    try:
        station = Station(vehicle, KEY)
        assert [ack.result for ack in of_type(station.ask(reset), "COMMAND_ACK")] == [2]  # DENIED
        assert vehicle.world.engine.stack.params.value("MIS_TAKEOFF_ALT") == 9.0
    finally:
        vehicle.world.engine.stack.now.status = status
    assert [ack.result for ack in of_type(station.ask(reset), "COMMAND_ACK")] == [0]
    assert vehicle.world.engine.stack.params.is_default("MIS_TAKEOFF_ALT")
