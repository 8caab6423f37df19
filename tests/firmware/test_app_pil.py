"""The firmware's application: steps of the loops, answered once and again, refused, and the safe state."""

from __future__ import annotations

import math
from contextlib import closing

import numpy as np
import pytest

from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import (
    ABOVE,
    BAD_INPUT,
    CYCLES,
    INSTRUCTIONS,
    LEVEL,
    NANOSECONDS,
    OUT_OF_ORDER,
    OUTER_DUE,
    OVERRUN,
    READY,
    REPEATED,
    RESET,
    RESTARTED,
    SAFE,
    SET_TARGET,
    STEPPING,
    Target,
    command,
    kinds,
    step,
)
from tests.firmware.core_support import Core, Loops

EMERGENCY = mavlink.MAV_SEVERITY_EMERGENCY
STANDBY, ACTIVE, CRITICAL, IN_EMERGENCY = 3, 4, 5, 6
FIELDS = ("attitude_target", "reference", "wrench", "wrench_achieved", "rotor_command")


def numbers(report: object) -> list[float]:
    """Return what the loops computed, in the order of fs_loop_output."""
    return [value for name in FIELDS for value in getattr(report, name)]


def random_steps(count: int) -> list[tuple[int, list[float], list[float]]]:
    """Return flags, state and setpoint of a flight that changes between setpoints and targets."""
    rng = np.random.default_rng(5)
    made = []
    for index in range(count):
        attitude = np.array([1.0, 0.0, 0.0, 0.0]) + 0.2 * rng.standard_normal(4)
        state = [*rng.standard_normal(6), *(attitude / np.linalg.norm(attitude)), *rng.standard_normal(3)]
        flags = (0, OUTER_DUE, SET_TARGET, RESET | OUTER_DUE)[rng.choice(4, p=[0.75, 0.18, 0.05, 0.02])]
        setpoint = rng.standard_normal(11)
        if flags & SET_TARGET:
            setpoint = np.array([*(attitude / np.linalg.norm(attitude)), 5.0, *[0.0] * 6])
        flags |= RESET if index == 0 else 0
        made.append((flags, np.float32(state).tolist(), np.float32(setpoint).tolist()))
    return made


def test_a_report_has_the_very_bits_of_the_loops(target: Target) -> None:
    """Steps of a random flight through the line, and the same steps given to the loops directly."""
    steps = random_steps(400)
    reports = [target.step(at, *step) for at, step in enumerate(steps)]
    targets = [[*setpoint[:5]] if flags & SET_TARGET else [1.0, 0, 0, 0, 0] for flags, _, setpoint in steps]
    rows, status = Loops(Core("float"), {}).run(
        [state for _, state, _ in steps],
        [setpoint for _, _, setpoint in steps],
        targets,
        [flags for flags, _, _ in steps],
    )
    assert [report.step for report in reports] == list(range(400))
    assert [report.status for report in reports] == status.tolist()
    assert np.float32([numbers(report) for report in reports]).tobytes() == np.float32(rows).tobytes()
    assert len({report.rotor_command[0] for report in reports}) > 200  # they did fly
    assert target.status().steps == 400


def test_a_build_with_double_reports_the_same_flight() -> None:
    steps = random_steps(50)
    single, double = Target(), Target(real="double")
    for at, (flags, state, setpoint) in enumerate(steps):
        one, two = (numbers(t.step(at, flags, state, setpoint)) for t in (single, double))
        np.testing.assert_allclose(one, two, rtol=2e-3, atol=2e-3)
    assert double.request("FS_PIL_IDENTITY").real_octets == 8
    single.close()
    double.close()


def test_costs_are_differences_of_the_clock_also_when_it_wraps() -> None:
    """The loops ask for the time before and after each stage; it stands 5 before its end at first."""
    times = [0xFFFF_FFFB, 0, 100, 400, 1400, 2000]
    target = Target(ticks=times)
    assert target.step(0, RESET | OUTER_DUE).cycles == [100, 300, 1000, 2005]
    target.close()


def test_costs_are_told_without_the_readings_of_the_clock() -> None:
    """10 for each of six readings: the stages have one each, the whole step five."""
    target = Target(ticks=[1000, 1010, 1210, 1410, 1460, 1500], overhead=10)
    assert target.request("FS_PIL_IDENTITY").clock_overhead == 10
    assert target.step(0, RESET | OUTER_DUE).cycles == [190, 190, 40, 450]
    target.close()


