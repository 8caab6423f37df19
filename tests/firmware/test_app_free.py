"""The firmware's application, free-running: ticks by its own timer, jitter, age of the state, safe state."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import (
    ABOVE,
    BAD_INPUT,
    LEVEL,
    NANOSECONDS,
    OUT_OF_ORDER,
    OUTER_DUE,
    OVERRUN,
    READY,
    RESET,
    SAFE,
    SET_TARGET,
    STEPPING,
    Target,
    command,
    free_run,
    kinds,
    state,
    step,
    write,
)
from tests.firmware.free_support import ACCEPTED, FREE, PERIOD_US, at, drives, started, timing

REST = 16
REJECTED, DENIED = (
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
    mavlink.MAV_RESULT_DENIED,
)


@pytest.fixture
def target() -> Iterator[Target]:
    made = Target()
    started(made)
    yield made
    made.close()


@pytest.mark.parametrize("stuck_us", [0, 1, -1])
def test_microseconds_that_stand_still_are_unsupported(stuck_us: int) -> None:
    target = Target()
    for _ in range(3):
        target.poll(1)
        target.run(stuck_us)
    assert free_run(target, 1, 1) == mavlink.MAV_RESULT_UNSUPPORTED
    target.run(stuck_us + 1)
    assert free_run(target, 1, 1) == ACCEPTED
    target.close()


def test_ticks_fly_the_bits_of_steps(target: Target) -> None:
    """The target decides when the outer loop is due: in every fourth tick, from the first one of each flight."""
    other = Target()
    for each in (target, other):
        each.ask(write("FS_OUTER_DIV", 4.0))
    rng, first = np.random.default_rng(3), 0
    at(target, 0)
    for tick in range(60):
        values = np.float32([*rng.normal(size=6), 1.0, *0.1 * rng.normal(size=6)]).tolist()
        setpoint = np.float32(rng.normal(size=11)).tolist()
        given = SET_TARGET if tick in (20, 24) else 0
        if given:
            setpoint = [1.0, 0.0, 0.0, 0.0, 5.0, *[0.0] * 6]
        flags = RESET if tick in (0, 33) else 0
        first = tick if flags else first
        assert at(target, PERIOD_US * tick + 900, state(tick, flags | given, values, setpoint)) == []
        (drive,) = at(target, PERIOD_US * (tick + 1))
        due = (given or OUTER_DUE) if (tick - first) % 4 == 0 else 0
        report = other.step(tick, flags | due, values, setpoint)
        assert drive.rotor_command == report.rotor_command
        assert drive.reference == report.reference[:4]
        assert drive.attitude_target == report.attitude_target
        assert (drive.state_time_us, drive.status) == (tick, report.status)
        assert (drive.age_us, drive.late_us) == (1_100, 0)
    other.close()


def test_ticks_come_at_deadlines_without_drift(target: Target) -> None:
    at(target, 10_000, state(0, RESET))
    late = [30, 0, 700, 1_999]
    for tick, each in enumerate(late, 1):
        assert at(target, 10_000 + PERIOD_US * tick - 1) == []
        assert target.run_wait_us == 1
        (drive,) = at(target, 10_000 + PERIOD_US * tick + each)
        assert drive.late_us == each
    told = timing(target)
    assert (told.ticks, told.missed, told.late_max_us, told.period_us) == (5, 0, 1_999, PERIOD_US)
    assert told.late_mean_us == pytest.approx(sum(late) / 5)


def test_ticks_that_are_late_by_a_period_are_left_out(target: Target) -> None:
    at(target, 0, state(0, RESET))
    (drive,) = at(target, PERIOD_US * 4 + 5)
    assert drive.late_us == 3 * PERIOD_US + 5
    assert at(target, PERIOD_US * 5 - 1) == []
    assert len(at(target, PERIOD_US * 5)) == 1
    assert timing(target).missed == 3


def test_times_wrap(target: Target) -> None:
    begin = 2**32 - 5 * PERIOD_US
    at(target, begin, state(2**32 - 1, RESET))
    for tick in range(1, 10):
        (drive,) = at(target, begin + PERIOD_US * tick, state(tick))
        assert (drive.late_us, drive.age_us) == (0, PERIOD_US)


def test_the_newest_state_flies_and_its_age_is_told(target: Target) -> None:
    at(target, 0, state(7, RESET))
    at(target, 300, state(8))
    at(target, 500, state(9))
    target.poll(10)
    assert target.heard() == []  # figures come once a second
    (first,) = at(target, PERIOD_US)
    second, third = (at(target, tick * PERIOD_US)[0] for tick in (2, 3))
    assert (first.state_time_us, first.age_us) == (9, 1_500)
    assert (second.state_time_us, second.age_us, third.age_us) == (9, 3_500, 5_500)
    told = timing(target)
    assert (told.states, told.skipped, told.held, told.age_max_us) == (3, 2, 2, 5_500)
    assert told.age_mean_us == pytest.approx(3_500.0)
    at(target, 4 * PERIOD_US)
    assert timing(target).age_mean_us == pytest.approx(7_500.0)  # of the next second


def test_rotors_stop_when_states_stop() -> None:
    target = Target()
    started(target, timeout_ms=20)
    at(target, 0, state(1, RESET))
    for tick in range(1, 11):
        (drive,) = at(target, PERIOD_US * tick)
        assert max(drive.rotor_command) > 0.0
    target.run(11 * PERIOD_US)
    heard = target.heard()
    assert kinds(heard) == ["STATUSTEXT", "HEARTBEAT", "FS_PIL_DRIVE"]
    assert heard[0].text == "No state in time: rotors stopped"
    assert (heard[2].status, set(heard[2].rotor_command)) == (BAD_INPUT, {0.0})
    assert target.state == SAFE
    (drive,) = at(target, 12 * PERIOD_US, state(2))  # states come again, but nothing flies until RESET
    assert set(drive.rotor_command) == {0.0}
    assert set(at(target, 13 * PERIOD_US)[0].rotor_command) == {0.0}
    told = timing(target)
    assert (told.timeouts, target.status().safe_states) == (1, 1)
    at(target, 14 * PERIOD_US, state(3, RESET))
    (drive,) = at(target, 15 * PERIOD_US)
    assert max(drive.rotor_command) > 0.0
    assert target.state == FREE
    target.close()


@pytest.mark.parametrize("over_us", [0, 1])
@pytest.mark.parametrize(("given_ms", "timeout_ms"), [(0, 100), (1, 1), (6, 6), (10_000, 10_000)])
def test_rotors_stop_after_the_given_timeout_or_100_ms(given_ms: int, timeout_ms: int, over_us: int) -> None:
    target = Target()
    started(target, timeout_ms=given_ms)
    end_us = timeout_ms * 1_000 // PERIOD_US * PERIOD_US + PERIOD_US
    target.run(0)
    at(target, end_us - timeout_ms * 1_000 - over_us, state(1, RESET))
    target.run(end_us)
    assert target.state == (SAFE if over_us else FREE)
    target.close()


def test_flags_of_a_state_are_those_of_steps_and_rest(target: Target) -> None:
    at(target, 0, state(1, RESET | OUTER_DUE))
    assert max(at(target, PERIOD_US)[0].rotor_command) > 0.0
    texts = target.text_after(lambda: target.give(target.pack(state(2, 8))))
    assert [text for _, text in texts] == ["Step with unknown flags: rotors stopped"]


def test_a_period_may_have_more_than_16_bits(target: Target) -> None:
    target.ask(write("FS_INNER_HZ", 10.0))
    target.run(0)
    assert target.run_wait_us == 100_000


def test_a_state_of_the_run_before_is_not_skipped(target: Target) -> None:
    at(target, 0, state(1, RESET))
    assert free_run(target, 0) == free_run(target, 1, 1_000, 10_000) == ACCEPTED
    at(target, PERIOD_US, state(2, RESET))
    assert timing(target).skipped == 0


def test_costs_of_ticks_are_told_without_the_readings_of_the_clock() -> None:
    target = Target(ticks=[1000, 1010, 1210, 1410, 1460, 1500], overhead=10)
    started(target)
    at(target, 0, state(1, RESET))
    at(target, PERIOD_US)
    assert timing(target).cost_max == 450
    target.close()


@pytest.mark.parametrize("place", [0, 12, 13, 23])
def test_a_state_that_is_not_finite_stops_the_rotors(target: Target, place: int) -> None:
    at(target, 0, state(1, RESET))
    numbers = [*LEVEL, *ABOVE, *[0.0] * 8][:24]
    numbers[place] = math.nan
    for _ in range(2):
        target.give(target.pack(state(2, RESET, numbers[:13], numbers[13:])))
    assert [message.severity for message in target.heard() if message.get_type() == "STATUSTEXT"] == [0]
    (drive,) = at(target, PERIOD_US)
    assert (drive.status, set(drive.rotor_command)) == (BAD_INPUT, {0.0})


def test_a_vehicle_at_rest_needs_no_states(target: Target) -> None:
    at(target, 0, state(1, RESET))
    at(target, PERIOD_US, state(2, REST))
    (drive,) = at(target, 2 * PERIOD_US)
    assert (drive.status, set(drive.rotor_command)) == (0, {0.0})
    at(target, 1_000_000)
    assert target.state == FREE
    assert timing(target).timeouts == 0


def test_nothing_flies_before_a_state_with_reset(target: Target) -> None:
    at(target, 0, state(1))
    (drive,) = at(target, PERIOD_US)
    assert set(drive.rotor_command) == {0.0}


def test_commands_are_told_in_every_so_many_ticks() -> None:
    target = Target()
    started(target, every=5)
    told = [len(at(target, PERIOD_US * tick, state(tick, RESET if tick == 0 else 0))) for tick in range(20)]
    assert told == [0, 0, 0, 0, 1] * 4
    at(target, PERIOD_US * 20, state(20))
    at(target, PERIOD_US * 21, state(21))  # two ticks that are not told, and count for no other run
    assert free_run(target, 0) == free_run(target, 1, 5) == ACCEPTED
    again = range(22, 32)
    told = [len(at(target, PERIOD_US * tick, state(tick, RESET if tick == 22 else 0))) for tick in again]
    assert told == [0, 0, 0, 0, 1] * 2
    target.close()


def test_old_commands_do_not_wait_on_a_slow_line(target: Target) -> None:
    target.run(0)
    target.give(target.pack(state(0, RESET)))
    for tick in range(1, 50):
        target.run(PERIOD_US * tick)
    assert len(drives(target)) <= 3


def test_overruns_are_counted() -> None:
    """The third of the clock's readings in a tick without outer loop is late."""
    target = Target(ticks=[0, 0, 0, 0, 0, 2_000_001], cost_unit=NANOSECONDS)
    started(target)
    at(target, 0, state(1, RESET))
    (drive,) = at(target, PERIOD_US)
    assert drive.status == OVERRUN
    at(target, 2 * PERIOD_US)
    told = timing(target)
    assert (told.overruns, told.cost_max, target.status().loop_overruns) == (1, 2_000_001, 1)
    target.close()


