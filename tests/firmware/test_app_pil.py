"""The firmware's application: steps of the loops, answered once and again, refused, and the safe state."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest

from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import (
    ABOVE,
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
    SET_TARGET,
    STEPPING,
    Target,
    command,
    kinds,
    library,
    numbers,
    random_steps,
)
from tests.firmware.core_support import Core, Loops

EMERGENCY = mavlink.MAV_SEVERITY_EMERGENCY
STANDBY, ACTIVE, CRITICAL, IN_EMERGENCY = 3, 4, 5, 6


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


def test_without_a_clock_there_are_no_costs() -> None:
    target = Target(ticks=None)
    assert target.request("FS_PIL_IDENTITY").clock_overhead == 0
    assert target.step(0, RESET | OUTER_DUE).cycles == [0, 0, 0, 0]
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
    assert numbers(target.step(1)) == numbers(second)  # also when it is not the last one
    assert (target.status().steps, target.status().repeats) == (3, 3)
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
        (CYCLES, 500, 1, 0),  # exactly a period, also in float
        (CYCLES, 500, 2, 1),
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


def test_the_wait_ends_when_steps_time_out(target: Target) -> None:
    target.poll()
    target.poll(300)
    target.step(0, RESET)
    target.poll(700)  # a heartbeat is due: the next one comes after the timeout
    assert (target.state, target.wait_ms) == (STEPPING, 300)


def test_each_number_of_a_step_reaches_its_place_of_the_input() -> None:
    """Also the yaw rate, which no built-in law uses: 13 numbers of the state, 11 of the setpoint, 5 of the target."""
    numbers_of_step = np.arange(1.0, 25.0, dtype=np.float32)
    step_in_memory = np.array([7, OUTER_DUE], np.uint32).tobytes() + numbers_of_step.tobytes()
    made = np.zeros(30, np.float32)
    library().fs_pil_to_input(step_in_memory, made.ctypes.data_as(ctypes.c_void_p))
    assert made[:24].tolist() == numbers_of_step.tolist()
    assert made[24:29].tolist() == numbers_of_step[13:18].tolist()
    assert made.view(np.uint16)[58] == OUTER_DUE


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
    for at in range(1, 9):
        target.step(at)  # as many as are kept to be answered again
    (refusal,) = target.ask(reboot)
    assert refusal.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    target.poll(1_000)
    target.heard()
    answers = target.ask(reboot)
    assert kinds(answers) == ["STATUSTEXT", "COMMAND_ACK"]
    assert answers[1].result == mavlink.MAV_RESULT_ACCEPTED
    assert {target.step(at).status for at in range(1, 9)} == {OUT_OF_ORDER}
    assert numbers(target.step(0, RESET | OUTER_DUE)) == default
    assert target.status().steps == 10
    for what in (0.0, 2.0, math.nan):
        target.poll(1_000)
        target.heard()
        (refusal,) = target.ask(command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, what))
        assert refusal.result == mavlink.MAV_RESULT_DENIED
    other.close()


def test_a_step_before_a_free_run_is_not_repeated_after_it(target: Target) -> None:
    target.step(0, RESET)
    assert not target.step(1).status & REPEATED
    assert target.step(1).status & REPEATED
    target.poll(5_000)  # the host is silent: the flight may go on, or another one begin
    target.run(-1)
    target.run(0)
    for on in (1, 0):
        (ack,) = (m for m in target.ask(command(mavlink.MAV_CMD_FS_FREE_RUN, on, 1)) if hasattr(m, "result"))
        assert ack.result == mavlink.MAV_RESULT_ACCEPTED
    assert target.step(1).status & (REPEATED | OUT_OF_ORDER) == OUT_OF_ORDER