def test_a_cost_below_that_of_the_clock_is_zero() -> None:
    target = Target(ticks=[5 * at for at in range(6)], overhead=10)
    assert target.step(0, RESET | OUTER_DUE).cycles == [0, 0, 0, 0]
    target.close()


def test_a_repeated_step_is_answered_again_and_not_computed_again(target: Target) -> None:
    aside = (0.3, 0.2, *ABOVE[2:])
    first = target.step(0, RESET | OUTER_DUE, setpoint=aside)
    second, again, more = target.step(1), target.step(1), target.step(1)
    assert again.status == more.status == second.status | REPEATED
    assert numbers(again) == numbers(more) == numbers(second) != numbers(first)
    other = Target()  # which hears each step once
    other.step(0, RESET | OUTER_DUE, setpoint=aside)
    other.step(1)
    assert numbers(target.step(2)) == numbers(other.step(2))
    assert (target.status().steps, target.status().repeats) == (3, 2)
    other.close()


@pytest.mark.parametrize("number", [0, 2, 4, 1_000_000, 2**32 - 1])
def test_a_wrong_number_is_refused_with_the_expected_one(target: Target, number: int) -> None:
    for at in range(3):
        expected = target.step(at, RESET if at == 0 else 0)
    moved = [*LEVEL[:3], 1.0, *LEVEL[4:]]
    refusal = target.step(number, 0, moved)
    assert (refusal.step, refusal.status) == (3, OUT_OF_ORDER)
    assert set(numbers(refusal)) == {0.0}
    repeated = target.step(2)
    assert (repeated.status, numbers(repeated)) == (expected.status | REPEATED, numbers(expected))
    assert target.step(3).status & OUT_OF_ORDER == 0
    assert (target.status().steps, target.status().out_of_order) == (4, 1)


def test_numbers_pass_from_the_largest_to_zero(target: Target) -> None:
    target.step(2**32 - 1, RESET)
    assert target.step(0).status & OUT_OF_ORDER == 0


def test_a_flight_begins_with_any_number_and_forgets_the_one_before(target: Target) -> None:
    """Also with the number of the last step, when anything else in it differs: it is another host's."""
    fresh = Target()
    begun = numbers(fresh.step(7, RESET | OUTER_DUE))
    target.step(0, RESET | OUTER_DUE)
    for at in range(1, 8):
        target.step(at, OUTER_DUE, setpoint=(5.0, *ABOVE[1:]))
    assert numbers(target.step(7, RESET | OUTER_DUE)) == begun
    assert target.status().repeats == 0
    fresh.close()


@pytest.mark.parametrize("change", ["state", "setpoint"])
def test_the_last_number_with_other_content_is_no_repeated_step(target: Target, change: str) -> None:
    """With RESET it begins a flight, without it is out of order: never is it answered from memory."""
    other = {change: (0.5, *{"state": LEVEL, "setpoint": ABOVE}[change][1:])}
    for flags in (RESET | OUTER_DUE, OUTER_DUE):
        target.step(6, RESET)
        target.step(7, OUTER_DUE)
        report = target.step(7, flags, **other)
        assert report.status & REPEATED == 0
        assert bool(report.status & OUT_OF_ORDER) == (flags == OUTER_DUE)
    target.step(3, RESET | OUTER_DUE)
    assert target.step(3, RESET | OUTER_DUE, **other).status & REPEATED == 0


def test_a_flight_that_begins_alike_with_other_numbers_is_computed(target: Target) -> None:
    """A host that tried one step, set a gain and begins anew must not be told what the old gain gave."""
    gain = mavlink.MAVLink_param_set_message(1, 1, b"POS_Z_P", 3.0, 9)
    before = target.step(0, RESET | OUTER_DUE)
    target.ask(gain)
    after = target.step(0, RESET | OUTER_DUE)
    assert after.status & REPEATED == 0
    assert numbers(after) != numbers(before)
    target.step(1)
    target.ask(gain)
    assert target.step(1).status & REPEATED  # within a flight a repeated step stays one


def test_without_a_flight_step_0_begins_one(target: Target) -> None:
    assert target.step(5).status == OUT_OF_ORDER
    assert target.step(0).status & OUT_OF_ORDER == 0
    assert target.state == STEPPING


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
    """The parameters are at their defaults, and everybody is told; only a sound step with RESET flies again."""
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


