"""The firmware's application: parameters, commands, news, the outbox, and lines that lose and damage octets."""

from __future__ import annotations

import itertools
import math
import random
from typing import Any

import pytest

from flightstack.firmware.numbers import default_numbers
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link
from gcs_cli.clients.param_client import ParamClient, ParamDone, ParamFailed
from tests.firmware.app_support import (
    GCS,
    NANOSECONDS,
    OUTER_DUE,
    RESET,
    Target,
    command,
    kinds,
    read,
    step,
    tick,
    write,
)
from tests.firmware.codec_support import damaged

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3

OUT_OF_RANGE = 2


# ------------------------------------------------------------------------------------------------------ commands


def test_identity(target: Target) -> None:
    identity = target.request("FS_PIL_IDENTITY")
    assert identity.source_hash == [1, 2, 3, 4, 5, 6, 7, 8]
    assert (identity.clock_hz, identity.cost_unit) == (200_000_000, 1)
    assert (identity.real_octets, identity.char_bits) == (4, 8)
    assert identity.board == "test board with a name o"
    assert identity.compiler == ("compiler of " + "many words " * 5)[:47]


def test_autopilot_version(target: Target) -> None:
    version = target.request("AUTOPILOT_VERSION")
    wanted = mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
    assert version.capabilities == wanted
    assert version.flight_custom_version == [1, 2, 3, 4, 5, 6, 7, 8]
    assert version.uid2 == [0] * 18


def test_the_host_tells_what_it_is() -> None:
    target = Target(own_port=True)
    identity, status = target.request("FS_PIL_IDENTITY"), target.status()
    assert (identity.board, identity.clock_hz, identity.cost_unit) == ("host", 0, NANOSECONDS)
    assert identity.source_hash == [0] * 8  # which the build of a library does not give
    assert identity.compiler.startswith(("gcc ", "clang "))
    assert (status.stack_size, status.stack_high_water) == (0, 0)
    outer, inner, mixer, whole = target.step(0, RESET | OUTER_DUE).cycles
    assert 0 < outer + inner + mixer <= whole
    target.close()


@pytest.mark.parametrize(
    ("wanted", "result"),
    [
        (0, ACCEPTED), (53013, ACCEPTED), (22, UNSUPPORTED), (16777215, UNSUPPORTED), (16777216, DENIED),
        (-1, DENIED), (math.nan, DENIED), (math.inf, DENIED), (-math.inf, DENIED), (3e38, DENIED),
    ],
)  # fmt: skip
def test_messages_are_sent_on_request(target: Target, wanted: float, result: int) -> None:
    *messages, ack = target.ask(command(mavlink.MAV_CMD_REQUEST_MESSAGE, wanted))
    assert (ack.command, ack.result) == (mavlink.MAV_CMD_REQUEST_MESSAGE, result)
    assert (ack.target_system, ack.target_component) == GCS
    assert [message.get_msgId() for message in messages] == ([wanted] if result == ACCEPTED else [])


@pytest.mark.parametrize("name", ["AUTOPILOT_VERSION", "FS_PIL_STATUS", "FS_PIL_IDENTITY"])
def test_a_message_without_room_is_not_said_to_be_sent(target: Target, name: str) -> None:
    """Behind pings that leave more or less room the message may not fit where its acknowledgement does."""
    request = command(mavlink.MAV_CMD_REQUEST_MESSAGE, getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))
    refused = 0
    for pings in range(30):
        for _ in range(pings):
            target.give(target.pack(mavlink.MAVLink_ping_message(1, 1, 0, 0)))
        answers = [answer for answer in target.ask(request) if answer.get_type() != "PING"]
        if answers and answers[-1].get_type() == "COMMAND_ACK":
            assert answers[-1].result == (ACCEPTED if len(answers) == 2 else TEMPORARILY_REJECTED)
            refused += len(answers) == 1
    assert refused > 0
    (again, ack) = target.ask(request)
    assert (again.get_type(), ack.result) == (name, ACCEPTED)


def test_other_commands_are_unsupported(target: Target) -> None:
    (ack,) = target.ask(command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1))
    assert (ack.get_type(), ack.command, ack.result) == ("COMMAND_ACK", 400, UNSUPPORTED)


def test_a_ping_comes_back_to_its_sender(target: Target) -> None:
    (pong,) = target.ask(mavlink.MAVLink_ping_message(2**63 + 5, 77, 0, 0))
    assert (pong.time_usec, pong.seq) == (2**63 + 5, 77)
    assert (pong.target_system, pong.target_component) == GCS
    assert (pong.get_srcSystem(), pong.get_srcComponent()) == (1, 1)


def test_messages_that_are_none_of_its_business_are_heard_in_silence(target: Target) -> None:
    """Its own kinds of messages, from a ground station."""
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    text = mavlink.MAVLink_statustext_message(3, b"hello")
    assert target.ask(heartbeat, text) == []
    assert target.status().frames == 3


# ---------------------------------------------------------------------------------------------------------- news


