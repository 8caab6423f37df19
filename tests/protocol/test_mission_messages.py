"""The mission server and client message by message: addressing, old clients, order, and nonsense."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import common

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link, Message
from flightstack.mavlink.mission_messages import mission_id
from flightstack.plan import Command, Frame, MissionItem, MissionResult, MissionType
from flightstack.plan import commands as words
from flightstack.services.commands.command_server import CommandServer
from flightstack.services.mission.mission_server import MissionServer
from gcs_cli.clients.mission_client import Done, Failed, MissionClient
from tests.protocol.mission_harness import CHECKS, NAN, VEHICLE, mission, waypoint

GCS = Address(255, 190)


def over_the_wire(message: Message, source: Address) -> Message:
    (decoded,) = Link(0, 0).decode(Link(*source).encode(message))
    return decoded


class Vehicle:
    """A mission server with one hand-driven client."""

    def __init__(self) -> None:
        self.server = MissionServer(VEHICLE, {MissionType.MISSION: CHECKS[MissionType.MISSION]})
        self.now_s = 0.0

    def tell(self, message: Message, source: Address = GCS, peer: str = "gcs") -> list[Message]:
        self.server.receive(over_the_wire(message, source), peer, self.now_s)
        return [over_the_wire(answer, VEHICLE) for _, answer in self.server.poll(self.now_s)]

    def wait(self, seconds: float) -> list[Message]:
        self.now_s += seconds
        return [over_the_wire(answer, VEHICLE) for _, answer in self.server.poll(self.now_s)]


def count(number: int, target: Address = VEHICLE, kind: int = 0) -> Message:
    return mavlink.MAVLink_mission_count_message(*target, number, kind)


def item_int(seq: int, x: int = 473977420, target: Address = VEHICLE) -> Message:
    return mavlink.MAVLink_mission_item_int_message(
        *target, seq, 6, 16, 0, 1, 0.0, 0.5, 0.0, NAN, x, 85455940, 5.0, 0
    )


def item_float(seq: int, latitude: float = 47.397742, frame: int = 3) -> Message:
    return mavlink.MAVLink_mission_item_message(
        *VEHICLE, seq, frame, 16, 0, 1, 0.0, 0.5, 0.0, NAN, latitude, 8.545594, 5.0, 0
    )


def names(messages: list[Message]) -> list[str]:
    return [message.get_type() for message in messages]


def test_numbers_of_items_are_mavlinks() -> None:
    for enum, prefix in (
        (words.Command, "MAV_CMD_"),
        (words.Frame, "MAV_FRAME_"),
        (words.MissionType, "MAV_MISSION_TYPE_"),
    ):
        for member in enum:
            assert getattr(common, prefix + member.name) == member
    for result in words.MissionResult:
        assert common.enums["MAV_MISSION_RESULT"][result].name == words.result_name(result)


def test_messages_for_others_are_ignored_and_broadcasts_taken() -> None:
    vehicle = Vehicle()
    for target in (Address(2, 1), Address(1, 100)):
        assert vehicle.tell(count(1, target)) == []
    for target in (Address(0, 0), Address(1, 0), Address(1, 1)):
        assert names(vehicle.tell(count(1, target))) == ["MISSION_REQUEST_INT"]


def test_an_old_client_that_knows_only_the_float_messages() -> None:
    vehicle = Vehicle()
    assert names(vehicle.tell(count(2))) == ["MISSION_REQUEST_INT"]
    asked = [name for _ in range(3) for name in names(vehicle.wait(0.25))]
    assert asked == ["MISSION_REQUEST_INT", "MISSION_REQUEST_INT", "MISSION_REQUEST"]
    assert names(vehicle.tell(item_float(0))) == ["MISSION_REQUEST"]  # from now on it is asked as it likes
    (ack,) = vehicle.tell(item_float(1))
    assert ack.type == MissionResult.ACCEPTED
    first = vehicle.server.items()[0]
    assert first.frame == Frame.GLOBAL_RELATIVE_ALT
    assert abs(first.x - 473977420) < 20  # a 32-bit float of 47 degrees: measured 8e-7 degrees off
    assert math.isnan(first.param4)
    (answer,) = vehicle.tell(mavlink.MAVLink_mission_request_message(*VEHICLE, 0, 0))
    assert answer.get_type() == "MISSION_ITEM"
    assert answer.x == item_float_as_sent(47.397742)


def item_float_as_sent(latitude: float) -> float:
    return float(over_the_wire(item_float(0, latitude), GCS).x)


def test_a_client_that_refuses_one_kind_of_request_is_asked_in_the_other() -> None:
    vehicle = Vehicle()
    vehicle.tell(count(1))
    unsupported = mavlink.MAVLink_mission_ack_message(*VEHICLE, MissionResult.UNSUPPORTED, 0)
    assert names(vehicle.tell(unsupported)) == ["MISSION_REQUEST"]
    assert vehicle.tell(unsupported) == []  # it knows neither: the upload is off
    assert vehicle.server.next_deadline() is None


def test_items_out_of_order_are_dropped_and_asked_for_again_once() -> None:
    vehicle = Vehicle()
    vehicle.tell(count(4))
    (request,) = vehicle.tell(item_int(0))
    assert request.seq == 1
    assert vehicle.tell(item_int(0)) == []  # a copy: asking again would breed copies
    (request,) = vehicle.tell(item_int(3))  # item 1 was lost
    assert request.seq == 1
    assert vehicle.tell(item_int(2)) == []
    (request,) = vehicle.tell(item_int(1))
    assert request.seq == 2


def test_the_last_item_again_is_acknowledged_again() -> None:
    vehicle = Vehicle()
    vehicle.tell(count(1))
    for _ in range(3):
        (ack,) = vehicle.tell(item_int(0))
        assert ack.type == MissionResult.ACCEPTED
    assert len(vehicle.server.events()) == 1


def test_a_new_count_of_the_same_client_starts_over() -> None:
    vehicle = Vehicle()
    vehicle.tell(count(2))
    vehicle.tell(item_int(0, x=470000000))
    (request,) = vehicle.tell(count(2))
    assert request.seq == 0
    vehicle.tell(item_int(0))
    vehicle.tell(item_int(1))
    assert [item.x for item in vehicle.server.items()] == [473977420, 473977420]


def test_a_cancelled_upload_ends_without_a_word() -> None:
    vehicle = Vehicle()
    vehicle.tell(count(3))
    vehicle.tell(item_int(0))
    cancel = mavlink.MAVLink_mission_ack_message(*VEHICLE, MissionResult.OPERATION_CANCELLED, 0)
    other = Address(254, 190)
    assert vehicle.tell(cancel, other) == []
    assert vehicle.server.next_deadline() is not None  # someone else's cancel is not ours
    assert vehicle.tell(cancel) == []
    assert vehicle.server.next_deadline() is None
    assert vehicle.tell(item_int(1)) == []


def test_a_request_beyond_the_mission_and_unknown_types_are_answered() -> None:
    vehicle = Vehicle()
    (ack,) = vehicle.tell(mavlink.MAVLink_mission_request_int_message(*VEHICLE, 5, 0))
    assert ack.type == MissionResult.INVALID_SEQUENCE
    for kind in (1, 2, 77):
        (ack,) = vehicle.tell(count(1, kind=kind))
        assert (ack.type, ack.mission_type) == (MissionResult.UNSUPPORTED, kind)
        (ack,) = vehicle.tell(mavlink.MAVLink_mission_clear_all_message(*VEHICLE, kind))
        assert ack.type == MissionResult.UNSUPPORTED
    (ack,) = vehicle.tell(mavlink.MAVLink_mission_clear_all_message(*VEHICLE, MissionType.ALL))
    assert (ack.type, ack.mission_type) == (MissionResult.ACCEPTED, MissionType.ALL)


def test_acknowledgements_go_to_the_sender() -> None:
    vehicle = Vehicle()
    (ack,) = vehicle.tell(mavlink.MAVLink_mission_clear_all_message(*VEHICLE, 0), Address(42, 7))
    assert (ack.target_system, ack.target_component) == (42, 7)


def test_absurd_floats_are_refused_with_their_parameter() -> None:
    for latitude in (NAN, math.inf, -math.inf, 1e30, 91.0):
        vehicle = Vehicle()
        vehicle.tell(count(1))
        (ack,) = vehicle.tell(item_float(0, latitude))
        assert ack.type == MissionResult.INVALID_PARAM5_X
        assert vehicle.server.items() == ()


def test_the_client_answers_requests_in_any_order_and_as_often_as_asked() -> None:
    client = MissionClient(VEHICLE, GCS)
    items = mission(5)
    client.start_upload(items)
    client.poll(0.0)
    sent: list[tuple[str, int]] = []
    for seq in (0, 3, 1, 1, 4, 2, 0, 4):
        kind = (
            mavlink.MAVLink_mission_request_message
            if seq % 2
            else mavlink.MAVLink_mission_request_int_message
        )
        client.receive(over_the_wire(kind(*GCS, seq, 0), VEHICLE), 0.1)
        sent += [(message.get_type(), message.seq) for message in client.poll(0.1)]
    assert sent == [("MISSION_ITEM_INT", seq) for seq in (0, 3, 1, 1, 4, 2, 0, 4)]
    client.receive(over_the_wire(mavlink.MAVLink_mission_ack_message(*GCS, 0, 0), VEHICLE), 0.2)
    assert client.result == Done(items)


def test_an_upload_waits_until_the_vehicle_has_given_up_the_one_before() -> None:
    """Were the vehicle, still at the first of 20 items, served the new mission's, it would end at 20."""
    client = MissionClient(VEHICLE, GCS)
    client.start_upload(mission(20))
    assert names(client.poll(0.0)) == ["MISSION_COUNT"]
    client.start_upload(mission(33))
    assert names(client.poll(0.1)) == ["MISSION_ACK"]
    request = over_the_wire(mavlink.MAVLink_mission_request_int_message(*GCS, 0, 0), VEHICLE)
    client.receive(request, 0.3)
    (answer,) = client.poll(0.3)
    assert (answer.get_type(), answer.type) == ("MISSION_ACK", MissionResult.OPERATION_CANCELLED)
    assert client.next_deadline() == 0.3 + 5.5
    (announcement,) = client.poll(5.8)
    assert (announcement.get_type(), announcement.count) == ("MISSION_COUNT", 33)
    client.receive(request, 5.9)
    assert names(client.poll(5.9)) == ["MISSION_ITEM_INT"]


