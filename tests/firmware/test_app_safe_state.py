"""The safe state of the target: what leads to it, what it does, what ends it."""

from __future__ import annotations

import math
from contextlib import closing

import pytest

from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import (
    BAD_INPUT,
    LEVEL,
    OUT_OF_ORDER,
    OUTER_DUE,
    RESET,
    RESTARTED,
    SAFE,
    SET_TARGET,
    STEPPING,
    Target,
    command,
    kinds,
    numbers,
    step,
)

EMERGENCY, IN_EMERGENCY = mavlink.MAV_SEVERITY_EMERGENCY, mavlink.MAV_STATE_EMERGENCY
BAD = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("bad", BAD)
def test_a_state_that_is_not_finite_stops_the_rotors(bad: float) -> None:
    for place in range(13):
        with closing(Target()) as target:
            flies = target.step(0, RESET | OUTER_DUE)
            assert max(flies.rotor_command) > 0.0, place
            answers = target.ask(step(1, 0, [*LEVEL[:place], bad, *LEVEL[place + 1 :]]))
            assert kinds(answers) == ["FS_PIL_REPORT", "STATUSTEXT", "HEARTBEAT"], place
            report, text, heartbeat = answers
            assert report.step == 1, place
            assert report.status & BAD_INPUT, place
            assert set(numbers(report)) == {0.0}, place
            assert (text.severity, text.text) == (EMERGENCY, "State is not finite: rotors stopped"), place
            assert heartbeat.system_status == IN_EMERGENCY, place
            assert target.state == SAFE, place


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize(
    ("flags", "place", "is_read"),
    [
        (OUTER_DUE, 0, True),
        (OUTER_DUE, 10, True),
        (SET_TARGET, 4, True),
        (SET_TARGET, 5, False),
        (0, 0, False),
    ],
)
def test_only_what_is_read_of_a_setpoint_must_be_finite(
    target: Target, flags: int, place: int, is_read: bool, bad: float
) -> None:
    setpoint = [1.0, *[0.0] * 10]
    setpoint[place] = bad
    report = target.step(0, RESET | flags, setpoint=setpoint)
    assert bool(report.status & BAD_INPUT) == is_read
    assert (target.state == SAFE) == is_read


@pytest.mark.parametrize("flags", [8, 1 << 16, 1 << 31, OUTER_DUE | SET_TARGET])
def test_flags_without_a_meaning_stop_the_rotors(target: Target, flags: int) -> None:
    texts = target.text_after(lambda: target.give(target.pack(step(0, flags | RESET))))
    assert texts == [(EMERGENCY, "Step with unknown flags: rotors stopped")]
    assert target.state == SAFE


def test_the_safe_state_ends_with_a_sound_reset_alone(target: Target) -> None:
    nan = [math.nan] * 13
    target.step(0, RESET)
    target.step(1, 0, nan)
    for at in (1, 2, 0, 77):
        refusal = target.step(at)
        assert (refusal.step, refusal.status & BAD_INPUT, set(numbers(refusal))) == (at, BAD_INPUT, {0.0})
    assert target.step(5, RESET, nan).status & BAD_INPUT
    assert target.state == SAFE
    target.poll(5_000)
    heartbeats = [m for m in target.heard() if m.get_type() == "HEARTBEAT"]
    assert [beat.system_status for beat in heartbeats] == [IN_EMERGENCY]
    assert target.status().safe_states == 1
    begun = target.step(9, RESET | OUTER_DUE)
    assert begun.status & (BAD_INPUT | OUT_OF_ORDER) == 0
    assert max(begun.rotor_command) > 0.0
    assert target.state == STEPPING
    assert target.step(10).status & OUT_OF_ORDER == 0


def test_answered_steps_are_not_repeated_in_the_safe_state(target: Target) -> None:
    """Their rotor commands are of the flight that ended."""
    target.step(0, RESET | OUTER_DUE)
    assert max(target.step(1).rotor_command) > 0.0
    target.step(2, 0, [math.nan] * 13)
    refusal = target.step(1)
    assert refusal.status & BAD_INPUT
    assert set(numbers(refusal)) == {0.0}
    assert target.status().repeats == 0


