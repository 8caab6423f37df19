"""The mission client with servers that behave as PX4 and ArduPilot do."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link, Message
from flightstack.mavlink.mission_messages import ack_message, item_from_message, message_from_item
from flightstack.plan import MissionItem, MissionResult, MissionType
from gcs_cli.clients.mission_client import Done, Failed, MissionClient
from gcs_cli.link import calls
from gcs_cli.link.session import Session
from tests.protocol.mission_harness import VEHICLE, mission
from tests.support.plan_items import HOME

OWN = Address(255, 190)
R = MissionResult


class Server:
    """Stores item by item and requests the next one; ``check`` returns the result for each item."""

    def __init__(self, check: Callable[[int, MissionItem], int] = lambda *_: R.ACCEPTED) -> None:
        self.items: list[MissionItem] = []
        self.heard: list[str] = []
        self.count = 0
        self.clears = True
        self._check = check

    def receive(self, message: Message) -> list[Message]:
        kind = message.get_type()
        self.heard.append(kind)
        answer = getattr(self, f"on_{kind.lower()}", None)
        return [] if answer is None else [answer(message)]

    def on_mission_count(self, message: Message) -> Message:
        self.items, self.count = [], message.count
        return self.request(0) if self.count else ack_message(OWN, R.ACCEPTED, message.mission_type)

    def on_mission_item_int(self, message: Message) -> Message:
        if message.seq != len(self.items):
            return ack_message(OWN, R.INVALID_SEQUENCE, 0)  # as ArduPilot, which continues
        item = item_from_message(message)
        result = self._check(message.seq, item)
        if result == R.ACCEPTED:
            self.items.append(item)
            if len(self.items) < self.count:
                return self.request(len(self.items))
        return ack_message(OWN, result, 0)

    def on_mission_request_list(self, _message: Message) -> Message:
        return mavlink.MAVLink_mission_count_message(*OWN, len(self.items), 0)

    def on_mission_request_int(self, message: Message) -> Message:
        return message_from_item(self.items[message.seq], message.seq, OWN, 0)

    def on_mission_clear_all(self, message: Message) -> Message:
        return ack_message(OWN, R.ACCEPTED if self.clears else R.ERROR, message.mission_type)

    def request(self, seq: int) -> Message:
        return mavlink.MAVLink_mission_request_message(*OWN, seq, 0)


def run(client: MissionClient, server: Server, *, twice: bool = False) -> object:
    """Exchange framed messages until the client has a result; with ``twice`` each of its messages arrives twice."""
    there, back = Link(*OWN), Link(*VEHICLE)
    now_s = 100.0
    while client.result is None:
        out = client.poll(now_s)
        answers = []
        for message in out:
            for received in list(back.decode(there.encode(message))) * (1 + twice):
                answers += server.receive(received)
        for answer in answers:
            for received in there.decode(back.encode(answer)):
                client.receive(received, now_s)
        now_s += 0.1
    return client.result


def test_home_is_item_0_of_an_upload_and_not_of_a_download() -> None:
    server, items = Server(), mission(4)
    client = MissionClient(VEHICLE, OWN, begins_with_home=True, home=HOME)
    client.start_upload(items)
    assert run(client, server) == Done(items)
    assert client.progress == (4, 4)
    assert server.items[0].position_deg == HOME[:2]
    assert len(server.items) == 5
    client.start_download()
    assert run(client, server) == Done(items)


def test_a_refused_item_has_its_number_in_the_plan() -> None:
    server = Server(lambda seq, _: R.UNSUPPORTED if seq == 3 else R.ACCEPTED)
    client = MissionClient(VEHICLE, OWN, begins_with_home=True, home=HOME)
    client.start_upload(mission(6))
    result = run(client, server)
    assert isinstance(result, Failed)
    assert (result.result, result.seq, result.is_whole) == (R.UNSUPPORTED, 2, False)


def test_an_item_out_of_order_does_not_end_an_upload() -> None:
    server, items = Server(), mission(5)
    client = MissionClient(VEHICLE, OWN)
    client.start_upload(items)
    assert run(client, server, twice=True) == Done(items)
    assert server.items == list(items)


def test_a_fence_that_is_not_cleared_is_replaced_by_no_items() -> None:
    server = Server()
    server.clears = False
    client = MissionClient(VEHICLE, OWN, MissionType.FENCE)
    client.start_clear()
    assert run(client, server) == Done()
    assert server.heard == ["MISSION_CLEAR_ALL", "MISSION_COUNT"]


@pytest.mark.parametrize(
    ("refused", "text", "reason"),
    [
        (1, "", "item 1 (NAV_WAYPOINT): the vehicle refused: the command is not supported (MAV_MISSION_UNSUPPORTED)"),
        (1, "no such thing", "item 1 (NAV_WAYPOINT): no such thing"),
        (1, "item 0 is bad", "item 0 is bad"),
        (2, "IGN MISSION_ITEM: Invalid item", "item 2 (NAV_WAYPOINT): IGN MISSION_ITEM: Invalid item"),  # PX4
        (3, "it leaves out home", "it leaves out home"),  # of the plan as a whole
        (3, "", "item 3 (NAV_WAYPOINT) or one before it: the vehicle refused: the command is not supported "
         "(MAV_MISSION_UNSUPPORTED)"),
    ],
)  # fmt: skip
def test_a_refusal_names_the_item(refused: int, text: str, reason: str) -> None:
    session, vehicle, peer = Session(("vehicle", 1)), Link(*VEHICLE), ("vehicle", 1)
    server = Server(lambda seq, _: R.UNSUPPORTED if seq == refused else R.ACCEPTED)
    session.receive(vehicle.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), peer, 100.0)
    call, now_s, answer = calls.upload(session, mission(4)), 100.0, None
    while answer is None:
        for frame in session.poll(now_s):
            for message in vehicle.decode(frame):
                for reply in server.receive(message):
                    session.receive(vehicle.encode(reply), peer, now_s)
                    if text and reply.get_type() == "MISSION_ACK":
                        said = mavlink.MAVLink_statustext_message(4, text.encode())
                        session.receive(vehicle.encode(said), peer, now_s)
        now_s += 0.1
        answer = call.answer(now_s)
    assert answer.reason == reason
