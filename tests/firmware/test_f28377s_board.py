"""The whole F28377S program on the simulated chip: PIL exchange, time, watchdog, lights, stack."""

from __future__ import annotations

import itertools
import random
from pathlib import Path
from typing import Any

import pytest

from flightstack.mavlink.dialect import mavlink
from tests.firmware.f28377s_support import (
    BREAK,
    CYCLES_PER_S,
    DARK,
    EDGE,
    FRAMING,
    HEARTBEAT_LIGHT,
    INT_RECEIVED,
    INT_TIMER0,
    LEVEL,
    LIT,
    PAUSE,
    POWER_ON,
    SAFE_LIGHT,
    WATCHDOG,
    Board,
    pil_step,
)
from tests.support.tools import NIGHTLY

OUTER_DUE, RESET = 1, 4
READY, STEPPING, SAFE, RESTARTED = range(4)


def of(messages: list[Any], name: str) -> list[Any]:
    """Return the messages of one kind."""
    return [message for message in messages if message.get_type() == name]


def exchange(board: Board, number: int, flags: int, spoil: dict[int, int] | None = None) -> list[Any]:
    """Send a step, run until it would be answered, return the reports; ``spoil`` puts items of the line at places."""
    frame = list(pil_step(number, flags))
    for place, what in (spoil or {}).items():
        frame[place] = what
    board.line(frame)
    board.run(octets=len(frame) + 200)
    return of(board.messages(), "FS_PIL_REPORT")


@pytest.mark.parametrize("flags", [EDGE] + NIGHTLY * [LEVEL], ids=["edge", "level"][: 1 + NIGHTLY])
def test_steps_are_answered_with_what_they_cost(flags: int, tmp_path: Path) -> None:
    board = Board(tmp_path, flags=flags)
    for number in range(20):
        (report,) = exchange(board, number, OUTER_DUE | (RESET if number == 0 else 0))
        assert (report.step, report.status >> 16) == (number, 0)
        assert 4.0 < report.wrench[0] < 7.0  # it hovers: the default vehicle weighs 5.4 N
        assert 200.0 < max(report.rotor_command) < 400.0
        # on this chip only calls of driverlib take time: those of the clock, which is left out
        assert report.cycles == [0, 0, 0, 0]
    assert (board.overruns, board.errors) == (0, 0)
    board.nothing_misused()


def test_costs_do_not_include_interrupts(tmp_path: Path) -> None:
    """Two strike at each reading of the clock. Of each, only the 10 cycles before its own first reading count."""
    board = Board(tmp_path)
    board.c.fake_strike_every(1)
    for number in range(5):
        (report,) = exchange(board, number, OUTER_DUE | (RESET if number == 0 else 0))
        assert report.cycles == [20, 20, 20, 100]
    assert board.c.fake_interrupts(INT_RECEIVED) > 1_000
    board.nothing_misused()


def test_what_is_computed_does_not_depend_on_the_line(tmp_path: Path) -> None:
    """Same numbers at another baud rate, with interrupts at other moments, and through the timer's wrap."""
    ways = [
        Board(tmp_path),
        Board(tmp_path, flags=EDGE, timer1=20_000),
        Board(tmp_path, options=("-DF28_BAUD=2500000UL",)),
    ]
    reports = [
        [exchange(board, n, OUTER_DUE | (RESET if n == 0 else 0))[0] for n in range(10)] for board in ways
    ]
    for name in ("attitude_target", "reference", "wrench", "wrench_achieved", "rotor_command"):
        values = [[getattr(report, name) for report in way] for way in reports]
        assert values[0] == values[1] == values[2]


def test_a_step_that_the_line_spoils_is_sent_again(tmp_path: Path) -> None:
    """A framing error, a break, a lost octet: no report; the same step again is answered once, and it flies on."""
    board, rng = Board(tmp_path), random.Random(4)
    assert len(exchange(board, 0, OUTER_DUE | RESET)) == 1
    for number in range(1, 25):
        place = rng.randrange(10, 90)
        spoil = [{place: 0x99 | FRAMING}, {place: BREAK}, {place: PAUSE}][number % 3]
        assert exchange(board, number, OUTER_DUE, spoil) == []
        (report,) = exchange(board, number, OUTER_DUE)
        assert (report.step, report.status >> 16) == (number, 0)
    assert board.errors == 16
    board.nothing_misused()


def test_a_report_that_was_lost_is_given_again(tmp_path: Path) -> None:
    board = Board(tmp_path)
    (first,) = exchange(board, 0, OUTER_DUE | RESET)
    (again,) = exchange(board, 0, OUTER_DUE | RESET)
    assert again.status >> 16 == 1  # REPEATED
    assert again.rotor_command == first.rotor_command
    board.nothing_misused()