def test_a_request_left_over_from_another_upload_is_answered_with_the_count() -> None:
    client = MissionClient(VEHICLE, GCS)
    client.start_upload(mission(9))
    client.poll(0.0)
    stale = mavlink.MAVLink_mission_request_int_message(*GCS, 4, 0)
    client.receive(over_the_wire(stale, VEHICLE), 0.1)
    assert names(client.poll(0.1)) == ["MISSION_COUNT"]


def test_the_client_ignores_other_vehicles_other_targets_and_other_types() -> None:
    client = MissionClient(VEHICLE, GCS)
    client.start_clear()
    client.poll(0.0)
    ack = mavlink.MAVLink_mission_ack_message
    client.receive(over_the_wire(ack(*GCS, 0, 0), Address(2, 1)), 0.1)
    client.receive(over_the_wire(ack(1, 1, 0, 0), VEHICLE), 0.1)
    client.receive(over_the_wire(ack(*GCS, 0, 1), VEHICLE), 0.1)
    assert client.result is None
    client.receive(over_the_wire(ack(*GCS, 99, 0), VEHICLE), 0.1)
    assert client.result == Failed("the vehicle refused: MAV_MISSION_RESULT 99", 99)


def test_the_mission_id_tells_contents_apart() -> None:
    base = [waypoint()]
    variants = [
        base,
        [waypoint(), waypoint()],
        [waypoint(north_e7=1)],
        [waypoint(altitude_m=5.5)],
        [MissionItem(Command.NAV_LAND, 6)],
        [],
    ]
    assert len({mission_id(variant) for variant in variants}) == len(variants)
    assert mission_id([]) == 0


