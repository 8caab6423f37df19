"""The firmware's application: the baud rate of its line, changed at run time."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

import pytest

from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import START_BAUD, Target, command, kinds

FAST, OTHER = 921_600, 460_800
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = (
    mavlink.MAV_RESULT_ACCEPTED,
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
    mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_RESULT_UNSUPPORTED,
)
RETURNED = "Baud rate: no frame came, back at the former one"


@pytest.fixture
def target() -> Iterator[Target]:
    made = Target(bauds=(START_BAUD, FAST, OTHER))
    made.poll()
    made.heard()
    yield made
    made.close()


def set_baud(target: Target, baud: float) -> int:
    """Command a rate; return the result, after the acknowledgement has left."""
    (ack,) = target.ask(command(mavlink.MAV_CMD_FS_SET_BAUD_RATE, baud))
    assert ack.command == mavlink.MAV_CMD_FS_SET_BAUD_RATE
    return int(ack.result)


def at_rate(target: Target, baud: int) -> None:
    """Change to a rate and confirm it by a frame."""
    assert set_baud(target, baud) == ACCEPTED
    target.poll(1)
    assert target.request("FS_PIL_IDENTITY").baud == target.baud == baud


def noise(target: Target, for_ms: int, each_ms: int = 100, seed: int = 1) -> None:
    """Let octets come that are no frame, as from a host at another rate."""
    rng = random.Random(seed)
    for _ in range(for_ms // each_ms):
        target.give(bytes(rng.choice((0x00, 0x80, 0xE0, 0xFF)) for _ in range(30)))
        target.poll(each_ms)


def test_rate_changes_after_the_acknowledgement_has_left(target: Target) -> None:
    target.give(target.pack(command(mavlink.MAV_CMD_FS_SET_BAUD_RATE, FAST)))
    target.poll(1)
    assert target.baud == START_BAUD  # it still waits in the outbox
    assert kinds(target.heard()) == ["COMMAND_ACK"]
    target.is_sending = True
    target.poll(1)
    assert (target.baud, target.wait_ms) == (START_BAUD, 1)
    target.is_sending = False
    target.poll(1)
    assert target.baud == FAST


def test_rate_stays_after_a_frame_at_it(target: Target) -> None:
    at_rate(target, FAST)
    target.poll(60_000)
    target.heard()
    assert target.baud == FAST
    at_rate(target, OTHER)


def test_rate_without_a_frame_goes_back(target: Target) -> None:
    assert set_baud(target, FAST) == ACCEPTED
    target.poll(1)
    assert target.wait_ms == 999  # of the heartbeat; the trial ends 1 ms later
    target.poll(999)
    target.heard()
    assert (target.baud, target.wait_ms) == (FAST, 1)
    texts = target.text_after(lambda: target.poll(1))
    assert target.baud == START_BAUD
    assert [text for _, text in texts] == [RETURNED]
    assert target.request("FS_PIL_IDENTITY").baud == START_BAUD


def test_a_second_change_goes_back_to_the_first(target: Target) -> None:
    at_rate(target, FAST)
    assert set_baud(target, OTHER) == ACCEPTED
    target.poll(1)
    assert target.baud == OTHER
    for _ in range(3):
        target.poll(1_000)
        target.heard()
    assert target.baud == FAST


def test_octets_without_a_frame_bring_the_first_rate_back(target: Target) -> None:
    at_rate(target, FAST)
    noise(target, 1_000)
    assert target.baud == FAST
    noise(target, 300)
    target.heard()
    target.poll(1)
    target.heard()
    target.poll(1)
    assert target.baud == START_BAUD


def test_frames_among_noise_keep_the_rate(target: Target) -> None:
    at_rate(target, FAST)
    for seed in range(20):
        noise(target, 500, seed=seed)
        target.poll(30)  # what is held is given up
        target.give(target.pack(mavlink.MAVLink_ping_message(1, 1, 0, 0)))
        target.poll(1)
        target.heard()
    assert target.baud == FAST


def test_noise_with_pauses_keeps_the_rate(target: Target) -> None:
    at_rate(target, FAST)
    for _ in range(10):
        noise(target, 100)
        target.poll(2_000)
        target.heard()
    assert target.baud == FAST


@pytest.mark.parametrize(
    ("pauses_ms", "baud"), [((1_000,), FAST), ((500, 499), FAST), ((500, 500), START_BAUD)]
)
def test_noise_counts_from_the_first_octet_after_a_pause_of_1_s(
    target: Target, pauses_ms: tuple[int, ...], baud: int
) -> None:
    at_rate(target, FAST)
    target.poll(1)
    for pause_ms in (1, *pauses_ms):
        target.give(b"\0")
        target.poll(pause_ms)
    target.heard()
    target.poll(1)
    assert target.baud == baud


def test_noise_at_the_first_rate_changes_nothing(target: Target) -> None:
    noise(target, 5_000)
    assert target.baud == START_BAUD
    assert target.request("FS_PIL_IDENTITY").baud == START_BAUD


@pytest.mark.parametrize("baud", [9_599, 0, -1, math.nan, math.inf, 20_000_002, 250_000])
def test_a_rate_that_the_line_cannot_have_is_denied(target: Target, baud: float) -> None:
    assert set_baud(target, baud) == DENIED
    target.poll(1)
    assert target.baud == START_BAUD


@pytest.mark.parametrize("baud", [9_599, 20_000_002])
def test_a_rate_out_of_range_is_denied_although_the_line_can_have_it(baud: int) -> None:
    target = Target(bauds=(baud,))
    target.poll()
    target.heard()
    assert set_baud(target, baud) == DENIED
    target.close()


@pytest.mark.parametrize("baud", [9_600, 20_000_000])
def test_slowest_and_fastest_rate_are_accepted(baud: int) -> None:
    target = Target(bauds=(baud,))
    target.poll()
    target.heard()
    assert set_baud(target, baud) == ACCEPTED
    target.poll(1)
    assert target.baud == baud
    target.close()


def test_a_change_waits_for_the_one_before(target: Target) -> None:
    target.is_sending = True
    assert set_baud(target, FAST) == ACCEPTED
    assert set_baud(target, OTHER) == TEMPORARILY_REJECTED
    target.is_sending = False
    target.poll(1)
    assert set_baud(target, OTHER) == ACCEPTED  # the command is a frame at the new rate: it ends the trial


def test_the_present_rate_is_accepted_and_stays(target: Target) -> None:
    assert set_baud(target, START_BAUD) == ACCEPTED
    target.poll(5_000)
    assert target.baud == START_BAUD


def test_a_line_without_rates_does_not_know_the_command() -> None:
    target = Target()
    assert set_baud(target, FAST) == UNSUPPORTED
    target.close()


def test_the_terminal_of_the_host_takes_every_rate() -> None:
    target = Target(own_port=True)
    assert set_baud(target, 2_000_000) == ACCEPTED
    target.poll(1)
    assert target.request("FS_PIL_IDENTITY").baud == 2_000_000
    target.close()


def test_trial_counts_from_the_change_and_not_from_the_command(target: Target) -> None:
    target.is_sending = True
    assert set_baud(target, FAST) == ACCEPTED
    target.poll(500)
    target.is_sending = False
    target.poll(1)
    target.poll(999)
    target.heard()
    target.poll(1)
    assert target.baud == FAST
    target.poll(1)
    assert target.baud == START_BAUD


def test_a_change_that_cannot_begin_is_dropped(target: Target) -> None:
    target.is_sending = True
    assert set_baud(target, FAST) == ACCEPTED
    target.poll(1_000)
    target.heard()
    target.is_sending = False
    target.poll(1)
    assert target.baud == START_BAUD
    assert set_baud(target, OTHER) == ACCEPTED
    target.poll(1)
    assert target.baud == OTHER


def test_a_return_that_cannot_begin_is_tried_again(target: Target) -> None:
    assert set_baud(target, FAST) == ACCEPTED
    target.poll(1)
    assert target.baud == FAST
    target.is_sending = True
    for _ in range(4):
        target.poll(1_000)
    target.is_sending = False
    for _ in range(3):
        target.heard()
        target.poll(1)
    assert target.baud == START_BAUD
