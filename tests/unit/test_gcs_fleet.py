"""Several vehicles on one link without I/O: sessions, selection, heartbeats and link quality."""

from __future__ import annotations

from collections import Counter

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from flightstack.transports.udp import Address
from gcs_cli.actions.in_flight import land
from gcs_cli.actions.run import ActionRun, Outcome
from gcs_cli.link.fleet import Fleet
from gcs_cli.link.quality import PROMPT_S
from tests.support.fake_vehicle import FakeVehicle

HERE, THERE = ("10.0.0.1", 18570), ("10.0.0.2", 18570)


def met(fleet: Fleet, vehicle: FakeVehicle, peer: Address = HERE, now_s: float = 0.0) -> Fleet:
    vehicle.make_heartbeat_due()
    for frame in vehicle.poll(now_s):
        fleet.receive(frame, peer, now_s)
    return fleet


def sent(fleet: Fleet, now_s: float) -> list[tuple[str, Address]]:
    return [
        (message.get_type(), peer) for data, peer in fleet.poll(now_s) for message in Link(0, 0).decode(data)
    ]


def test_fleet_keeps_a_view_per_system() -> None:
    fleet = met(met(Fleet(), FakeVehicle(1)), FakeVehicle(2), THERE)
    assert {number: session.target for number, session in fleet.sessions.items()} == {1: (1, 1), 2: (2, 1)}
    assert fleet.selected is fleet.sessions[1]
    assert [session.peer for session in fleet.sessions.values()] == [HERE, THERE]
    assert fleet.systems == {1, 2}


def test_fleet_separates_vehicles_behind_one_peer() -> None:
    one, two = FakeVehicle(1), FakeVehicle(2)
    two.armed = True
    fleet = met(met(Fleet(), one), two)
    assert [session.view.armed for session in fleet.sessions.values()] == [False, True]
    assert [session.view.link.lost for session in fleet.sessions.values()] == [0, 0]


def test_fleet_sends_one_heartbeat_per_peer_and_second() -> None:
    fleet = met(met(met(Fleet(), FakeVehicle(1)), FakeVehicle(2)), FakeVehicle(3), THERE)
    counts: Counter[Address] = Counter()
    for tick in range(30):
        counts.update(peer for name, peer in sent(fleet, tick / 10) if name == "HEARTBEAT")
    assert counts == {HERE: 3, THERE: 3}


def test_only_the_given_system_is_selected() -> None:
    fleet = met(Fleet(system_id=2), FakeVehicle(1))
    assert (fleet.selected.target, set(fleet.sessions)) == ((0, 0), {1})
    met(fleet, FakeVehicle(2), THERE)
    assert fleet.selected.target == (2, 1)


def test_lost_selection_moves_to_the_next_vehicle() -> None:
    fleet = met(met(Fleet(), FakeVehicle(1)), FakeVehicle(2), THERE)
    met(fleet, FakeVehicle(2), THERE, 5.1)
    assert fleet.selected.target == (2, 1)


def test_kept_selection_does_not_move() -> None:
    fleet = met(met(Fleet(), FakeVehicle(1)), FakeVehicle(2), THERE)
    fleet.keep()
    met(fleet, FakeVehicle(2), THERE, 5.1)
    assert fleet.selected.target == (1, 1)
    assert fleet.select(2).target == (2, 1)
    with pytest.raises(KeyError):
        fleet.select(3)


def test_every_vehicle_gets_the_subscription() -> None:
    fleet = met(Fleet(), FakeVehicle(1))
    fleet.subscribe({int(mavlink.MAVLINK_MSG_ID_ESC_STATUS): 10.0})
    met(fleet, FakeVehicle(2), THERE)
    requests = [peer for name, peer in sent(fleet, 0.0) if name == "COMMAND_LONG"]
    assert requests == [HERE, THERE]


def test_peers_are_greeted_until_a_vehicle_answers() -> None:
    fleet = Fleet([HERE, THERE])
    assert sent(fleet, 0.0) == [("HEARTBEAT", HERE), ("HEARTBEAT", THERE)]
    assert fleet.next_deadline() == 1.0
    met(fleet, FakeVehicle(1))
    assert {peer for _, peer in sent(fleet, 1.0)} == {HERE}


