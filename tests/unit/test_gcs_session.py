"""The ground station's session without I/O: who the vehicle is, heartbeats, services, recording."""

from __future__ import annotations

from typing import Any

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from gcs_cli.link import calls
from gcs_cli.link.calls import Answer, Call
from gcs_cli.link.session import Session
from tests.support.fake_vehicle import ARM, FakeVehicle

HERE, THERE = ("10.0.0.1", 18570), ("10.0.0.2", 18570)


def heartbeats(frames: list[bytes]) -> list[Any]:
    messages = [message for frame in frames for message in Link(0, 0).decode(frame)]
    return [message for message in messages if message.get_type() == "HEARTBEAT"]


def met(session: Session, vehicle: FakeVehicle, peer: tuple[str, int] = HERE, now_s: float = 0.0) -> Session:
    for frame in vehicle.poll(now_s):
        session.receive(frame, peer, now_s)
    return session


def test_nothing_is_sent_before_there_is_someone_to_send_to() -> None:
    session = Session()
    assert session.poll(0.0) == []
    assert session.next_deadline() is None
    assert session.farewell() == []


def test_heartbeats_are_sent_once_a_second_as_a_ground_station() -> None:
    session = met(Session(), FakeVehicle())
    sent = [now_s for now_s in (0.0, 0.5, 0.99, 1.0, 1.9, 2.0) if heartbeats(session.poll(now_s))]
    assert sent == [0.0, 1.0, 2.0]
    assert session.next_deadline() == 3.0
    (message,) = heartbeats(session.poll(3.0))
    assert (message.get_srcSystem(), message.get_srcComponent()) == (255, 190)
    assert (message.type, message.autopilot) == (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID)


def test_an_address_is_greeted_more_often_until_its_vehicle_is_heard() -> None:
    """A vehicle that starts meets its ground station within a tenth of a second."""
    session = Session(peer=HERE)
    sent = [tenth for tenth in range(10) if heartbeats(session.poll(tenth / 10))]
    assert sent == list(range(10))
    met(session, FakeVehicle())
    sent = [tenth for tenth in range(10, 31) if heartbeats(session.poll(tenth / 10))]
    assert sent == [10, 20, 30]


def test_heartbeats_follow_vehicle_time_when_it_is_faster_than_real_time() -> None:
    session = met(Session(), FakeVehicle())

    def arrives(time_s: float) -> None:
        message = mavlink.MAVLink_system_time_message(0, round(time_s * 1000))
        session.receive(Link(1, 1).encode(message), HERE, 0.01)

    arrives(5.0)
    assert len(heartbeats(session.poll(0.0))) == 1
    arrives(5.9)
    assert not heartbeats(session.poll(0.01))
    arrives(6.0)
    assert len(heartbeats(session.poll(0.02))) == 1
    arrives(6.9)
    assert not heartbeats(session.poll(0.03))


def test_heartbeats_follow_vehicle_time_that_is_known_after_the_first() -> None:
    """A fast flight may be over before the next second of real time."""
    session, vehicle = Session(), FakeVehicle()
    alone = [frame for frame in vehicle.poll(0.0) if heartbeats([frame])]
    session.receive(alone[0], HERE, 0.0)
    assert session.view.time_s is None
    assert len(heartbeats(session.poll(0.0))) == 1
    sent = []
    for step, time_s in enumerate((0.5, 0.9, 1.4, 1.5)):
        message = mavlink.MAVLink_system_time_message(0, round(time_s * 1000))
        session.receive(Link(1, 1).encode(message), HERE, 0.01 * step)
        sent += [time_s for _ in heartbeats(session.poll(0.01 * step))]
    assert sent == [0.5, 1.5]


def test_a_given_peer_is_spoken_to_first() -> None:
    session = Session(peer=HERE)
    assert len(heartbeats(session.poll(0.0))) == 1


def test_it_says_when_it_leaves() -> None:
    session = met(Session(), FakeVehicle())
    (message,) = heartbeats(session.farewell())
    assert message.system_status == mavlink.MAV_STATE_POWEROFF


def test_the_first_vehicle_heard_is_kept() -> None:
    session = met(Session(), FakeVehicle(1))
    met(session, FakeVehicle(2), THERE, 1.0)
    assert (session.target, session.peer) == ((1, 1), HERE)
    assert session.view.link.received > 0


def test_a_vehicle_that_fell_silent_gives_way_to_the_next() -> None:
    session = met(Session(), FakeVehicle(1))
    met(session, FakeVehicle(2), THERE, 5.1)
    assert (session.target, session.peer) == ((2, 1), THERE)
    assert session.view.last_heartbeat_s == 5.1


def test_a_called_vehicle_is_not_replaced_by_another_peer() -> None:
    """Another vehicle may still send to the port, which an earlier program had."""
    session = met(Session(peer=HERE), FakeVehicle(2), THERE)
    assert (session.target, session.peer) == ((0, 0), HERE)
    met(session, FakeVehicle(1))
    met(session, FakeVehicle(2), THERE, 6.0)
    assert (session.target, session.peer) == ((1, 1), HERE)


def test_only_the_named_system_is_taken_for_the_vehicle() -> None:
    session = met(Session(system_id=1), FakeVehicle(2), THERE)
    assert session.target == (0, 0)
    met(session, FakeVehicle(1), HERE, 0.1)
    assert (session.target, session.peer) == ((1, 1), HERE)