def test_finite_input_beyond_all_sense_is_the_loops_business(target: Target) -> None:
    """They repeat their last output and say so, as in Python; nothing not finite leaves the target."""
    target.step(0, RESET | OUTER_DUE)
    report = target.step(1, OUTER_DUE, [3e38] * 13, [-3e38] * 11)
    assert report.status & 0xFFFF
    assert all(map(math.isfinite, numbers(report)))
    assert target.state == STEPPING


@pytest.mark.parametrize(
    ("unit", "clock_hz", "cost", "overruns"),
    [
        (CYCLES, 200_000_000, 400_001, 1),  # the period of 500 Hz is 400 000 cycles
        (CYCLES, 200_000_000, 399_999, 0),
        (CYCLES, 0, 4_000_000_000, 0),  # nobody knows how long a cycle is
        (NANOSECONDS, 0, 2_000_100, 1),
        (NANOSECONDS, 0, 1_999_900, 0),
        (INSTRUCTIONS, 25_000_000, 4_000_000_000, 0),
        (0, 25_000_000, 4_000_000_000, 0),
    ],
)
def test_a_step_longer_than_its_period_is_told(unit: int, clock_hz: int, cost: int, overruns: int) -> None:
    target = Target(ticks=[0, 0, 0, 0, cost], cost_unit=unit, clock_hz=clock_hz)  # no outer loop: 5 readings
    report = target.step(0, RESET)
    assert report.cycles[3] == cost
    assert bool(report.status & OVERRUN) == bool(overruns)
    assert target.status().loop_overruns == overruns
    target.close()


def test_a_host_that_falls_silent_leaves_the_target_ready_and_may_go_on(target: Target) -> None:
    target.poll()
    target.heard()
    target.step(0, RESET)
    target.poll(999)
    assert target.state == STEPPING
    assert target.wait_ms == 1
    target.poll(1)
    assert target.state == READY
    assert [m.system_status for m in target.heard() if m.get_type() == "HEARTBEAT"] == [STANDBY]
    assert target.step(1).status & OUT_OF_ORDER == 0
    target.poll(1_000)
    target.step(2)
    target.poll(1)
    assert target.state == STEPPING


def test_a_start_by_the_watchdog_is_told_and_refuses_to_go_on() -> None:
    """The parameters are lost: a flight under way must not go on with the defaults, not even at step 0."""
    target = Target(was_watchdog=True)
    target.poll()
    heard = {message.get_type(): message for message in target.heard()}
    assert heard["STATUSTEXT"].text == "Restarted by the watchdog: parameters are lost"
    assert heard["HEARTBEAT"].system_status == CRITICAL
    assert heard["FS_PIL_STATUS"].state == RESTARTED
    assert target.step(0).status == target.step(4711).status == OUT_OF_ORDER
    target.poll(1_000)
    assert "STATUSTEXT" not in kinds(target.heard())
    target.step(0, RESET)
    assert target.state == STEPPING
    target.poll(0)
    target.close()


def test_states_are_told_in_heartbeats(target: Target) -> None:
    def told() -> int:
        target.poll(1_000)
        return next(m.system_status for m in target.heard() if m.get_type() == "HEARTBEAT")

    assert told() == STANDBY
    target.poll(1_000)
    target.step(0, RESET)
    assert target.request("HEARTBEAT").system_status == ACTIVE
    assert told() == STANDBY  # a second without a step


def test_a_reboot_gives_the_loops_their_defaults_back_but_not_in_flight(target: Target) -> None:
    reboot = command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
    other = Target()
    default = numbers(other.step(0, RESET | OUTER_DUE))
    target.ask(mavlink.MAVLink_param_set_message(1, 1, b"POS_Z_P", 3.0, 9))
    assert numbers(target.step(0, RESET | OUTER_DUE)) != default
    (refusal,) = target.ask(reboot)
    assert refusal.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    target.poll(1_000)
    target.heard()
    answers = target.ask(reboot)
    assert kinds(answers) == ["STATUSTEXT", "COMMAND_ACK"]
    assert answers[1].result == mavlink.MAV_RESULT_ACCEPTED
    assert target.step(1).status == OUT_OF_ORDER
    assert numbers(target.step(0, RESET | OUTER_DUE)) == default
    assert target.status().steps == 2
    for what in (0.0, 2.0, math.nan):
        target.poll(1_000)
        target.heard()
        (refusal,) = target.ask(command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, what))
        assert refusal.result == mavlink.MAV_RESULT_DENIED
    other.close()