def test_heartbeat_and_status_come_once_a_second_in_the_targets_time(target: Target) -> None:
    target.now_ms = 2**32 - 4_500  # it wraps on the way
    heard = []
    for _ in range(1_001):
        target.poll()
        heard += target.heard()
        target.now_ms = (target.now_ms + 10) & 0xFFFF_FFFF
    assert kinds(heard) == ["HEARTBEAT", "FS_PIL_STATUS"] * 11
    heartbeat, status = heard[-2:]
    assert (heartbeat.type, heartbeat.autopilot, heartbeat.mavlink_version) == (2, 0, 3)
    assert heartbeat.base_mode == mavlink.MAV_MODE_FLAG_HIL_ENABLED  # never armed
    assert status.time_boot_ms == 5_500
    assert (status.stack_size, status.stack_high_water) == (4096, 321)
    assert [message.get_seq() for message in heard] == list(range(22))


def test_counts_start_at_zero(target: Target) -> None:
    """In memory that was not zero before."""
    told = target.status()
    counts = {
        name: getattr(told, name) for name in told.fieldnames if not name.startswith(("stack", "frames"))
    }
    assert {name for name, count in counts.items() if count} == set()


def test_it_tells_when_there_is_something_due(target: Target) -> None:
    assert target.wait_ms == 0
    target.poll()
    assert target.wait_ms == 1_000
    target.poll(400)
    assert target.wait_ms == 600
    target.give(b"\xfd\x09")
    assert target.wait_ms == 20
    target.poll(5)
    assert target.wait_ms == 20
    target.poll(15)
    assert target.wait_ms == 5
    target.poll(5)
    assert target.wait_ms == 575


def test_losses_of_the_serial_port_are_counted_and_complained_about_once_a_second(target: Target) -> None:
    target.poll()
    target.heard()
    complaint = (mavlink.MAV_SEVERITY_WARNING, "Serial port overrun: octets were lost")
    target.uart_errors(0, 7)
    assert target.text_after(lambda: target.poll(3_000)) == []
    assert target.text_after(lambda: target.uart_errors(3, 7)) == [complaint]
    assert target.text_after(lambda: target.uart_errors(4, 9)) == []
    assert target.text_after(lambda: target.poll(999)) == []
    assert target.text_after(lambda: target.poll(1)) == [complaint]
    assert target.text_after(lambda: target.poll(5_000)) == []
    assert (target.status().uart_overruns, target.status().uart_errors) == (4, 9)


# ---------------------------------------------------------------------------------------------------- the outbox


def test_a_full_outbox_drops_whole_frames_the_least_important_first(target: Target) -> None:
    """Nothing is taken: news find no room first, then answers, reports last; what is sent then is whole."""
    target.step(0, RESET)
    for _ in range(40):
        target.poll(1_000)
    for index in range(40):
        target.give(target.pack(read("", index)))
    for _ in range(40):
        target.give(target.pack(step(0, RESET)))
    heard = ["news" if name in ("HEARTBEAT", "FS_PIL_STATUS") else name for name in kinds(target.heard())]
    counts = {name: heard.count(name) for name in heard}
    assert [name for name, _ in itertools.groupby(heard)] == ["news", "PARAM_VALUE", "FS_PIL_REPORT"]
    assert 2 <= counts["FS_PIL_REPORT"] < 40  # room that news and answers left
    assert 5 <= counts["PARAM_VALUE"] < 40
    assert 4 <= counts["news"] < 80
    status = target.status()
    assert status.dropped_frames == 80 + 40 + 40 - len(heard)
    assert status.uart_overruns == 0  # the line was too slow, but lost nothing


def test_the_outbox_is_full_with_its_last_octet(target: Target) -> None:
    """16 values of 37 octets, 9 reports of 144 and 4 outputs of 40 (four rotors; zeros at the end are cut) are 2048."""
    for index in range(16):
        target.give(target.pack(read("", index)))
    for number in range(9):
        target.give(target.pack(step(number, RESET | OUTER_DUE)))
    for number in range(5):
        target.give(target.pack(tick(number, RESET)))
    data = target.take()
    assert len(data) == 2048
    assert kinds(target.heard(data)) == ["PARAM_VALUE"] * 16 + ["FS_PIL_REPORT"] * 9 + ["FS_PIL_OUTPUT"] * 4


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (mavlink.MAVLink_ping_message(1, 1, 0, 0), "PING"),
        (command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_FS_PIL_IDENTITY), "FS_PIL_IDENTITY"),
        (command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_FS_PIL_STATUS), "FS_PIL_STATUS"),
        (command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148), "AUTOPILOT_VERSION"),
        (command(4711), "COMMAND_ACK"),
        (read("POS_XY_P"), "PARAM_VALUE"),
        (read("NO_SUCH"), "PARAM_ERROR"),
        (write("POS_XY_P", 1.0), "PARAM_VALUE"),
    ],
)
def test_an_answer_finds_room_where_news_do_not(target: Target, request_: Any, answer: str) -> None:
    for _ in range(40):
        target.poll(1_000)
    waiting = kinds(target.ask(request_))
    assert waiting.count("HEARTBEAT") < 40
    assert answer in waiting[-2:]