def test_stopping_ends_the_ticks(target: Target) -> None:
    at(target, 0, state(1, RESET))
    assert free_run(target, 0) == ACCEPTED
    assert (target.state, target.run_wait_us) == (READY, 2**32 - 1)
    assert at(target, 10 * PERIOD_US, state(2, RESET)) == []
    target.poll(1_000)
    assert "FS_PIL_TIMING" not in kinds(target.heard())
    assert free_run(target, 1, 1) == ACCEPTED  # although the flight had not ended


def test_ticks_begin_anew_after_a_pause(target: Target) -> None:
    at(target, 0, state(1, RESET))
    assert free_run(target, 0) == ACCEPTED
    at(target, 50 * PERIOD_US)
    assert free_run(target, 1, 1) == ACCEPTED
    at(target, 100 * PERIOD_US + 7, state(2, RESET))
    (drive,) = at(target, 101 * PERIOD_US + 7)
    assert drive.late_us == 0
    assert timing(target).missed == 0


def test_stopping_does_not_end_the_safe_state(target: Target) -> None:
    at(target, 0, state(1, RESET))
    target.run(200_000)
    free_run(target, 0)
    assert target.state == SAFE
    free_run(target, 1, 1)
    assert target.state == SAFE


@pytest.mark.parametrize(
    "values", [(2,), (math.nan, 1), (1, 0), (1, 1_001), (1, math.nan), (1, 1, -1), (1, 1, 10_000.001)]
)
def test_a_command_out_of_range_is_denied(target: Target, values: tuple[float, ...]) -> None:
    assert free_run(target, *values) == DENIED