def test_the_text_is_said_once(target: Target) -> None:
    nan = [math.nan] * 13
    first = kinds(target.ask(step(0, RESET, nan)))
    assert [kinds(target.ask(step(0, RESET, nan))) for _ in range(3)] == [["FS_PIL_REPORT"]] * 3
    assert first.count("STATUSTEXT") == 1


def is_alarm(messages: list[object]) -> bool:
    """Tell whether an EMERGENCY text and heartbeat are among messages."""
    texts = [m.text for m in messages if m.get_type() == "STATUSTEXT" and m.severity == EMERGENCY]  # type: ignore[attr-defined]
    beats = [m for m in messages if m.get_type() == "HEARTBEAT" and m.system_status == IN_EMERGENCY]  # type: ignore[attr-defined]
    return texts == ["State is not finite: rotors stopped"] and len(beats) >= 1


@pytest.mark.parametrize("news", [0, 40])
def test_an_alarm_needs_no_room_that_others_may_not_take(news: int) -> None:
    """News and answers have filled what they may fill of the outbox when the bad input comes."""
    for answers in range(0, 56, 4):
        with closing(Target()) as target:
            target.step(0, RESET)
            for _ in range(news):
                target.poll(1_000)
            for _ in range(answers):
                target.give(target.pack(mavlink.MAVLink_ping_message(1, 1, 0, 0)))
            target.give(target.pack(step(1, 0, [math.nan] * 13)))
            assert is_alarm(target.heard()), answers


def test_an_alarm_waits_for_room_and_is_told_once(target: Target) -> None:
    """Reports have filled the outbox to the last octet."""
    target.poll()
    target.step(0, RESET)
    for _ in range(20):
        target.give(target.pack(step(0, RESET)))
    target.give(target.pack(step(1, 0, [math.nan] * 13)))
    assert target.state == SAFE
    dropped = "FS_PIL_REPORT"
    for _ in range(5):
        target.poll(1)
    assert target.wait_ms == 20
    assert set(kinds(target.heard())) == {dropped}
    counted = target.status().dropped_frames
    target.poll(1)
    assert is_alarm(target.heard())
    assert target.wait_ms > 20
    target.poll(1)
    assert target.heard() == []
    assert target.status().dropped_frames == counted  # an alarm that waits is none of them


def test_the_heartbeat_of_the_safe_state_needs_no_room_that_others_may_not_take(target: Target) -> None:
    target.step(0, RESET)
    target.step(1, 0, [math.nan] * 13)
    for _ in range(40):
        target.give(target.pack(mavlink.MAVLink_ping_message(1, 1, 0, 0)))
    target.poll(1_000)
    assert "HEARTBEAT" in kinds(target.heard())


def test_a_reboot_does_not_end_the_safe_state(target: Target) -> None:
    """A restart sets the parameters to their defaults and announces it; only a sound step with RESET flies again."""
    target.ask(mavlink.MAVLink_param_set_message(1, 1, b"POS_Z_P", 3.0, 9))
    target.step(0, RESET)
    target.step(1, 0, [math.nan] * 13)
    text, heartbeat, ack = target.ask(command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1))
    assert (text.severity, text.text) == (2, "Parameters at defaults; stopped until RESET")
    assert heartbeat.system_status == IN_EMERGENCY
    assert ack.result == mavlink.MAV_RESULT_ACCEPTED
    assert target.state == SAFE
    assert target.step(0).status == BAD_INPUT
    fresh = Target()
    assert numbers(target.step(0, RESET | OUTER_DUE)) == numbers(fresh.step(0, RESET | OUTER_DUE))
    assert target.state == STEPPING
    fresh.close()


def test_a_reboot_does_not_hide_a_restart_by_the_watchdog() -> None:
    target = Target(was_watchdog=True)
    target.poll()
    target.heard()
    assert kinds(target.ask(command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)))[0] == "STATUSTEXT"
    assert target.state == RESTARTED
    assert target.step(0).status == OUT_OF_ORDER
    assert target.step(0, RESET).status & OUT_OF_ORDER == 0
    target.close()