def storm(seed: int, length: int) -> Iterator[Message]:
    """Messages of the mission and command protocols with random fields, sensible and not."""
    chance = random.Random(seed)
    floats = (0.0, 1.0, -1.0, NAN, math.inf, -math.inf, 3e38, 47.4, 255.0)
    kinds = [
        getattr(mavlink, f"MAVLink_{name}_message")
        for name in (
            "mission_count", "mission_item", "mission_item_int", "mission_request", "mission_request_int",
            "mission_request_list", "mission_ack", "mission_clear_all", "mission_set_current",
            "mission_current",
            "command_long", "command_int", "command_ack", "heartbeat",
        )
    ]  # fmt: skip
    for _ in range(length):
        kind = chance.choice(kinds)
        values: dict[str, Any] = {}
        for name, type_name in zip(kind.fieldnames, kind.fieldtypes, strict=True):
            if type_name == "float":
                values[name] = chance.choice(floats)
            elif type_name == "int32_t":
                values[name] = chance.choice((0, 1, -1, 2**31 - 1, -(2**31), 473977420))
            else:
                high = {"uint8_t": 255, "uint16_t": 65535}.get(type_name, 2**32 - 1)
                values[name] = chance.choice((0, 0, 1, 1, 1, 2, 3, 16, 22, 255, high))
        yield kind(**values)


def upload_three(client: MissionClient) -> None:
    client.start_upload(mission(3))


def test_no_storm_of_messages_raises() -> None:
    for seed in range(40):
        server = MissionServer(VEHICLE, CHECKS)
        commands = CommandServer(VEHICLE, range(400))
        client = MissionClient(VEHICLE, GCS)
        chance = random.Random(seed)
        link = Link(*VEHICLE)
        now_s = 0.0
        for message in storm(seed, 300):
            if client.result is not None or chance.random() < 0.02:
                chance.choice((upload_three, MissionClient.start_download, MissionClient.start_clear))(client)
            now_s += chance.choice((0.0, 0.01, 0.3))
            server.receive(over_the_wire(message, GCS), chance.choice("ab"), now_s)
            client.receive(over_the_wire(message, VEHICLE), now_s)
            command = commands.receive(over_the_wire(message, GCS), "a", now_s)
            if command is not None:
                commands.answer(command, 0)
            for _, answer in (*server.poll(now_s), *commands.poll(now_s)):
                link.encode(answer)
            for request in client.poll(now_s):
                link.encode(request)
            server.events()