def test_a_port_without_microseconds_does_not_run_freely() -> None:
    target = Target()
    assert free_run(target, 1, 1) == mavlink.MAV_RESULT_UNSUPPORTED
    target.close()


def test_steps_and_free_running_exclude_each_other(target: Target) -> None:
    at(target, 0, state(1, RESET))
    assert free_run(target, 1, 1) == REJECTED  # in flight
    assert target.step(0, RESET).status == OUT_OF_ORDER
    target.give(target.pack(state(2, REST)))
    assert target.step(5).status == OUT_OF_ORDER
    assert target.run_wait_us == PERIOD_US  # the free run goes on
    assert target.step(0, RESET).status & OUT_OF_ORDER == 0  # another host begins a flight in lockstep
    assert target.state == STEPPING
    assert target.run_wait_us == 2**32 - 1
    assert free_run(target, 1, 1) == REJECTED
    reboot = command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
    target.poll(1_000)
    target.heard()
    assert free_run(target, 1, 1) == ACCEPTED
    assert target.ask(reboot)[0].result == REJECTED


def test_deadlines_and_heartbeats(target: Target) -> None:
    assert target.run_wait_us == 0  # the first tick is due at once
    target.run(0)
    assert target.run_wait_us == PERIOD_US
    target.run(PERIOD_US - 1)
    assert target.run_wait_us == 1
    assert target.request("HEARTBEAT").system_status == mavlink.MAV_STATE_ACTIVE


