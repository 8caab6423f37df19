"""The hub among many peers: what it passes on, who gets a place, and a poll that is taken in parts."""

from __future__ import annotations

import math
import random

import pytest

from flightstack.core.enums import Severity
from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import SILENT_AFTER_S, Link
from flightstack.params.config import StackConfig
from flightstack.process.assembly import build, transfer_state
from flightstack.services.routing.hub import FORWARDED_A_POLL, KEPT_TEXTS, MAX_PEERS, PEER_FORGOTTEN_S
from flightstack.services.routing.peer import PeerAddress
from tests.support.hub_net import ALICE, BOB, Net

CAMERA = PeerAddress("tcp", "camera", 3)


@pytest.fixture
def net() -> Net:
    return Net()


def address(number: int) -> PeerAddress:
    return PeerAddress(GROUND, "host", number)


def test_frames_are_passed_on_unchanged_to_whom_they_concern(net: Net) -> None:
    alice, bob = net.join(ALICE, system=250), net.join(BOB, system=251)
    camera = net.join(CAMERA, system=7, component=100)
    net.poll()
    for station in (alice, bob, camera):
        station.frames.clear()
    to_camera = alice.codec.encode(mavlink.MAVLink_command_long_message(7, 100, 2000, 0, *[0.0] * 7))
    to_all = alice.codec.encode(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    unknown = bytes([0xFD, 2, 0, 0, 5, 250, 190]) + (54321).to_bytes(3, "little") + b"\x01\x02\x11\x22"
    for frame in (to_camera, to_all, unknown):
        net.hub.receive(ALICE, frame, net.now_s)
    net.poll()
    passed = [[f for f in station.frames if f[5] == 250] for station in (alice, bob, camera)]
    assert passed == [[], [to_all, unknown], [to_camera, to_all, unknown]]


def test_a_command_for_another_vehicle_is_passed_on_and_not_carried_out(net: Net) -> None:
    alice, other = net.join(ALICE), net.join(BOB, system=8, component=1)
    net.poll()
    other.inbox.clear()
    alice.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, system=8)
    net.poll()
    assert not net.stack.now.status.armed
    assert len(other.take("COMMAND_LONG")) == 1
    assert alice.take("COMMAND_ACK") == []


def test_a_peer_that_has_gone_gets_nothing_more(net: Net) -> None:
    alice = net.join(ALICE)
    net.join(BOB)
    net.poll()
    alice.heartbeat()
    net.hub.drop_peer(BOB)
    assert BOB not in [where for where, _ in net.hub.poll(net.now_s + 1.0)]


def test_what_is_passed_on_is_limited_in_a_poll_and_in_all(net: Net) -> None:
    for number in range(20):
        net.join(address(number))
    net.poll()
    talker = net.stations[address(0)]
    for _ in range(1000):
        talker.heartbeat()
    assert net.hub.forward_backlog <= 4096
    sent = [frame for _, frame in net.hub.poll(net.now_s) if frame[5] == 255]
    assert len(sent) == FORWARDED_A_POLL


def test_noise_takes_no_place(net: Net) -> None:
    chance = random.Random(5)
    for number in range(500):
        net.hub.receive(address(number), chance.randbytes(280), net.now_s)
    assert net.hub.addresses() == []


def test_new_peers_take_the_place_of_silent_ones_and_never_of_one_that_is_heard(net: Net) -> None:
    station = net.join(ALICE)
    for number in range(MAX_PEERS - 1):
        net.join(address(number))
    net.run(SILENT_AFTER_S + 0.5)
    station.heartbeat()
    for number in range(1000, 1000 + 2 * MAX_PEERS):  # somebody opens port after port
        net.join(address(number))
    assert net.hub.heard_s(ALICE) > -math.inf
    assert net.hub.heard_s(address(1000)) > -math.inf
    assert len(net.hub.addresses()) == MAX_PEERS


def test_a_silent_peer_gets_heartbeats_only(net: Net) -> None:
    """One forged datagram draws telemetry for five seconds, not for half a minute."""
    alice, bob = net.join(ALICE), net.join(BOB, system=251)
    net.run(SILENT_AFTER_S)
    bob.heartbeat()
    assert len(alice.take("ATTITUDE")) > 200
    net.stack.journal.say(Severity.NOTICE, "for those present")
    alice.frames.clear()
    alice.inbox.clear()
    for _ in range(3):
        net.run(SILENT_AFTER_S)
        bob.heartbeat()  # passed on to those that are not silent
    assert {message.get_type() for message in alice.inbox} == {"HEARTBEAT"}
    assert sum(map(len, alice.frames)) < 16 * 21 + 1
    assert len(bob.take("ATTITUDE")) > 900


def test_a_silent_peer_that_speaks_again_gets_its_streams_back(net: Net) -> None:
    alice = net.join(ALICE)
    alice.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 500_000)
    net.run(2.0 * SILENT_AFTER_S)
    alice.inbox.clear()
    alice.heartbeat()
    net.run(4.0)
    assert len(alice.take("ATTITUDE")) == 8


