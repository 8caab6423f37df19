"""Mission, geofence and rally points side by side: three stores that never mix, and the ids of what they hold."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link, Message
from flightstack.mavlink.mission_messages import message_from_item, mission_id
from flightstack.plan import MissionItem, MissionResult, MissionType
from flightstack.services.mission.mission_server import MissionServer
from flightstack.services.mission.mission_store import CurrentRequested, MissionCleared, MissionRefused
from gcs_cli.clients.mission_client import Done, Failed, MissionClient
from tests.protocol.mission_harness import CHECKS, VEHICLE, GroundStation, World, mission
from tests.support.plan_items import circle, polygon, rally_point, square

KINDS = (MissionType.MISSION, MissionType.FENCE, MissionType.RALLY)
PLANS = {
    MissionType.MISSION: mission(5, mark=1),
    MissionType.FENCE: (*polygon(square(80.0)), circle((20.0, 0.0), 5.0, inclusion=False)),
    MissionType.RALLY: (rally_point((10.0, 10.0), 2.0), rally_point((-10.0, 5.0))),
}
GCS, OTHER = Address(255, 190), Address(254, 190)


def world() -> World:
    return World(GroundStation("gcs", mission_types=KINDS), GroundStation("other", system=254), stored=KINDS)


def upload_all(w: World) -> None:
    for kind, items in PLANS.items():
        w.stations["gcs"].clients[kind].start_upload(items)
    w.run()


def test_uploads_of_all_types_at_once_do_not_mix() -> None:
    w = world()
    upload_all(w)
    for kind, items in PLANS.items():
        client = w.stations["gcs"].clients[kind]
        assert client.result == Done(items)
        assert w.server.items(kind) == tuple(item.on_wire() for item in items)
        assert client.plan_id == w.server.plan_id(kind) == mission_id(items) != 0


def test_a_download_tells_the_id_of_what_it_brings() -> None:
    w = world()
    upload_all(w)
    for kind in KINDS:
        client = w.stations["gcs"].clients[kind]
        client.start_download()
        w.run()
        assert isinstance(client.result, Done)
        assert client.result.items == w.server.items(kind)
        assert client.plan_id == w.server.plan_id(kind)


def test_every_change_changes_the_id_and_the_same_plan_has_it_again() -> None:
    w = world()
    upload_all(w)
    before = w.server.plan_id(MissionType.MISSION)
    w.upload("gcs", mission(5, mark=2))
    assert w.server.plan_id(MissionType.MISSION) not in (0, before)
    w.upload("gcs", PLANS[MissionType.MISSION])
    assert w.server.plan_id(MissionType.MISSION) == before
    w.upload("gcs", ())
    assert w.server.plan_id(MissionType.MISSION) == w.stations["gcs"].client.plan_id == 0


def test_clearing_one_type_leaves_the_others_and_all_clears_all() -> None:
    w = world()
    upload_all(w)
    w.events.clear()
    w.stations["gcs"].clients[MissionType.FENCE].start_clear()
    w.run()
    assert w.events == [MissionCleared(MissionType.FENCE)]
    assert [bool(w.server.items(kind)) for kind in KINDS] == [True, False, True]
    everything = MissionClient(VEHICLE, OTHER, MissionType.ALL)
    w.stations["other"].clients[MissionType.ALL] = everything
    everything.start_clear()
    w.run()
    assert everything.result == Done()
    assert [w.server.items(kind) for kind in KINDS] == [()] * 3
    assert w.events[1:] == [MissionCleared(kind) for kind in KINDS]


def test_clearing_all_is_denied_while_another_uploads_one_type() -> None:
    w = world()
    upload_all(w)
    fence = w.stations["gcs"].clients[MissionType.FENCE]
    fence.start_upload(PLANS[MissionType.FENCE])
    w.run(until=lambda: fence.progress[0] == 2)
    everything = MissionClient(VEHICLE, OTHER, MissionType.ALL)
    w.stations["other"].clients[MissionType.ALL] = everything
    everything.start_clear()
    w.run()
    assert isinstance(everything.result, Failed)
    assert everything.result.result == MissionResult.DENIED
    assert fence.result == Done(PLANS[MissionType.FENCE])
    assert all(w.server.items(kind) for kind in KINDS)


def test_two_clients_upload_different_types_at_once() -> None:
    w = world()
    fence, other = w.stations["gcs"].clients[MissionType.FENCE], w.stations["other"].client
    fence.start_upload(PLANS[MissionType.FENCE])
    other.start_upload(PLANS[MissionType.MISSION])
    w.run()
    assert isinstance(fence.result, Done)
    assert isinstance(other.result, Done)


def test_a_refusal_says_of_which_type_it_is_and_keeps_the_old_plan() -> None:
    w = world()
    upload_all(w)
    w.events.clear()
    fence = w.stations["gcs"].clients[MissionType.FENCE]
    fence.start_upload(polygon(square(5.0, at=(500.0, 0.0))))
    w.run()
    reason = "the geofence leaves out the home position"
    assert w.events == [MissionRefused(MissionResult.INVALID, None, reason, MissionType.FENCE)]
    assert w.server.items(MissionType.FENCE) == tuple(item.on_wire() for item in PLANS[MissionType.FENCE])


def test_items_of_another_type_in_an_upload_are_refused() -> None:
    w = world()
    for kind, foreign in ((MissionType.MISSION, MissionType.FENCE), (MissionType.FENCE, MissionType.RALLY)):
        client = w.stations["gcs"].clients[kind]
        client.start_upload(PLANS[foreign])
        w.run()
        assert isinstance(client.result, Failed)
        assert client.result.result == MissionResult.UNSUPPORTED


class Server:
    """A server with hand-driven clients."""

    def __init__(self) -> None:
        self.server = MissionServer(VEHICLE, CHECKS)

    def tell(self, message: Message, source: Address = GCS, now_s: float = 0.0) -> list[Message]:
        (decoded,) = Link(0, 0).decode(Link(*source).encode(message))
        self.server.receive(decoded, source, now_s)
        return [answer for _, answer in self.server.poll(now_s)]

    def put(self, items: tuple[MissionItem, ...], source: Address = GCS) -> None:
        self.tell(mavlink.MAVLink_mission_count_message(*VEHICLE, len(items), 0), source)
        for seq, item in enumerate(items):
            answers = self.tell(message_from_item(item, seq, VEHICLE, 0), source)
        assert answers[-1].type == MissionResult.ACCEPTED


CLEAR = mavlink.MAVLink_mission_clear_all_message(*VEHICLE, 0)
LIST = mavlink.MAVLink_mission_request_list_message(*VEHICLE, 0)


def request(seq: int) -> Message:
    return mavlink.MAVLink_mission_request_int_message(*VEHICLE, seq, 0)


def test_a_late_copy_of_the_request_for_the_count_never_mixes_two_plans() -> None:
    old, new = mission(4, mark=1), mission(4, mark=2)
    server = Server()
    server.put(old)
    (count,) = server.tell(LIST)
    assert count.opaque_id == mission_id(old)
    server.tell(request(0))
    (again,) = server.tell(LIST)  # of the same plan: it goes on
    assert again.opaque_id == mission_id(old)
    assert server.tell(request(1))[0].param1 == 1.0
    server.put(new, OTHER)
    assert server.tell(request(1))[0].param1 == 1.0  # still the plan that it asked for
    (other,) = server.tell(LIST)
    assert other.opaque_id == mission_id(new)
    for seq in (2, 3):  # the client has not heard of it: no item of the new plan
        (told,) = server.tell(request(seq))
        assert (told.get_type(), told.opaque_id) == ("MISSION_COUNT", mission_id(new))
    assert [server.tell(request(seq))[0].param1 for seq in range(4)] == [2.0] * 4


def test_a_new_download_after_one_that_was_given_up_brings_the_plan_in_force() -> None:
    server = Server()
    server.put(mission(3, mark=1))
    server.tell(LIST)
    server.tell(request(0))  # its end, MISSION_ACK, gets lost
    server.put(mission(3, mark=2), OTHER)
    assert server.tell(LIST, now_s=1.0)[0].opaque_id == mission_id(mission(3, mark=2))
    assert [server.tell(request(seq), now_s=1.0)[0].param1 for seq in range(3)] == [2.0] * 3


def test_a_repeated_acknowledgement_has_the_id_of_the_plan_that_was_accepted() -> None:
    """Else a client whose acknowledgement got lost would take another client's plan for its own."""
    first, second = mission(2, mark=1), mission(2, mark=2)
    server = Server()
    server.put(first)
    for change in (lambda: server.put(second, OTHER), lambda: server.tell(CLEAR, OTHER)):
        server.put(first)
        last = message_from_item(first[1], 1, VEHICLE, 0)
        assert server.tell(last)[0].opaque_id == mission_id(first)
        change()
        (again,) = server.tell(last)
        assert (again.type, again.opaque_id) == (MissionResult.ACCEPTED, mission_id(first))