def test_a_target_at_rest_without_a_host_stops_its_ticks() -> None:
    target = Target()
    started(target)
    at(target, 0, state(1, RESET), state(2, REST))
    for _ in range(3):
        target.poll(4_000)
        target.heard()
        assert target.state == FREE
        at(target, target.now_ms * 1_000, state(3, REST))  # any frame will do
    target.poll(5_000)
    assert target.state == READY
    assert target.run_wait_us == 2**32 - 1
    target.close()


def test_the_safe_state_lasts_when_the_ticks_stop_without_a_host(target: Target) -> None:
    at(target, 0, state(1, RESET))
    target.run(200_000)
    target.poll(5_000)
    assert target.state == SAFE
    assert target.run_wait_us == 2**32 - 1


def test_the_time_of_a_refused_first_state_is_told(target: Target) -> None:
    """A host drops commands from before its flight: it could not tell why the rotors stand."""
    at(target, 0, state(77, RESET, [math.nan, *LEVEL[1:]]))
    (drive,) = at(target, PERIOD_US)
    assert (drive.state_time_us, drive.status) == (77, BAD_INPUT)


def test_the_mean_age_does_not_overflow() -> None:
    target = Target()
    started(target, timeout_ms=10_000)
    at(target, 0, state(1, RESET))
    for tick in range(1, 1_001):
        target.run(8_000_000 + tick)
        target.run(8_000_000 + tick * PERIOD_US)
    target.heard()
    assert timing(target).age_mean_us > 8_000_000
    target.close()


def test_figures_without_room_count_in_the_next_second(target: Target) -> None:
    at(target, 0, state(1, RESET))
    for _ in range(60):  # refused in flight, with a report each
        target.give(target.pack(step(3)))
    for passed_ms in (1_000, 10):
        target.poll(passed_ms)
        assert "FS_PIL_TIMING" not in kinds(target.heard())
    at(target, PERIOD_US)
    assert timing(target).ticks == 2


def test_a_baud_rate_changes_while_commands_are_sent() -> None:
    """At a rate that is too slow for them."""
    target = Target(bauds=(921_600,))
    started(target)
    target.give(target.pack(state(0, RESET)))
    target.give(target.pack(command(mavlink.MAV_CMD_FS_SET_BAUD_RATE, 921_600)))
    for tick in range(100):
        target.run(PERIOD_US * tick)
        target.take(20)
        target.poll(2)
    assert target.baud == 921_600
    target.close()
