"""The host's side of a free-running target, without I/O."""

from __future__ import annotations

import pytest

from flightstack.core.contract import LoopFlags
from flightstack.firmware.pil.free_running import DRIVE_TIMEOUT_S, MAX_DELAY_S, REST, Delays, FreeRunning
from flightstack.firmware.pil.steps import BAD_INPUT
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import FrameReader
from gcs_cli.pil.free_run import timing_lines

NUMBERS = [float(number) for number in range(24)]
RESET = LoopFlags.RESET
START_S = 4_294.9  # the time in µs wraps during the tests


def sent(frame: bytes) -> tuple[int, int]:
    """Return time and flags of a state."""
    (message,) = mavlink.MAVLink(None, 1, 1).parse_buffer(frame)
    assert [*message.state, *message.setpoint] == NUMBERS
    return message.time_us, message.flags


def drive(time_us: int, speed: float = 100.0, status: int = 0) -> bytes:
    message = mavlink.MAVLink_fs_pil_drive_message(
        time_us, status, 0, 0, [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 5.0], [speed] * 4 + [0.0] * 4
    )
    return bytes(message.pack(mavlink.MAVLink(None, 1, 1)))


def timing(**values: float) -> bytes:
    names = mavlink.MAVLink_fs_pil_timing_message.fieldnames
    message = mavlink.MAVLink_fs_pil_timing_message(*(values.get(name, 0) for name in names))
    return bytes(message.pack(mavlink.MAVLink(None, 1, 1)))


def receive(free: FreeRunning, data: bytes, now_s: float) -> None:
    for frame in FrameReader().feed(data):
        assert free.take_frame(frame, now_s)


def flying() -> tuple[FreeRunning, int]:
    free = FreeRunning()
    time_us, flags = sent(free.state(RESET, NUMBERS, START_S))
    assert flags == RESET
    return free, time_us


def test_reset_is_repeated_until_a_command_shows_its_arrival() -> None:
    free, time_us = flying()
    _, flags = sent(free.state(0, NUMBERS, START_S + 0.002))
    assert flags == RESET
    receive(free, drive(time_us), START_S + 0.003)
    _, flags = sent(free.state(0, NUMBERS, START_S + 0.004))
    assert flags == 0


def test_commands_of_earlier_flights_are_ignored() -> None:
    """Also that of a target that has had no state, whose time is 0."""
    free, time_us = flying()
    for earlier_us in (0, 12_345, (time_us - 1) & 0xFFFF_FFFF, (time_us + 2_000_000_000) & 0xFFFF_FFFF):
        receive(free, drive(earlier_us, 55.0), START_S + 0.01)
        assert free.commands == (0.0,) * 8
    receive(free, drive(time_us), START_S + 0.02)
    assert free.commands == (100.0,) * 4 + (0.0,) * 4
    assert free.attitude == (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 5.0)


def test_end_to_end_delay_is_from_the_state_to_its_command() -> None:
    free, time_us = flying()
    receive(free, drive(time_us), START_S + 0.004)
    later_us, _ = sent(free.state(0, NUMBERS, START_S + 0.1))
    assert later_us < time_us  # it wrapped
    receive(free, drive(later_us), START_S + 0.106)
    figures = free.figures()
    assert figures["commands"] == 2
    assert figures["end_to_end_mean_us"] == pytest.approx(5_000, abs=2)
    assert figures["end_to_end_max_us"] == pytest.approx(6_000, abs=2)


def test_a_target_in_its_safe_state_fails() -> None:
    free, time_us = flying()
    receive(free, drive(time_us, 0.0, BAD_INPUT), START_S + 0.3)
    assert free.failure(START_S + 0.3) == "stopped its rotors"
    free.state(RESET, NUMBERS, START_S + 0.4)
    assert free.failure(START_S + 0.4) is None


def test_a_target_without_commands_fails() -> None:
    free, _ = flying()
    assert free.failure(START_S + DRIVE_TIMEOUT_S) is None
    assert free.failure(START_S + DRIVE_TIMEOUT_S + 0.01) == "sent no rotor commands for 0.5 s"


def test_a_vehicle_at_rest_ignores_commands_and_their_absence() -> None:
    free, time_us = flying()
    _, flags = sent(free.state(REST, NUMBERS, START_S + 1.0))
    assert flags == REST
    assert free.failure(START_S + 100.0) is None
    receive(free, drive(time_us, 0.0, BAD_INPUT), START_S + 1.1)
    assert free.failure(START_S + 1.1) is None


def test_figures_cover_all_seconds_of_the_flight() -> None:
    free, _ = flying()
    receive(free, timing(ticks=100, missed=2, late_mean_us=10.0, late_max_us=40, period_us=2000), START_S)
    receive(
        free,
        timing(ticks=300, missed=1, late_mean_us=30.0, late_max_us=35, age_mean_us=7.0, age_max_us=9),
        START_S,
    )
    figures = free.figures()
    assert (figures["ticks"], figures["missed"], figures["late_max_us"]) == (400, 3, 40)
    assert figures["late_mean_us"] == pytest.approx(25.0)
    assert figures["state_age_mean_us"] == pytest.approx(7.0)
    lines = timing_lines(figures)
    assert lines[0] == "ticks    400, of which 3 were left out and 0 overran"
    assert lines[1].startswith("jitter   mean 25 µs, max 40 µs behind")


def test_without_a_second_there_is_no_timing() -> None:
    assert timing_lines(FreeRunning().figures()) == ["no timing: the target ran for less than a second"]


def test_commands_from_old_states_fail_the_flight() -> None:
    """The line is too slow for the states: each one arrives, but later and later."""
    free, _ = flying()
    for tick in range(100):
        time_us, _ = sent(free.state(0, NUMBERS, START_S + 0.01 * tick))
        receive(free, drive(time_us), START_S + 0.01 * tick + MAX_DELAY_S * (0.9 if tick < 20 else 1.5))
    assert (free.failure(START_S + 0.79) or "").startswith("flies states older than 0.1 s")
    assert free.failure(START_S + 0.77) is None


def test_a_pause_of_the_host_leaves_old_commands_and_goes_on() -> None:
    free, _ = flying()
    time_us, _ = sent(free.state(0, NUMBERS, START_S))
    receive(free, drive(time_us), START_S + 0.2)
    assert free.failure(START_S + 0.2) is None


def test_windows_without_delay_count_in_the_mean() -> None:
    free, _ = flying()
    receive(free, timing(ticks=100, late_mean_us=10.0, late_max_us=40), START_S)
    receive(free, timing(ticks=100), START_S)
    figures = free.figures()
    assert figures["late_mean_us"] == pytest.approx(5.0)
    assert figures["state_age_mean_us"] is None


def test_delays_have_a_percentile_to_a_bin() -> None:
    delays = Delays()
    for delay_us in range(1, 1_001):
        delays.add(delay_us)
    delays.add(9_000_000)
    figures = delays.figures()
    assert figures["end_to_end_p99_us"] == pytest.approx(991.0, abs=10.0)
    assert figures["end_to_end_max_us"] == 9_000_000.0