def test_a_vehicle_that_was_met_is_not_replaced_when_it_falls_silent() -> None:
    """A request under way would take the answers of the next vehicle for its own."""
    session = met(Session(), FakeVehicle(1))
    session.keep_vehicle()
    met(session, FakeVehicle(2), THERE, 6.0)
    assert session.target == (1, 1)
    met(session, FakeVehicle(1), THERE, 7.0)
    assert (session.target, session.peer) == ((1, 1), THERE)


def test_a_vehicle_that_comes_back_from_another_port_is_the_same() -> None:
    session = met(Session(), FakeVehicle(1))
    texts_before = session.view.link.received
    met(session, FakeVehicle(1), THERE, 6.0)
    assert session.peer == THERE
    assert session.view.link.received > texts_before


def test_noise_is_counted_and_does_not_stop_what_follows() -> None:
    session = Session()
    for _ in range(40):
        session.receive(b"\xfd\xffnoise" * 10, THERE, 0.0)
    met(session, FakeVehicle())
    assert session.target == (1, 1)
    assert session.bad > 0


def test_every_frame_is_recorded_in_both_directions() -> None:
    frames: list[bytes] = []
    session = met(Session(record=frames.append), FakeVehicle())
    received = len(frames)
    sent = session.poll(0.0)
    assert received == session.view.link.received
    assert frames[received:] == sent


def complete(session: Session, vehicle: FakeVehicle, call: Call, now_s: float = 0.0) -> Answer:
    for _ in range(1000):
        answer = call.answer(now_s)
        if answer is not None:
            return answer
        for frame in session.poll(now_s):
            vehicle.receive(frame, now_s)
        met(session, vehicle, HERE, now_s)
        now_s += 0.05
    raise AssertionError("no answer")


def test_a_command_is_answered() -> None:
    vehicle = FakeVehicle()
    session = met(Session(), vehicle)
    answer = complete(session, vehicle, calls.command(session, *calls.ARM, 0.0))
    assert answer.accepted
    assert vehicle.commands == [(ARM, (1.0, 0, 0, 0, 0, 0, 0))]


def test_a_refusal_carries_the_text_that_follows_it() -> None:
    reason = "the vehicle is tilted by more than 30 degrees, and its rotors would touch the ground"
    vehicle = FakeVehicle(refusals={ARM: f"Command refused: {reason}"})
    session = met(Session(), vehicle)
    answer = complete(session, vehicle, calls.command(session, *calls.ARM, 0.0))
    assert answer == Answer(False, reason, result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED)


def test_a_refusal_without_a_text_names_the_result() -> None:
    vehicle = FakeVehicle(refusals={ARM: "?"}, unsent={"STATUSTEXT"})
    session = met(Session(), vehicle)
    answer = complete(session, vehicle, calls.command(session, *calls.ARM, 0.0))
    assert not answer.accepted
    assert "MAV_RESULT_TEMPORARILY_REJECTED" in answer.reason


def test_texts_of_before_explain_nothing() -> None:
    vehicle = FakeVehicle(unsent={"COMMAND_ACK"})
    session = met(Session(), vehicle)
    vehicle.say("Battery is low")
    met(session, vehicle)
    vehicle.unsent = {"STATUSTEXT"}
    vehicle.refusals = {ARM: "?"}
    answer = complete(session, vehicle, calls.command(session, *calls.ARM, 0.0))
    assert "Battery" not in answer.reason


def test_silence_is_told_from_refusal() -> None:
    vehicle = FakeVehicle(ignored={ARM})
    session = met(Session(), vehicle)
    answer = complete(session, vehicle, calls.command(session, *calls.ARM, 0.0))
    assert answer.silent
    assert "COMPONENT_ARM_DISARM" in answer.reason


def _batches() -> list[tuple[list[bytes], tuple[str, int], float]]:
    """Datagrams that arrive together, with peer and time: the vehicle is met within one, lost, and met elsewhere."""
    link, other = Link(1, 1), Link(2, 1)
    beat = mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 3, 3)

    def turned(link: Link, boot_ms: int) -> bytes:
        return link.encode(mavlink.MAVLink_attitude_message(boot_ms, 0.1, 0.0, 1e-3 * boot_ms, 0.0, 0.0, 0.0))

    return [
        ([turned(link, 10), link.encode(beat), b"noise", turned(link, 20) + turned(link, 30)], HERE, 0.0),
        ([other.encode(beat), turned(other, 40)], THERE, 1.0),
        ([other.encode(beat), turned(link, 50)], HERE, 1.5),
        ([turned(link, 60), link.encode(beat), turned(link, 70)], HERE, 9.0),
        ([turned(other, 80), other.encode(beat), turned(other, 90)], THERE, 20.0),
    ]


def test_datagrams_that_arrive_together_are_processed_as_one_by_one() -> None:
    alone, together, heard = Session(), Session(), ([], [])
    for session, found in zip((alone, together), heard, strict=True):
        session.observe = lambda message, found=found: found.append(bytes(message.get_msgbuf()))
    for datagrams, peer, now_s in _batches():
        for data in datagrams:
            alone.receive(data, peer, now_s)
        together.receive_all(datagrams, peer, now_s)
        assert together.view == alone.view
        assert (together.peer, together.bad) == (alone.peer, alone.bad)
    assert heard[0] == heard[1]
    assert len(heard[0]) > 8
    assert together.target == (2, 1)
