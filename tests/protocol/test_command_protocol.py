"""Commands: sent until answered, executed once, answered always."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link, Message
from flightstack.services.commands.command_server import CommandServer
from flightstack.services.commands.context import Command
from flightstack.transports.memory import LossyLink
from gcs_cli.clients.command_client import CommandClient, CommandResult
from tests.protocol.mission_harness import LOSSY, NAN, VEHICLE

GCS = Address(255, 190)
ARM, TAKEOFF, LAND = 400, 22, 21
ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED, IN_PROGRESS = 0, 1, 3, 5


def over_the_wire(message: Message, source: Address = GCS) -> Message:
    (decoded,) = Link(0, 0).decode(Link(*source).encode(message))
    return decoded


def command_long(command: int, *params: float, confirmation: int = 0, target: Address = VEHICLE) -> Message:
    values = (*params, *[0.0] * (7 - len(params)))
    return over_the_wire(mavlink.MAVLink_command_long_message(*target, command, confirmation, *values))


def new_server() -> CommandServer:
    return CommandServer(VEHICLE, {ARM, TAKEOFF, LAND})


def test_a_long_command_keeps_its_nan() -> None:
    command = new_server().receive(command_long(TAKEOFF, NAN, 1.5, 0, NAN, NAN, NAN, 7.0), "a", 0.0)
    assert command is not None
    assert command[:1] == (TAKEOFF,)
    assert [math.isnan(value) for value in command.params] == [True, False, False, True, True, True, False]
    assert command.params[6] == 7.0
    assert (command.is_int, command.frame, command.peer, command.source) == (False, None, "a", GCS)


@pytest.mark.parametrize(
    ("frame", "x", "expected"),
    [
        (0, 473977420, 47.397742),
        (6, -900000000, -90.0),
        (5, 2**31 - 1, NAN),
        (2, 42, 42.0),
        (1, 50000, 5.0),
    ],
)
def test_an_integer_command_is_scaled_by_its_frame(frame: int, x: int, expected: float) -> None:
    message = mavlink.MAVLink_command_int_message(
        *VEHICLE, frame, TAKEOFF, 0, 0, 1.0, 2.0, 3.0, NAN, x, x, 9.0
    )
    command = new_server().receive(over_the_wire(message), "a", 0.0)
    assert command is not None
    assert command.params[4] == pytest.approx(expected, abs=0.0, rel=0.0, nan_ok=True)
    assert command.params[6] == 9.0
    assert (command.is_int, command.frame) == (True, frame)


def test_every_command_for_us_is_answered_and_no_other() -> None:
    server = new_server()
    for target, is_ours in (
        ((1, 1), True),
        ((1, 0), True),
        ((0, 0), True),
        ((2, 1), False),
        ((1, 100), False),
    ):
        assert server.receive(command_long(999, target=Address(*target)), "a", 0.0) is None
        answers = server.poll(0.0)
        assert len(answers) == is_ours
        for peer, ack in answers:
            assert (peer, ack.command, ack.result) == ("a", 999, UNSUPPORTED)
            assert (ack.target_system, ack.target_component) == GCS


def test_a_repetition_is_answered_but_not_executed() -> None:
    server = new_server()
    first = server.receive(command_long(ARM, 1.0), "a", 0.0)
    assert first is not None
    assert server.receive(command_long(ARM, 1.0, confirmation=1), "a", 0.5) is None
    assert server.poll(0.5) == []  # no answer yet
    server.answer(first, ACCEPTED)
    assert server.receive(command_long(ARM, 1.0, confirmation=2), "a", 1.0) is None
    assert [ack.result for _, ack in server.poll(1.0)] == [ACCEPTED, ACCEPTED]


def test_what_only_looks_like_a_repetition_is_executed() -> None:
    server = new_server()
    first = server.receive(command_long(ARM, 1.0), "a", 0.0)
    assert first is not None
    server.answer(first, ACCEPTED)
    assert server.receive(command_long(ARM, 1.0), "a", 0.1) is not None  # a new command: confirmation 0
    assert server.receive(command_long(ARM, 0.0, confirmation=1), "a", 0.2) is not None  # other parameters
    assert server.receive(command_long(ARM, 0.0, confirmation=1), "b", 0.3) is not None  # another client
    assert server.receive(command_long(ARM, 0.0, confirmation=1), "b", 9.0) is not None  # long ago
    refused = server.receive(command_long(LAND), "a", 10.0)
    assert refused is not None
    server.answer(refused, TEMPORARILY_REJECTED)
    assert server.receive(command_long(LAND, confirmation=1), "a", 10.5) is not None  # may succeed now


def test_the_client_repeats_with_a_rising_confirmation_and_then_gives_up() -> None:
    client = CommandClient(VEHICLE, GCS)
    client.send(ARM, [1.0], 10.0)
    sent = []
    while (deadline := client.next_deadline()) is not None:
        sent += [(deadline, message.confirmation) for message in client.poll(deadline)]
    assert sent == [(10.0 + number, number) for number in range(6)]
    assert client.result is not None
    assert client.result.result is None
    assert "did not answer MAV_CMD_COMPONENT_ARM_DISARM" in client.result.reason


def ack(command: int, result: int, progress: int = 255, source: Address = VEHICLE) -> Message:
    return over_the_wire(mavlink.MAVLink_command_ack_message(command, result, progress, 0, *GCS), source)


def test_a_command_in_progress_is_waited_for() -> None:
    client = CommandClient(VEHICLE, GCS)
    client.send(TAKEOFF, [], 0.0)
    client.poll(0.0)
    client.receive(ack(TAKEOFF, IN_PROGRESS, 40), 0.5)
    assert client.progress_percent == 40
    assert client.poll(9.0) == []
    client.receive(ack(TAKEOFF, IN_PROGRESS), 9.0)
    assert client.poll(18.9) == []
    client.receive(ack(TAKEOFF, ACCEPTED), 18.9)
    assert client.result == CommandResult(ACCEPTED, "")
    assert client.result.accepted
    client.send(TAKEOFF, [], 20.0)
    client.poll(20.0)
    client.receive(ack(TAKEOFF, IN_PROGRESS), 20.0)
    client.poll(30.0)
    assert client.result is not None
    assert "stopped reporting" in client.result.reason


def test_only_the_vehicles_answer_to_this_command_counts() -> None:
    client = CommandClient(VEHICLE, GCS)
    client.send(LAND, [], 0.0)
    client.receive(ack(LAND, ACCEPTED), 0.0)  # before it was sent: an answer to an older one
    client.poll(0.0)
    client.receive(ack(TAKEOFF, ACCEPTED), 0.1)
    client.receive(ack(LAND, ACCEPTED, source=Address(2, 1)), 0.1)
    assert client.result is None
    client.receive(ack(LAND, 4), 0.1)
    assert client.result == CommandResult(4, "the vehicle answered MAV_RESULT_FAILED")


def test_an_integer_command_is_sent_as_given() -> None:
    client = CommandClient(VEHICLE, GCS)
    client.send_int(192, (-1.0, 1.0, 0.0, NAN), 473977420, 85455940, 500.0, frame=5, now_s=0.0)
    (message,) = (over_the_wire(message) for message in client.poll(0.0))
    assert (message.get_type(), message.command, message.frame) == ("COMMAND_INT", 192, 5)
    assert (message.x, message.y, message.z) == (473977420, 85455940, 500.0)
    assert math.isnan(message.param4)


@settings(max_examples=100)
@given(seed=st.integers(0, 2**32))
def test_over_a_bad_link_a_command_ends_with_the_vehicles_answer_or_none(seed: int) -> None:
    link = LossyLink(LOSSY, seed)
    client, server = CommandClient(VEHICLE, GCS), new_server()
    gcs_codec, vehicle_codec = Link(*GCS), Link(*VEHICLE)
    executed: list[Command] = []
    now_s = 0.0
    client.send(ARM, [1.0], now_s)
    while client.result is None:
        for data in link.two.receive(now_s):
            for message in vehicle_codec.decode(data):
                command = server.receive(message, "a", now_s)
                if command is not None:
                    executed.append(command)
                    server.answer(command, ACCEPTED)
        for data in link.one.receive(now_s):
            for message in gcs_codec.decode(data):
                client.receive(message, now_s)
        for request in client.poll(now_s):
            link.one.send(gcs_codec.encode(request), now_s)
        for _, answer in server.poll(now_s):
            link.two.send(vehicle_codec.encode(answer), now_s)
        due = (client.next_deadline(), link.next_arrival())
        now_s = min((deadline for deadline in due if deadline is not None), default=now_s)
    if client.result.accepted:
        assert executed
    # a late copy of the first message carries no number, so it is the only one that can be executed again
    assert all(command.confirmation == 0 for command in executed[1:])
