"""The client of loops on a target, message by message."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.contract import LoopFlags
from flightstack.firmware.pil.client import PilClient, PilReport, PilTiming
from flightstack.firmware.pil.steps import BAD_INPUT, OUT_OF_ORDER, REPEATED, WANT_REFERENCE, StepInput
from flightstack.mavlink.dialect import mavlink

REST = [0.0] * 13 + [1.0] * 11
OUTER_DUE, SET_TARGET, RESET = LoopFlags.OUTER_DUE, LoopFlags.SET_TARGET, LoopFlags.RESET
CODEC = mavlink.MAVLink(None, 1, 1)


def report(step: int, status: int = 0, first: float = 1.0) -> bytes:
    message = mavlink.MAVLink_fs_pil_report_message(
        step, status, [1, 2, 3, 4], [first, 0, 0, 0, 9.0], [0.25] * 10, [2.0] * 4, [3.0] * 4, [0.0] * 8
    )
    return bytes(message.pack(CODEC))


def packed(message: object) -> bytes:
    return bytes(message.pack(CODEC))  # type: ignore[attr-defined]


def value(name: str, number: float) -> bytes:
    return packed(mavlink.MAVLink_param_value_message(name.encode(), number, 9, 100, 3))


def stepping(number: int = 0, timing: PilTiming = PilTiming(0.5, 3)) -> PilClient:  # noqa: B008
    """Return a client whose step ``number`` was sent at 0 s."""
    client = PilClient(timing)
    for _ in range(number):
        client.start_step(0, REST)
    client.start_step(0, REST)
    assert client.poll(0.0)
    return client


@given(
    st.integers(0, 7),
    st.lists(st.floats(width=32, allow_nan=False), min_size=24, max_size=24),
    st.integers(0, 24),
)
def test_a_step_is_framed_as_pymavlink_does(flags: int, numbers: list[float], zeros: int) -> None:
    numbers[zeros:] = [0.0] * (24 - zeros)
    sent = numbers if flags & 3 else [*numbers[:13], *[0.0] * 11]  # a setpoint that no loop reads stays here
    client = PilClient()
    client.start_step(flags, numbers)
    message = mavlink.MAVLink_fs_pil_step_message(0, flags, sent[:13], sent[13:])
    assert client.poll(0.0) == bytes(message.pack(mavlink.MAVLink(None, 1, 191)))


def test_numbers_beyond_float32_are_infinite() -> None:
    client = PilClient()
    client.start_step(0, [1e39, -1e300, math.nan, *REST[3:]])
    (message,) = mavlink.MAVLink(None, 1, 1).parse_buffer(client.poll(0.0))
    assert message.state[:2] == [math.inf, -math.inf]
    assert math.isnan(message.state[2])


def test_a_report_is_read_as_pymavlink_does() -> None:
    client = stepping()
    client.receive(report(0, status=6), 0.1)
    assert client.result == PilReport(
        0, 6, (1, 2, 3, 4), (1.0, 0.0, 0.0, 0.0, 9.0, *[0.25] * 10, *[2.0] * 4, *[3.0] * 4, *[0.0] * 8)
    )
    assert client.next_deadline() is None
    assert client.poll(9.0) == b""
    assert client.counters.answers == 1


def test_a_report_comes_octet_by_octet() -> None:
    client = stepping()
    for octet in report(0):
        assert client.result is None
        client.receive(bytes([octet]), 0.1)
    assert client.result is not None


def test_silence_is_met_by_the_same_step_and_in_the_end_by_a_sentence() -> None:
    client = PilClient(PilTiming(0.5, 3))
    client.start_step(4, REST)
    frames = [client.poll(now_s) for now_s in (0.0, 0.4, 0.5, 1.0)]
    assert [bool(frame) for frame in frames] == [True, False, True, True]
    assert frames[0][10:-2] == frames[2][10:-2] == frames[3][10:-2]
    assert client.failure is None
    assert client.poll(1.5) == b""
    assert client.failure == "did not answer step 0, sent 3 times"
    assert client.next_deadline() is None
    assert client.counters.resent == 2


def test_reports_of_other_steps_and_doubled_ones_are_counted_and_dropped() -> None:
    client = stepping(5)
    client.receive(report(4, REPEATED) + report(6), 0.1)
    assert client.result is None
    client.receive(report(5) + report(5, REPEATED), 0.1)
    assert isinstance(client.result, PilReport)
    assert client.result.status == 0
    client.receive(report(5, REPEATED), 0.1)
    assert (client.counters.late, client.counters.repeated) == (4, 3)


def test_a_report_from_before_the_step_was_sent_is_not_its() -> None:
    client = PilClient()
    client.start_step(0, REST)
    client.receive(report(0), 0.0)
    assert client.result is None
    assert client.counters.late == 1


@pytest.mark.parametrize("expected", [7, 8])
def test_a_target_that_is_where_we_are_may_refuse_an_old_step(expected: int) -> None:
    client = stepping(7)
    client.receive(report(expected, OUT_OF_ORDER), 0.1)
    assert client.next_deadline() == 0.5  # nothing to do but wait
    client.receive(report(7), 0.2)
    assert client.result is not None
    assert client.counters.out_of_order == 1


def test_target_at_another_step_is_retried_then_fails() -> None:
    client = stepping(7)
    for _ in range(2):
        client.receive(report(0, OUT_OF_ORDER), 0.1)
        assert client.poll(0.1)
    client.receive(report(0, OUT_OF_ORDER), 0.1)
    assert client.poll(0.1) == b""
    assert client.failure == "expects step 0, not 7: it may have been restarted"


def test_one_old_refusal_does_not_end_a_step() -> None:
    client = stepping(7)
    client.receive(report(3, OUT_OF_ORDER), 0.1)
    assert client.poll(0.1)
    client.receive(report(7), 0.2)
    assert client.result is not None


def test_bad_input_fails_at_once() -> None:
    client = stepping(2)
    client.receive(report(2, BAD_INPUT | 1), 0.1)
    assert client.failure == "stopped its rotors at step 2 because of invalid input"
    assert client.next_deadline() is None


def test_short_steps_send_only_what_the_loops_read() -> None:
    state, setpoint = [float(n) for n in range(1, 14)], [float(n) for n in range(20, 31)]
    inner, outer = state[6:], state[:6]
    for flags, wanted in (
        (0, inner),
        (RESET, inner),
        (OUTER_DUE, [*inner, *outer, *setpoint]),
        (SET_TARGET, [*inner, *setpoint[:5]]),
    ):
        client = PilClient()
        client.start_step(flags, [*state, *setpoint], short_rotors=4)
        message = mavlink.MAVLink_fs_pil_tick_message(0, flags, [*wanted, *[0.0] * 24][:24])
        assert client.poll(0.0) == bytes(message.pack(mavlink.MAVLink(None, 1, 191)))


def test_a_short_report_is_read_in_the_form_of_a_full_one() -> None:
    client = PilClient()
    client.start_step(OUTER_DUE | WANT_REFERENCE, REST, short_rotors=4)
    client.poll(0.0)
    values = [*[100.0, 101.0, 102.0, 103.0], *[1.0, 0.0, 0.0, 0.0, 9.0], *[0.5, 0.5, 0.5, 0.5], *[0.0] * 4]
    client.receive(packed(mavlink.MAVLink_fs_pil_output_message(0, 2, 77, values)), 0.1)
    result = client.result
    assert isinstance(result, PilReport)
    assert (result.step, result.status, result.cost) == (0, 2, (0, 0, 0, 77))
    assert result.outputs[:9] == (1.0, 0.0, 0.0, 0.0, 9.0, 0.5, 0.5, 0.5, 0.5)
    assert all(map(math.isnan, result.outputs[9:23]))
    assert result.outputs[23:] == (100.0, 101.0, 102.0, 103.0, 0.0, 0.0, 0.0, 0.0)


def in_window(count: int = 3) -> PilClient:
    """Return a client whose steps 0 to ``count`` - 1 were sent together at 0 s."""
    client = PilClient(PilTiming(0.5, 3, step_s=0.1))
    client.start_window([StepInput(RESET if at == 0 else 0, REST) for at in range(count)])
    assert [m.step for m in mavlink.MAVLink(None, 1, 1).parse_buffer(client.poll(0.0))] == [*range(count)]
    return client


def test_window_ends_with_the_last_report() -> None:
    client = in_window()
    assert client.next_deadline() == pytest.approx(0.7)
    client.receive(report(1) + report(0), 0.1)
    assert client.result is None
    client.receive(report(2), 0.2)
    assert isinstance(client.result, tuple)
    assert [each.step for each in client.result] == [0, 1, 2]  # type: ignore[union-attr]
    client.start_step(0, REST)
    assert client.step == 3


def test_window_resends_unanswered_steps_after_the_timeout() -> None:
    client = in_window()
    client.receive(report(0) + report(1, OUT_OF_ORDER), 0.1)
    assert client.poll(0.6) == b""
    assert [m.step for m in mavlink.MAVLink(None, 1, 1).parse_buffer(client.poll(0.8))] == [1, 2]
    client.receive(report(1) + report(2), 0.9)
    assert client.result is not None
    assert [step.attempts for step in client.steps] == [1, 2, 2]


def test_window_without_progress_fails() -> None:
    client = in_window()
    for now_s in (1.0, 2.0):
        assert client.poll(now_s)
    client.receive(report(0), 2.1)  # progress: the count of attempts starts again
    for now_s in (3.0, 4.0):
        assert client.poll(now_s)
    assert client.poll(5.0) == b""
    assert client.failure == "did not answer step 1, sent 3 times"


def test_bad_input_in_a_window_fails_at_once() -> None:
    client = in_window()
    client.receive(report(0) + report(1, BAD_INPUT), 0.1)
    assert client.failure == "stopped its rotors at step 1 because of invalid input"


def test_a_number_counts_when_it_is_read_back_bit_for_bit() -> None:
    client = PilClient(PilTiming(0.5, 2))
    client.start_set("POS_XY_P", 0.1)
    (message,) = mavlink.MAVLink(None, 1, 1).parse_buffer(client.poll(0.0))
    assert (message.get_type(), message.param_id, message.param_type) == ("PARAM_SET", "POS_XY_P", 9)
    assert (message.target_system, message.target_component) == (1, 1)
    nearly = math.nextafter(message.param_value, 1.0) + 1e-8
    client.receive(value("POS_Z_P", message.param_value) + value("POS_XY_P", nearly), 0.1)
    assert client.result is None
    client.receive(value("POS_XY_P", message.param_value), 0.1)
    assert client.result == message.param_value


def test_a_number_that_the_target_keeps_is_named() -> None:
    client = PilClient(PilTiming(0.5, 2))
    client.start_set("FS_MASS", 2.0)
    client.poll(0.0)
    client.receive(value("FS_MASS", 1.5), 0.1)
    client.poll(0.5)
    client.poll(1.0)
    assert client.failure == "keeps FS_MASS=1.5 instead of 2"
    client.start_set("FS_IX", 1.0)
    client.poll(2.0)
    client.poll(2.5)
    client.poll(3.0)
    assert client.failure == "did not confirm FS_IX, sent 2 times"


@pytest.mark.parametrize(("error", "words"), [(1, "has no number"), (2, "refuses")])
def test_a_number_that_the_target_refuses_fails_at_once(error: int, words: str) -> None:
    client = PilClient()
    client.start_set("FS_MASS", 2.0)
    client.poll(0.0)
    client.receive(packed(mavlink.MAVLink_param_error_message(1, 191, b"FS_MASS", -1, error)), 0.1)
    assert client.failure == f"{words} FS_MASS=2"


def test_message_request_is_refused() -> None:
    client = PilClient()
    client.start_request("FS_PIL_STATUS")
    (message,) = mavlink.MAVLink(None, 1, 1).parse_buffer(client.poll(0.0))
    assert (message.command, message.param1) == (512, mavlink.MAVLINK_MSG_ID_FS_PIL_STATUS)
    client.receive(packed(mavlink.MAVLink_command_ack_message(400, 3)), 0.1)
    client.receive(packed(mavlink.MAVLink_command_ack_message(512, 0)), 0.1)
    assert client.failure is None
    client.receive(packed(mavlink.MAVLink_command_ack_message(512, 3)), 0.1)
    assert client.failure == "does not support FS_PIL_STATUS: it runs other firmware"


def test_temporarily_rejected_request_is_resent() -> None:
    """The target acknowledges, but its line is full: TEMPORARILY_REJECTED."""
    client = PilClient()
    client.start_request("FS_PIL_STATUS")
    client.poll(0.0)
    client.receive(packed(mavlink.MAVLink_command_ack_message(512, 1)), 0.1)
    assert client.failure is None
    deadline_s = client.next_deadline()
    assert deadline_s is not None
    (message,) = mavlink.MAVLink(None, 1, 1).parse_buffer(client.poll(deadline_s))
    assert message.get_type() == "COMMAND_LONG"


def test_texts_of_the_target_are_kept() -> None:
    client = PilClient()
    client.receive(packed(mavlink.MAVLink_statustext_message(2, b"Bad input")), 0.0)
    assert list(client.texts) == [(2, "Bad input")]


def test_after_a_silence_the_rest_of_a_frame_is_not_waited_for() -> None:
    client = stepping()
    client.receive(report(0)[:50], 0.1)
    assert client.poll(0.5)
    client.receive(report(0, REPEATED), 0.6)
    assert client.result is not None
    assert client.counters.bad == 1


@given(st.lists(st.binary(max_size=300), max_size=8), st.integers(0, 2**32))
def test_no_octets_raise_or_make_a_result(pieces: list[bytes], seed: int) -> None:
    rng = random.Random(seed)
    whole = report(0)
    for start in (PilClient.start_step, PilClient.start_set, PilClient.start_request):
        client = PilClient()
        arguments = {
            "start_step": (0, REST),
            "start_set": ("FS_MASS", 1.0),
            "start_request": ("FS_PIL_STATUS",),
        }
        start(client, *arguments[start.__name__])  # type: ignore[operator]
        client.poll(0.0)
        for piece in pieces:
            client.receive(piece, 0.1)
            damaged = bytearray(whole)
            damaged[rng.randrange(1, len(damaged))] ^= 1 << rng.randrange(8)
            client.receive(bytes(damaged), 0.1)
        assert client.result is None
        assert client.failure is None