def test_status_texts_wait_for_a_silent_peer(net: Net) -> None:
    alice = net.join(ALICE)
    net.run(SILENT_AFTER_S + 0.5)
    for number in range(2 * KEPT_TEXTS):
        net.stack.journal.say(Severity.NOTICE, f"text {number}")
    net.run(1.0)
    assert alice.take("STATUSTEXT") == []
    alice.heartbeat()
    net.run(0.1)
    texts = [message.text for message in alice.take("STATUSTEXT")]
    assert texts == [f"text {number}" for number in range(KEPT_TEXTS, 2 * KEPT_TEXTS)]


def test_a_configured_ground_station_with_a_lost_uplink_keeps_its_telemetry(net: Net) -> None:
    alice = net.join(ALICE, heard=False)
    net.hub.add_peer(ALICE, permanent=True)
    alice.heartbeat()
    net.run(2.0 * SILENT_AFTER_S)
    alice.inbox.clear()
    net.stack.journal.say(Severity.NOTICE, "failsafe")
    net.run(1.0)
    assert [message.text for message in alice.take("STATUSTEXT")] == ["failsafe"]
    assert alice.take("ATTITUDE")


def test_telemetry_waits_for_a_congested_peer_and_answers_do_not(net: Net) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    net.run(0.1)
    alice.inbox.clear()
    alice.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    for _ in range(50):
        net.now_s += 0.01
        net.stack.now.time_us += 10_000
        for where, data in net.hub.poll(net.now_s, {ALICE}):
            net.stations[where].inbox += net.stations[where].codec.decode(data)
    kinds = {message.get_type() for message in alice.inbox}
    assert {"COMMAND_ACK", "HOME_POSITION"} <= kinds <= {"COMMAND_ACK", "HOME_POSITION", "HEARTBEAT"}
    assert bob.take("ATTITUDE")


def test_a_silent_tcp_client_keeps_its_streams(net: Net) -> None:
    """Scripts that only read are common; the address of a connection cannot be forged."""
    camera = net.join(CAMERA)
    net.run(2.0 * PEER_FORGOTTEN_S, step_s=0.1)
    camera.inbox.clear()
    net.run(1.0)
    assert len(camera.take("ATTITUDE")) == pytest.approx(50, abs=1)


def test_a_peer_with_heartbeats_at_one_hertz_keeps_its_streams(net: Net) -> None:
    alice = net.join(ALICE)
    for _ in range(20):
        net.run(1.0)
        alice.heartbeat()
    assert len(alice.take("ATTITUDE")) == 1000


def test_peers_that_are_addressed_unasked_take_no_place_from_others(net: Net) -> None:
    for number in range(MAX_PEERS):
        net.hub.add_peer(PeerAddress("tcp", "silent", number), permanent=True)
    net.join(ALICE)
    assert net.hub.heard_s(ALICE) > -math.inf


def test_a_poll_may_be_taken_in_parts_while_messages_arrive(net: Net) -> None:
    """Every peer gets the same frames as in one go: numbers without a gap, and its answer."""
    stations = [net.join(address(number)) for number in range(5)]
    net.poll()
    for station in stations:
        station.inbox.clear()
        station.frames.clear()
    for _ in range(50):
        net.now_s += 0.02
        net.stack.now.time_us += 20_000
        for count, (where, data) in enumerate(net.hub.poll(net.now_s)):
            net.stations[where].frames.append(data)
            if count < 2:  # answered in the next poll
                asked = mavlink.MAVLINK_MSG_ID_ATTITUDE
                stations[0].command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, asked, 20_000)
                stations[1].command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    net.poll()
    for station in stations:
        own = [frame for frame in station.frames if frame[5] == 7]
        first = own[0][4]
        assert [frame[4] for frame in own] == [(first + index) % 256 for index in range(len(own))]
        kinds = [m.get_type() for frame in own for m in Link(1, 1).decode(frame)]
        assert kinds.count("ATTITUDE") >= 45
    answers = [m for frame in stations[1].frames for m in Link(1, 1).decode(frame)]
    assert any(message.get_type() == "HOME_POSITION" for message in answers)


def test_a_peer_may_go_in_the_middle_of_a_poll(net: Net) -> None:
    net.join(ALICE)
    net.join(BOB)
    net.run(0.1)
    net.now_s += 1.0
    net.stack.now.time_us += 1_000_000
    poll = net.hub.poll(net.now_s)
    (where, _) = next(poll)
    other = BOB if where == ALICE else ALICE
    net.hub.drop_peer(other)
    assert other not in [where for where, _ in poll]


def test_who_is_forgotten_or_has_gone_was_heard_nevertheless(net: Net) -> None:
    assert net.hub.last_heard_s == -math.inf
    net.join(ALICE)
    heard_s = net.now_s
    net.run(2.0 * PEER_FORGOTTEN_S, step_s=0.1)
    assert net.hub.addresses() == []
    assert net.hub.last_heard_s == heard_s
    net.hub.receive(BOB, b"noise", net.now_s)
    assert net.hub.last_heard_s == heard_s


def test_a_reboot_does_not_forget_when_somebody_was_heard() -> None:
    old, new = (build(StackConfig(), lambda: None) for _ in range(2))
    old.ground.last_heard_s = 12.0
    transfer_state(old, new)
    assert new.ground.last_heard_s == 12.0