def test_vehicle_may_reconnect_from_another_address() -> None:
    fleet = met(Fleet(), FakeVehicle(1))
    fleet.disconnect(HERE)
    assert sent(fleet, 0.5) == []
    met(fleet, FakeVehicle(1), THERE, 0.6)
    assert fleet.selected.peer == THERE


def test_action_ends_after_the_connection_was_closed() -> None:
    fleet = met(Fleet(), FakeVehicle(1))
    session = fleet.selected
    run = ActionRun(land(), lambda: session.view, 0.0, session.own)
    session.use(run)
    fleet.disconnect(HERE)
    now_s = 0.0
    while run.result is None and now_s < 10.0:
        due_s = fleet.next_deadline()
        assert due_s is not None
        now_s = max(now_s + 0.01, due_s)
        assert sent(fleet, now_s) == []
    assert run.result is not None
    assert run.result[:2] == (Outcome.ENDED, "land: the vehicle was lost")


def test_messages_of_every_system_are_observed() -> None:
    fleet, seen = Fleet(), list[tuple[int, str, float]]()

    def observe(message: Message, now_s: float) -> None:
        seen.append((message.get_srcSystem(), message.get_type(), now_s))

    fleet.observe = observe
    other = Link(254, 190).encode(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    fleet.receive(other, HERE, 2.5)
    assert (seen, fleet.sessions) == ([(254, "HEARTBEAT", 2.5)], {})


def test_unknown_messages_do_not_count_as_lost() -> None:
    vehicle, known = Link(1, 1), mavlink.MAVLink_system_time_message(0, 1)
    fleet = Fleet()
    frames = [vehicle.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))]
    unknown = bytearray(vehicle.encode(known))
    unknown[7:10] = (60_000).to_bytes(3, "little")
    frames += [bytes(unknown), vehicle.encode(known)]
    for frame in frames:
        fleet.receive(frame, HERE, 0.0)
    assert (fleet.selected.view.link.lost, fleet.wire.bad) == (0, 0)


def test_round_trip_and_loss_are_measured() -> None:
    fleet, vehicle = Fleet(), Link(1, 1)
    fleet.receive(vehicle.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)), HERE, 0.0)
    (request,) = (
        message
        for data, _ in fleet.poll(0.0)
        for message in Link(0, 0).decode(data)
        if message.get_type() == "TIMESYNC"
    )
    assert fleet.selected.quality.round_trip_s is None
    assert fleet.selected.awaits_round_trip(0.02)
    assert not fleet.selected.awaits_round_trip(PROMPT_S)
    for number in range(4):
        answer = vehicle.encode(mavlink.MAVLink_timesync_message(5, request.ts1))
        if number != 1:
            fleet.receive(answer, HERE, 0.03)
    quality = fleet.selected.quality
    assert not fleet.selected.awaits_round_trip(0.04)
    assert quality.round_trip_s == pytest.approx(0.03)
    assert fleet.selected.view.link.round_trip_s == quality.round_trip_s  # later messages keep it
    received, lost = fleet.selected.view.link.received, fleet.selected.view.link.lost
    assert lost > 0
    assert quality.loss == pytest.approx(lost / (received + lost), abs=0.2)


def test_the_view_has_the_loss_of_the_last_ten_seconds() -> None:
    fleet, vehicle = Fleet(), Link(1, 1)
    shown = list[float | None]()
    for second in range(15):
        for number in range(10):
            frame = vehicle.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))
            if second > 0 or number % 2 == 0:  # half of the first second is lost
                fleet.receive(frame, HERE, float(second))
        fleet.poll(float(second))
        shown.append(fleet.selected.view.link.quality)
    assert shown[2] is not None
    assert shown[2] < 0.95  # 5 of 30 are lost
    assert shown[-1] == 1.0
    assert fleet.selected.view.link.lost > 0