def test_a_download_begins_again_when_the_plan_turns_out_to_be_another() -> None:
    client = MissionClient(VEHICLE, GCS)

    def tell(message: Message) -> list[Message]:
        (decoded,) = Link(0, 0).decode(Link(*VEHICLE).encode(message))
        client.receive(decoded, 0.0)
        return client.poll(0.0)

    client.start_download()
    client.poll(0.0)
    old, new = mission(2, mark=1), mission(2, mark=2)
    tell(mavlink.MAVLink_mission_count_message(*GCS, 2, 0, mission_id(old)))
    tell(message_from_item(old[0], 0, GCS, 0))
    (asked,) = tell(mavlink.MAVLink_mission_count_message(*GCS, 2, 0, mission_id(new)))
    assert (asked.get_type(), asked.seq) == ("MISSION_REQUEST_INT", 0)
    for seq, item in enumerate(new):
        tell(message_from_item(item, seq, GCS, 0))
    assert client.result == Done(new)
    assert client.plan_id == mission_id(new)


def test_setting_the_current_item_is_about_the_mission_alone() -> None:
    server = Server()
    server.put(mission(2))
    server.server.events()
    server.tell(mavlink.MAVLink_mission_set_current_message(*VEHICLE, 1))
    assert server.server.events() == [CurrentRequested(1)]
