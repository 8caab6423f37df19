"""The hub of ground stations: who is answered, who is told what, and that no bytes break it."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega

from flightstack.core.enums import Mode, Severity
from flightstack.core.port_numbers import GROUND
from flightstack.guidance.mission import MissionProgress
from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, mavlink
from flightstack.mavlink.link import Link
from flightstack.services.routing.hub import MAX_PEERS
from flightstack.services.routing.peer import PeerAddress
from tests.support.hub_net import ACCEPTED, ALICE, BOB, DENIED, NAN, REJECTED, UNSUPPORTED, Net

COMMAND = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


@pytest.fixture
def net() -> Net:
    return Net()


# ---------------------------------------------------------------------- who is answered


@pytest.mark.parametrize(("system", "component"), [(8, 1), (7, 2), (255, 1), (8, 0)])
def test_commands_to_others_are_ignored(net: Net, system: int, component: int) -> None:
    alice = net.join(ALICE)
    alice.command(COMMAND, 1.0, system=system, component=component)
    net.poll()
    assert alice.take("COMMAND_ACK") == []
    assert not net.stack.now.status.armed


@pytest.mark.parametrize(("system", "component"), [(7, 1), (0, 1), (7, 0), (0, 0)])
def test_commands_to_us_or_to_all_are_carried_out(net: Net, system: int, component: int) -> None:
    alice = net.join(ALICE)
    assert alice.ask(COMMAND, 1.0, system=system, component=component) == ACCEPTED
    assert net.stack.now.status.armed


def test_an_acknowledgement_is_addressed_to_its_sender_and_goes_only_there(net: Net) -> None:
    alice, bob = net.join(ALICE, system=250, component=191), net.join(BOB)
    alice.command(COMMAND, 1.0)
    net.poll()
    (ack,) = alice.take("COMMAND_ACK")
    assert (ack.target_system, ack.target_component) == (250, 191)
    assert (ack.get_srcSystem(), ack.get_srcComponent()) == (7, 1)
    assert bob.take("COMMAND_ACK") == []


def test_mode_requests_of_old_stations_are_for_one_system(net: Net) -> None:
    alice = net.join(ALICE)
    takeoff = 4 << 16 | 2 << 24
    alice.send(mavlink.MAVLink_set_mode_message(8, 1, takeoff))
    assert net.stack.now.status.mode is Mode.HOLD
    alice.send(mavlink.MAVLink_set_mode_message(7, 1, takeoff))
    assert net.stack.now.status.mode is Mode.TAKEOFF
    alice.send(mavlink.MAVLink_set_mode_message(7, 1, 12345))
    net.poll()
    assert any("no such mode" in text.text for text in alice.take("STATUSTEXT"))


def test_each_peer_has_sequence_numbers_of_its_own(net: Net) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    net.run(3.0)
    for station in (alice, bob):
        numbers = [frame[4] for frame in station.frames if frame[5] == 7]  # not what is passed on
        assert len(numbers) > 300
        assert numbers == [index % 256 for index in range(len(numbers))]
    assert len(alice.take("ATTITUDE")) < len(bob.take("ATTITUDE"))


# ---------------------------------------------------------------------- who is told what


def test_an_unheard_permanent_peer_gets_heartbeats_only(net: Net) -> None:
    station = net.join(ALICE, heard=False)
    net.hub.add_peer(ALICE, permanent=True)
    net.stack.journal.say(Severity.NOTICE, "nobody hears this")
    net.run(10.0)
    assert {message.get_type() for message in station.inbox} == {"HEARTBEAT"}
    assert len(station.inbox) == pytest.approx(10, abs=1)
    station.heartbeat()
    net.run(1.0)
    assert {"ATTITUDE", "SYS_STATUS", "VFR_HUD"} <= {message.get_type() for message in station.inbox}


@pytest.mark.parametrize("address", [ALICE, BOB], ids=["ground station", "companion"])
def test_nothing_is_sent_unasked_that_pymavlink_cannot_decode(net: Net, address: PeerAddress) -> None:
    """MAVProxy counts such messages as lost. Its own requests change nothing: all streams, at 4 Hz."""
    station = net.join(address)
    net.run(4.5)
    station.send(mavlink.MAVLink_request_data_stream_message(7, 1, 0, 4, 1))
    net.run(4.5)
    kinds = {message.get_type() for message in station.inbox}
    assert len(kinds) > 15
    assert kinds <= {kind.msgname for kind in ardupilotmega.mavlink_map.values()}


def test_loop_timing_is_sent_to_the_peer_that_asks_for_it(net: Net) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    alice.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, FS_LOOP_TIMING_ID, 500_000)
    net.run(4.0)
    assert len(alice.take("FS_LOOP_TIMING")) == 8
    assert bob.take("FS_LOOP_TIMING") == []


def test_a_client_that_asks_for_modes_is_told_of_their_changes(net: Net) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    assert alice.ask(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES) == ACCEPTED
    net.run(4.0)
    for kind in ("CURRENT_MODE", "AVAILABLE_MODES_MONITOR"):
        assert len(alice.take(kind)) >= 2
        assert bob.take(kind) == []


def test_an_unknown_sender_of_junk_gets_nothing_and_is_forgotten(net: Net) -> None:
    junk = PeerAddress(GROUND, "junk", 9)
    net.hub.receive(junk, b"\xfd\x00junk", net.now_s)
    net.run(2.0)
    assert net.strangers == []
    assert net.hub.addresses() == []


def test_silent_peers_are_forgotten_and_permanent_ones_fall_back_to_heartbeats(net: Net) -> None:
    alice, bob = net.join(ALICE, heard=False), net.join(BOB)
    net.hub.add_peer(ALICE, permanent=True)
    alice.heartbeat()
    net.run(29.0, step_s=0.02)
    for station in (alice, bob):
        assert station.take("ATTITUDE")
        station.inbox.clear()
    net.run(2.0)
    alice.inbox.clear()
    bob.inbox.clear()
    net.run(5.0)
    assert {message.get_type() for message in alice.inbox} == {"HEARTBEAT"}
    assert bob.inbox == []
    assert net.hub.last_heard_s == 50.0  # who is forgotten was heard nevertheless
    bob.heartbeat()
    net.run(0.1)
    assert bob.take("ATTITUDE")


def test_no_more_peers_than_there_is_room_for(net: Net) -> None:
    for index in range(MAX_PEERS + 8):
        net.join(PeerAddress(GROUND, "host", index))
    assert len(net.hub.addresses()) == MAX_PEERS
    net.run(0.1)
    assert not net.stations[PeerAddress(GROUND, "host", MAX_PEERS + 1)].inbox


def test_heartbeats_tell_a_change_at_once(net: Net) -> None:
    alice = net.join(ALICE)
    net.run(0.5)
    alice.take("HEARTBEAT")
    alice.command(COMMAND, 1.0)
    net.poll()
    (beat,) = alice.take("HEARTBEAT")
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_texts_and_reached_items_go_to_all_who_listen(net: Net) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    net.poll()
    net.stack.journal.say(Severity.NOTICE, "x" * 120)
    for seq in (3, 4):
        net.stack.journal.item_reached(seq, MissionProgress(seq, seq, False, False), 5)
    net.poll()
    for station in (alice, bob):
        assert [len(chunk.text) for chunk in station.take("STATUSTEXT")] == [50, 50, 20, 22, 22]
        assert [message.seq for message in station.take("MISSION_ITEM_REACHED")] == [3, 4]
    net.poll()
    assert alice.take("STATUSTEXT") == alice.take("MISSION_ITEM_REACHED") == []


def test_system_time_before_a_text_is_the_time_of_its_event(net: Net) -> None:
    alice = net.join(ALICE)
    net.poll()
    alice.inbox.clear()
    for time_us, text in ((5_000_000, "one"), (5_000_000, "two"), (5_250_000, "three")):
        net.stack.now.time_us = time_us
        net.stack.journal.say(Severity.NOTICE, text)
    net.stack.now.time_us = 6_000_000
    net.poll()
    shown = [
        message.time_boot_ms if message.get_type() == "SYSTEM_TIME" else message.text
        for message in alice.inbox
        if message.get_type() in ("SYSTEM_TIME", "STATUSTEXT")
    ]
    assert shown[:5] == [5000, "one", "two", 5250, "three"]


@pytest.mark.parametrize(("vehicle_rate", "expected"), [(1.0, 250), (50.0, 250), (0.1, 25), (0.0, 1)])
def test_streams_count_the_slower_of_both_clocks(net: Net, vehicle_rate: float, expected: int) -> None:
    alice = net.join(ALICE)
    net.run(5.0, vehicle_rate)
    assert len(alice.take("ATTITUDE")) == pytest.approx(expected, abs=3)
    assert len(alice.take("HEARTBEAT")) == pytest.approx(5, abs=1)  # by the link's own clock


# ---------------------------------------------------------------------- commands of a link


def test_message_intervals_are_the_peers_own(net: Net) -> None:
    alice, bob = net.join(ALICE), net.join(BOB)
    interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE
    assert alice.ask(interval, attitude, 200_000.0) == ACCEPTED
    alice.inbox.clear()
    bob.inbox.clear()
    net.run(2.0)
    assert len(alice.take("ATTITUDE")) == pytest.approx(10, abs=1)
    assert len(bob.take("ATTITUDE")) == pytest.approx(200, abs=2)
    assert alice.ask(mavlink.MAV_CMD_REQUEST_MESSAGE, 244.0, attitude) == ACCEPTED
    (told,) = alice.take("MESSAGE_INTERVAL")
    assert (told.message_id, told.interval_us) == (attitude, 200_000)
    assert alice.ask(interval, attitude, -1.0) == ACCEPTED
    net.run(1.0)
    alice.take("ATTITUDE")
    net.run(1.0)
    assert alice.take("ATTITUDE") == []


@pytest.mark.parametrize(
    ("number", "params"),
    [
        (511, (9999.0, 1e5)), (511, (NAN, 1e5)), (511, (30.0, NAN)), (511, (30.0, 1e30)), (511, (30.0, -5.0)),
        (511, (math.inf, 1e5)),
        (512, (244.0, -1.0)), (512, (244.0, 70000.0)), (512, (244.0, NAN)), (512, (244.0, 1e30)),
    ],
)  # fmt: skip
def test_wishes_that_cannot_be_are_denied(net: Net, number: int, params: tuple[float, ...]) -> None:
    alice = net.join(ALICE)
    assert alice.ask(number, *params) == DENIED
    assert any(text.text.startswith("Command refused") for text in alice.take("STATUSTEXT"))
    net.run(0.1)


@pytest.mark.parametrize(
    "number", [9999.0, NAN, math.inf, -1.0, mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION]
)
def test_a_message_there_is_not_is_denied_without_a_text(net: Net, number: float) -> None:
    """QGroundControl asks every vehicle for gimbals and cameras, and shows each text to its user."""
    alice = net.join(ALICE)
    assert alice.ask(512, number) == DENIED
    assert alice.take("STATUSTEXT") == []


@pytest.mark.parametrize(
    "name", ["ATTITUDE", "HOME_POSITION", "AUTOPILOT_VERSION", "GPS_GLOBAL_ORIGIN", "ESC_STATUS"]
)
def test_messages_come_on_request(net: Net, name: str) -> None:
    alice = net.join(ALICE)
    net.poll()
    alice.inbox.clear()
    number = next(number for number, kind in mavlink.mavlink_map.items() if kind.msgname == name)
    assert alice.ask(mavlink.MAV_CMD_REQUEST_MESSAGE, number) == ACCEPTED
    assert len(alice.take(name)) == 1


def test_shut_down_is_for_a_vehicle_on_the_ground(net: Net) -> None:
    alice = net.join(ALICE)
    shutdown = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    assert alice.ask(shutdown, 4.0) == UNSUPPORTED
    net.stack.now.status = net.stack.now.status._replace(armed=True)
    net.stack.now.landed = False
    assert alice.ask(shutdown, 2.0) == DENIED
    assert not net.hub.vehicle.shutdown_requested
    net.stack.now.landed = True
    assert alice.ask(shutdown, 2.0) == ACCEPTED
    assert net.hub.vehicle.shutdown_requested


@pytest.mark.parametrize(
    ("altitude", "result"),
    [(491.0, ACCEPTED), (NAN, ACCEPTED), (math.inf, DENIED), (1e30, REJECTED), (488.1, REJECTED)],
)
def test_takeoff_altitudes_have_limits(net: Net, altitude: float, result: int) -> None:
    alice = net.join(ALICE)
    assert alice.ask(mavlink.MAV_CMD_NAV_TAKEOFF, NAN, NAN, NAN, NAN, NAN, NAN, altitude) == result


def test_farewell_says_goodbye_to_all(net: Net) -> None:
    alice = net.join(ALICE)
    net.poll()
    alice.inbox.clear()
    alice.command(COMMAND, 5.0)
    for address, data in net.hub.farewell():
        assert address == ALICE
        alice.inbox += alice.codec.decode(data)
    kinds = [message.get_type() for message in alice.inbox]
    assert kinds == ["COMMAND_ACK", "SYSTEM_TIME", "STATUSTEXT", "STATUSTEXT", "HEARTBEAT"]
    assert alice.inbox[-1].system_status == mavlink.MAV_STATE_POWEROFF


# ---------------------------------------------------------------------- anything


KINDS = sorted(mavlink.mavlink_map)


@st.composite
def any_frame(draw: st.DrawFn) -> bytes:
    """A frame with a right checksum: any message, any payload, any sender."""
    kind = mavlink.mavlink_map[draw(st.sampled_from(KINDS))]
    payload = draw(st.binary(min_size=1, max_size=255))
    size = min(255, kind.unpacker.size)
    payload = (payload * 255)[: draw(st.integers(1, size))]
    codec = mavlink.MAVLink(None, draw(st.integers(0, 255)), draw(st.integers(0, 255)))
    head = bytes([len(payload), 0, 0, 3, codec.srcSystem, codec.srcComponent]) + kind.id.to_bytes(3, "little")
    crc = mavlink.x25crc(head + payload)
    crc.accumulate(bytes([kind.crc_extra]))
    return b"\xfd" + head + payload + crc.crc.to_bytes(2, "little")


STRANGE = st.sampled_from(
    [0.0, 1.0, 2.0, -1.0, 7.0, 30.0, 244.0, 21196.0, NAN, math.inf, -math.inf, 3e38, 1e-40]
)


@st.composite
def any_command(draw: st.DrawFn) -> bytes:
    number = draw(st.sampled_from([16, 20, 21, 22, 176, 246, 300, 400, 511, 512, 31010]))
    params = [draw(STRANGE) for _ in range(7)]
    link = Link(255, 190)
    if draw(st.booleans()):
        return link.encode(
            mavlink.MAVLink_command_long_message(7, 1, number, draw(st.integers(0, 255)), *params)
        )
    x, y = draw(st.integers(-(2**31), 2**31 - 1)), draw(st.integers(-(2**31), 2**31 - 1))
    frame = draw(st.integers(0, 255))
    return link.encode(
        mavlink.MAVLink_command_int_message(7, 1, frame, number, 0, 0, *params[:4], x, y, params[6])
    )


@settings(max_examples=60)
@given(st.lists(st.one_of(st.binary(max_size=100), any_frame(), any_command()), min_size=1, max_size=12))
def test_nothing_that_arrives_raises(storm: list[bytes]) -> None:
    net = Net()
    alice = net.join(ALICE)
    for data in storm:
        net.hub.receive(ALICE, data, net.now_s)
        net.run(0.02)
    alice.inbox.clear()
    for _ in range(12):  # half a frame may wait for its other half
        alice.heartbeat()
        net.run(0.1, step_s=0.1)
    assert alice.take("HEARTBEAT")