def test_frames_leave_whole_through_any_room(target: Target) -> None:
    rng = random.Random(3)
    for number in range(100):
        target.give(target.pack(step(number, RESET | OUTER_DUE)))
        out = b""
        while piece := target.take(rng.choice([1, 2, 7, 64, 300])):
            out += piece
        (report,) = target.heard(out)
        assert report.step == number


# ----------------------------------------------------------------------------------------------------- bad lines


def test_high_bits_of_octets_mean_nothing() -> None:
    """A C28x hands on what its FIFO register held."""
    clean, dirty = Target(), Target()
    frame = clean.pack(step(0, RESET | OUTER_DUE))
    clean.give(frame)
    rng = random.Random(1)
    for octet in frame:
        dirty.give_element(octet | rng.randrange(256) << 8)
    assert dirty.take() == clean.take() != b""
    clean.close()
    dirty.close()


def test_a_step_behind_a_damaged_one_is_answered_without_waiting_for_more(target: Target) -> None:
    """The length is wrong and swallows the next frame: 20 ms of silence give it back, with no octet more."""
    good = target.pack(step(0, RESET))
    target.poll()
    target.heard()
    target.give(b"\xfd\xff\x00" + good)
    assert target.heard() == []
    target.poll(1)  # hears that octets came
    target.poll(19)
    assert target.heard() == []
    target.poll(1)
    assert kinds(target.heard()) == ["FS_PIL_REPORT"]
    status = target.status()
    assert (status.bad_frames, status.skipped_octets, status.frames) == (1, 3, 2)


def test_a_single_octet_does_not_hold_back_the_next_frame(target: Target) -> None:
    target.poll()
    target.heard()
    target.give(b"\xfd")
    assert target.wait_ms == 20
    target.poll(1)  # hears that an octet came
    target.poll(20)
    short = mavlink.MAVLink_param_request_list_message(1, 0)  # its length passes for the flags of a frame
    assert kinds(target.ask(short))[0] == "PARAM_VALUE"
    assert target.status().skipped_octets == 1


def test_fields_without_a_meaning_are_zero(target: Target) -> None:
    """Memory that was not written holds a pattern, if the compiler can fill it."""
    target.poll()
    target.give(target.pack(command(mavlink.MAV_CMD_DO_SET_MODE)))
    target.give(target.pack(step(0, RESET, [math.nan] * 13)))
    heard = {message.get_type(): message for message in target.heard()}
    assert heard["HEARTBEAT"].custom_mode == 0
    text, ack = heard["STATUSTEXT"], heard["COMMAND_ACK"]
    assert (text.id, text.chunk_seq, ack.progress, ack.result_param2) == (0, 0, 0, 0)


def test_frames_of_unknown_messages_count_as_bad(target: Target) -> None:
    """Their checksums cannot be verified: dialect and link may be at fault."""
    frame = bytearray(target.pack(mavlink.MAVLink_ping_message(1, 1, 0, 0)))
    frame[7:10] = (0xCD, 0xAB, 0x0F)
    target.give(bytes(frame))
    assert target.status().bad_frames == 1


# ------------------------------------------------------------------------------------------------ ground stations


def converse(target: Target, client: ParamClient, loss: float, seed: int) -> None:
    """Let a client of ours speak with the target over a line that loses frames, in simulated time."""
    rng, link, now_s = random.Random(seed), Link(*GCS), 0.0
    for _ in range(20_000):
        for message in client.poll(now_s):
            frame = link.encode(message)
            target.give(b"" if rng.random() < loss else damaged(rng, frame) if rng.random() < loss else frame)
        now_s += 0.01
        target.poll(10)
        for frame in target.frames(rng.randrange(200, 400)):
            if rng.random() >= loss:
                for message in link.decode(frame):
                    client.receive(message, now_s)
        if client.result is not None:
            return
    raise AssertionError("the client did not end")


@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_our_client_reads_all_numbers_and_sets_one(target: Target, loss: float) -> None:
    client = ParamClient(Address(1, 1), Address(*GCS))
    client.start_list()
    converse(target, client, loss, 1)
    assert isinstance(client.result, ParamDone), client.result
    told = {parameter.name: parameter.value for parameter in client.result.parameters}
    assert told == pytest.approx(default_numbers(), rel=1e-6, abs=1e-9)
    client.start_set("POS_XY_P", 2.5)
    converse(target, client, loss, 2)
    assert isinstance(client.result, ParamDone), client.result
    assert target.ask(read("POS_XY_P"))[-1].param_value == 2.5


def test_our_client_hears_why_a_value_is_refused(target: Target) -> None:
    client = ParamClient(Address(1, 1), Address(*GCS))
    client.start_set("POS_XY_P", -2.5)
    converse(target, client, 0.0, 3)
    assert isinstance(client.result, ParamFailed)
    assert client.result.error == OUT_OF_RANGE