def test_it_says_what_it_is_and_what_it_counted(tmp_path: Path) -> None:
    board = Board(tmp_path)
    board.line([1, 2, 3 | FRAMING, BREAK])
    board.run(ms=1_500)
    seen = board.messages()
    assert len(of(seen, "HEARTBEAT")) in (1, 2)
    status = of(seen, "FS_PIL_STATUS")[-1]
    assert (status.uart_errors, status.uart_overruns, status.state) == (2, 0, READY)
    assert status.stack_size == board.c.bench_stack_size()
    link = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    identity = mavlink.MAVLINK_MSG_ID_FS_PIL_IDENTITY
    request = mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, identity, *[0.0] * 6
    )
    board.line(request.pack(link))
    board.run(ms=100)
    (told,) = of(board.messages(), "FS_PIL_IDENTITY")
    assert (told.clock_hz, told.cost_unit, told.real_octets) == (CYCLES_PER_S, 1, 4)
    assert told.board.rstrip("\0") == "simulated chip"  # no test is taken for a board
    board.nothing_misused()


def test_all_parameters_come_through_the_small_ring(tmp_path: Path) -> None:
    """The list is several times as large as the rings; it is paced by the line and complete."""
    board = Board(tmp_path)
    link = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    board.line(mavlink.MAVLink_param_request_list_message(1, 1).pack(link))
    board.run(ms=1_500)
    values = of(board.messages(), "PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    assert len(values) > 50
    board.nothing_misused()


def test_a_busy_line_does_not_starve_the_rest(tmp_path: Path) -> None:
    """Steps without a pause while the parameters are listed: no octet is lost, every step is answered."""
    board = Board(tmp_path)
    link = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    board.line(mavlink.MAVLink_param_request_list_message(1, 1).pack(link))
    for number in range(60):
        board.line(pil_step(number, OUTER_DUE | (RESET if number == 0 else 0)))
        board.line([PAUSE] * 90)  # a report is longer than a step
    board.c.bench_run_line(200)
    board.run(ms=2_000)
    seen = board.messages()
    assert [report.step for report in of(seen, "FS_PIL_REPORT")] == list(range(60))
    assert of(seen, "BAD_DATA") == []
    assert (board.overruns, board.errors) == (0, 0)
    board.nothing_misused()


def test_milliseconds_and_cycles_agree_with_the_clock(tmp_path: Path) -> None:
    board = Board(tmp_path)
    ms, cycles, time = board.c.f28_now_ms(), board.c.f28_cycles(), board.c.fake_time()
    board.idle(ms=1_234)
    board.run(ms=766)
    passed = board.c.fake_time() - time
    assert board.c.f28_now_ms() - ms == pytest.approx(passed / 200_000, abs=1.01)
    without = passed - (board.c.f28_cycles() - cycles)
    assert (
        10 * 2_000 < without < 50 * board.c.fake_interrupts(INT_TIMER0)
    )  # the counter stands still in interrupts
    assert board.c.fake_interrupts(INT_TIMER0) == board.c.f28_now_ms()


def test_the_cost_counter_wraps_without_a_jump(tmp_path: Path) -> None:
    """After 2^32 cycles, 21.5 s, the timer begins again; differences modulo 2^32 stay right."""
    board = Board(tmp_path, start=False)
    board.c.f28_start()
    for _ in range(22):
        before, time = board.c.f28_cycles(), board.c.fake_time()
        board.idle(ms=1_000)
        after, passed = board.c.f28_cycles(), board.c.fake_time() - time
        assert 0 < passed - (after - before) % 2**32 < 50 * 1_001  # without 1000 interrupts
    assert board.c.fake_time() > 2**32


def test_the_watchdog_is_content_with_a_busy_main_loop(tmp_path: Path) -> None:
    """Passes of 90 ms each, as if a step took that long: served in every one."""
    board = Board(tmp_path)
    board.run(ms=3_000, work=90 * CYCLES_PER_S // 1_000)
    assert board.c.fake_watchdog_bites() == 0
    board.nothing_misused()


def test_the_watchdog_bites_when_the_main_loop_stops(tmp_path: Path) -> None:
    """Interrupts still come, the timer counts, octets are fetched: nothing of that serves it."""
    board = Board(tmp_path)
    board.run(ms=500)
    board.line([0] * 600)
    board.idle(ms=100)
    assert board.c.fake_watchdog_bites() == 0
    board.idle(ms=10)
    assert board.c.fake_watchdog_bites() == 1  # after 104.9 ms


def test_the_watchdog_bites_when_the_timer_stops(tmp_path: Path) -> None:
    """The main loop runs, but its time stands still: nothing that has a deadline would happen."""
    board = Board(tmp_path)
    board.run(ms=500)
    board.c.fake_stop_timer0()
    board.run(ms=110)
    assert board.c.fake_watchdog_bites() == 1


def test_it_says_that_the_watchdog_restarted_it(tmp_path: Path) -> None:
    board = Board(tmp_path, cause=WATCHDOG)
    assert board.c.fake_reset_cause() == 0  # forgotten, so that the next start is judged by its own cause
    seen: set[int] = set()
    for _ in range(20):
        board.run(ms=70)
        seen.add(board.c.fake_pin(SAFE_LIGHT))
    assert seen == {LIT, DARK}
    assert of(board.messages(), "FS_PIL_STATUS")[-1].state == RESTARTED
    exchange(board, 0, RESET | OUTER_DUE)
    board.run(ms=1_000)
    assert board.c.fake_pin(SAFE_LIGHT) == DARK


def test_a_start_by_power_is_no_restart(tmp_path: Path) -> None:
    board = Board(tmp_path, cause=POWER_ON)
    board.run(ms=1_100)
    assert of(board.messages(), "FS_PIL_STATUS")[-1].state == READY
    assert board.c.fake_reset_cause() == POWER_ON


def test_bad_input_lights_the_light_until_a_reset(tmp_path: Path) -> None:
    board = Board(tmp_path)
    exchange(board, 0, RESET | OUTER_DUE)
    board.line(pil_step(1, OUTER_DUE, position=(float("nan"), 0.0, 0.0)))
    board.run(ms=40)
    (report,) = of(board.messages(), "FS_PIL_REPORT")
    assert report.status & 0x80000
    assert set(report.rotor_command) == {0.0}
    assert board.c.fake_pin(SAFE_LIGHT) == LIT
    exchange(board, 0, RESET | OUTER_DUE)
    assert board.c.fake_pin(SAFE_LIGHT) == DARK


def test_the_heartbeat_light_beats(tmp_path: Path) -> None:
    """On and off for 512 ms each."""
    board = Board(tmp_path)
    levels = []
    for _ in range(41):
        board.run(ms=100)
        levels.append(board.c.fake_pin(HEARTBEAT_LIGHT))
    changes = sum(a != b for a, b in itertools.pairwise(levels))
    assert changes == 8


def test_interrupts_are_never_off_for_long(tmp_path: Path) -> None:
    """At 2.5 Mbaud the FIFO's 8 spare octets last 6400 cycles; the main loop masks interrupts for far less."""
    board = Board(tmp_path, options=("-DF28_BAUD=2500000UL",))
    for number in range(30):
        exchange(board, number, OUTER_DUE | (RESET if number == 0 else 0))
    assert 0 < board.c.fake_longest_masked() < 2_000
    assert board.overruns == 0


def test_the_high_water_mark_of_the_stack(tmp_path: Path) -> None:
    """The stack grows upwards from its first word; what is used once stays seen."""
    board = Board(tmp_path, start=False)
    size = board.c.bench_stack_size()
    stack = board.c_words("f28_stack", size)
    board.c.f28_stack_paint()
    assert board.c.f28_stack_high_water() == 64  # what start-up may have used is not painted
    for depth in (200, 700, 300):
        stack[depth - 1] = 0x1234
    assert board.c.f28_stack_high_water() == 700
    stack[size - 1] = 0
    assert board.c.f28_stack_high_water() == size


def set_baud(board: Board, baud: int) -> list[Any]:
    """Command a rate, run until the acknowledgement has left, and return what was sent."""
    link = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    number = mavlink.MAV_CMD_FS_SET_BAUD_RATE
    board.line(mavlink.MAVLink_command_long_message(1, 1, number, 0, float(baud), *[0.0] * 6).pack(link))
    board.run(ms=20)
    return of(board.messages(), "COMMAND_ACK")


@pytest.mark.parametrize(("baud", "eighths"), [(921_600, 27), (2_500_000, 10), (230_400, 108)])
def test_the_baud_rate_changes_and_the_flight_goes_on(baud: int, eighths: int, tmp_path: Path) -> None:
    board = Board(tmp_path)
    exchange(board, 0, OUTER_DUE | RESET)
    (ack,) = set_baud(board, baud)
    assert ack.result == mavlink.MAV_RESULT_ACCEPTED
    assert board.c.fake_octet_cycles() == 80 * eighths
    for number in range(1, 20):
        (report,) = exchange(board, number, OUTER_DUE)
        assert (report.step, report.status >> 16) == (number, 0)
    assert (board.overruns, board.errors) == (0, 0)
    board.nothing_misused()


def test_a_baud_rate_without_a_frame_is_left_after_a_second(tmp_path: Path) -> None:
    board = Board(tmp_path)
    before = board.c.fake_octet_cycles()
    set_baud(board, 921_600)
    assert board.c.fake_octet_cycles() != before
    board.run(ms=1_050)
    assert board.c.fake_octet_cycles() == before
    board.messages()  # some left at the other rate
    assert len(exchange(board, 0, OUTER_DUE | RESET)) == 1
    board.nothing_misused()


@pytest.mark.parametrize("baud", [2_000_000, 3_000_000, 13_000_000])
def test_a_baud_rate_that_the_chip_misses_is_denied(baud: int, tmp_path: Path) -> None:
    """2 Mbaud would be off by 4.2 %."""
    board = Board(tmp_path)
    before = board.c.fake_octet_cycles()
    (ack,) = set_baud(board, baud)
    assert ack.result == mavlink.MAV_RESULT_DENIED
    assert board.c.fake_octet_cycles() == before
    board.nothing_misused()
