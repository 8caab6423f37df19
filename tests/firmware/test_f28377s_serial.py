"""SCIA of the F28377S port on the simulated chip: FIFOs, interrupts, rings, errors of the line, baud rates."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path

import pytest

from tests.firmware.codec_support import compiler
from tests.firmware.f28377s_support import (
    BREAK,
    CYCLES_PER_S,
    EDGE,
    FRAMING,
    INCLUDE,
    INT_RECEIVED,
    INT_SENT,
    LEVEL,
    OVERRUN,
    PAUSE,
    PORT,
    Board,
    chip_flags,
)

BOTH = pytest.mark.parametrize("flags", [LEVEL, EDGE], ids=["level", "edge"])


def serviced(board: Board, octets: float, pause: float = 0.0) -> list[int]:
    """Run the port's serial part alone for a time, as a main loop does whose passes take ``pause`` octets more."""
    got: list[int] = []
    end = board.c.fake_time() + octets * board.c.fake_octet_cycles()
    while board.c.fake_time() < end:
        board.c.f28_serial_service()
        got += board.take()
        board.give([])
        board.idle(octets=pause)
    return got


@BOTH
def test_all_octets_arrive_in_order(flags: int, tmp_path: Path) -> None:
    """Every value, in bursts of every length up to twice the FIFO, with silence between them."""
    board, rng = Board(tmp_path, flags=flags), random.Random(1)
    for length in range(1, 34):
        sent = [rng.randrange(256) for _ in range(length)]
        board.line([*sent, *[PAUSE] * rng.randrange(4)])
        board.idle(octets=rng.randrange(15))  # sometimes the interrupt fetches them, sometimes the main loop
        assert serviced(board, length + 6) == sent
    assert (board.overruns, board.errors) == (0, 0)
    assert board.c.fake_interrupts(INT_RECEIVED) > 0
    board.nothing_misused()


@BOTH
def test_interrupts_fill_the_ring_while_the_main_loop_computes(flags: int, tmp_path: Path) -> None:
    board = Board(tmp_path, flags=flags)
    sent = [n % 256 for n in range(500)]
    board.line(sent)
    board.idle(octets=505)
    assert board.c.fake_interrupts(INT_RECEIVED) >= 500 // 8 - 1  # one for 8 octets
    assert serviced(board, 2) == sent
    assert board.overruns == 0
    board.nothing_misused()


@BOTH
def test_a_full_ring_keeps_the_oldest_and_counts_the_rest(flags: int, tmp_path: Path) -> None:
    board = Board(tmp_path, flags=flags)
    sent = [n % 251 for n in range(600)]
    board.line(sent)
    board.idle(octets=605)
    assert serviced(board, 2) == sent[:512]
    assert board.overruns == 600 - 512
    board.line([1, 2, 3])  # and it goes on
    assert serviced(board, 6) == [1, 2, 3]
    board.nothing_misused()


@BOTH
def test_a_fifo_that_overflows_is_counted_and_goes_on(flags: int, tmp_path: Path) -> None:
    """Interrupts are off for 30 octets: the hardware keeps the last 16, and does not tell how many it lost."""
    board = Board(tmp_path, flags=flags)
    board.c.__disable_interrupts()
    board.line(range(30))
    board.idle(octets=32)
    board.c.__enable_interrupts()
    assert serviced(board, 2) == list(range(14, 30))
    assert board.overruns == 1
    board.line(range(100, 140))
    assert serviced(board, 45) == list(range(100, 140))
    assert board.overruns == 1
    board.nothing_misused()


@BOTH
@pytest.mark.parametrize("pause", [0.0, 0.37, 0.73, 3.1])
def test_a_framing_error_costs_no_other_octet(flags: int, pause: float, tmp_path: Path) -> None:
    """Back to back, and seen while any bit of a later octet is on the line, whose receiver must not begin anew."""
    board = Board(tmp_path, flags=flags)
    for first in range(0, 240, 6):
        octets = [*range(first, first + 3), (first + 3) | FRAMING, *range(first + 4, first + 7)]
        board.line(octets)
        assert serviced(board, 14, pause) == [
            octet & 0xFF for octet in octets
        ]  # the frame's checksum judges the 4th
    assert (board.errors, board.overruns) == (40, 0)
    board.nothing_misused()


@BOTH
def test_a_receiver_that_stops_at_a_framing_error_comes_back_in_silence(flags: int, tmp_path: Path) -> None:
    """TI's manual says that it goes on; a chip that does not would else be deaf until the next break."""
    board = Board(tmp_path, flags=flags)
    board.c.fake_stop_at_errors()
    for _ in range(3):
        board.line([1, 2 | FRAMING, 3, 4, *[PAUSE] * 40, 5, 6])
        assert serviced(board, 55) == [1, 2, 5, 6]
        assert serviced(board, 40) == []
    assert (board.errors, board.overruns) == (3, 0)
    board.nothing_misused()


@BOTH
def test_every_damaged_octet_is_counted(flags: int, tmp_path: Path) -> None:
    """Also several between two looks of the main loop, which find one flag in the status."""
    board = Board(tmp_path, flags=flags)
    board.line([n | FRAMING for n in range(40)])
    board.idle(octets=42)
    assert serviced(board, 2) == list(range(40))
    assert (board.errors, board.overruns) == (40, 0)
    board.nothing_misused()


@BOTH
def test_an_overrun_before_the_fifo_is_counted_and_cleared_in_silence(flags: int, tmp_path: Path) -> None:
    """Only a software reset lowers the flag, and would cost the next octet: while the line is busy it stays up."""
    board = Board(tmp_path, flags=flags)
    for start in (0, 100):
        octets = list(range(start, start + 60))
        board.line([*octets[:20], OVERRUN, *octets[20:40], OVERRUN | FRAMING, *octets[40:]])
        assert serviced(board, 65, 0.37) == octets
        assert board.overruns == (1 if start == 0 else 2)  # two losses under one flag count as one
        board.idle(ms=4)
        assert serviced(board, 50) == []  # 4 ms of silence: it falls
    assert (board.errors, board.overruns) == (0, 2)
    board.nothing_misused()


@BOTH
def test_a_reset_for_an_overrun_waits_for_what_is_sent(flags: int, tmp_path: Path) -> None:
    board = Board(tmp_path, flags=flags)
    board.line([OVERRUN])
    octets = [n % 256 for n in range(500)]
    assert board.give(octets) == 500
    assert serviced(board, 520) == []
    assert board.sent() == octets
    serviced(board, 60)
    board.line([OVERRUN])
    serviced(board, 3)
    assert board.overruns == 2  # so the flag was down again
    board.nothing_misused()


@BOTH
def test_the_receiver_comes_back_after_a_break(flags: int, tmp_path: Path) -> None:
    """It begins as an octet 0 without a stop bit; then nothing comes until the reset. What came before is kept."""
    board = Board(tmp_path, flags=flags)
    board.line([1, 2, 0 | FRAMING, BREAK, PAUSE, 3, 4])
    assert serviced(board, 10) == [1, 2, 0, 3, 4]
    assert (board.errors, board.overruns) == (2, 0)
    board.nothing_misused()


def test_a_reset_amid_an_octet_would_cost_more_than_it(tmp_path: Path) -> None:
    """The simulated receiver loses it and reads false octets until a pause: else the tests above could not fail."""
    board, octets = Board(tmp_path), [0x55, 0x0F, 0xA3, 0x11, 0x80, 0x7E, 0x20, 0x31]
    board.line([*octets, PAUSE, 0x41])
    board.idle(octets=2.45)
    assert serviced(board, 0.01) == octets[:2]
    board.c.bench_software_reset()
    got = serviced(board, 12)
    assert got[-1] == 0x41
    assert got[:-1] != octets[3:]
    assert board.errors > 0
    assert octets[2] not in got


@BOTH
def test_a_break_amid_octets_costs_at_most_what_follows_at_once(flags: int, tmp_path: Path) -> None:
    """A main loop that is late resets while octets come again: after the next pause all of them arrive."""
    for late in (1.2, 1.5, 2.7):
        board = Board(tmp_path, flags=flags)
        board.line([1, 2, BREAK, 5, 6, 7, 8, PAUSE, PAUSE, 3, 4])
        board.idle(octets=3 + late)
        got = serviced(board, 12)
        assert got[:2] == [1, 2]
        assert got[-2:] == [3, 4]
        board.nothing_misused()


@BOTH
def test_a_line_held_low_does_not_hold_the_processor(flags: int, tmp_path: Path) -> None:
    """Nothing but breaks for 300 octets: the main loop lives, the timer counts, and then octets come again."""
    board = Board(tmp_path, flags=flags)
    board.line([*[BREAK] * 300, PAUSE, 7, 8])
    before = board.c.f28_now_ms()
    assert serviced(board, 305) == [7, 8]
    assert board.errors == 300
    assert board.c.f28_now_ms() - before == pytest.approx(305 * 10 / 115.2, abs=1.5)
    board.nothing_misused()


@BOTH
def test_what_is_given_is_sent_in_order(flags: int, tmp_path: Path) -> None:
    """Chunks of all sizes, given while interrupts send; at the end the transmit interrupt is off and silent."""
    board, rng = Board(tmp_path, flags=flags), random.Random(2)
    given: list[int] = []
    sent: list[int] = []
    for _ in range(200):
        chunk = [rng.randrange(256) for _ in range(rng.randrange(1, 40))]
        given += chunk[: board.give(chunk)]
        board.idle(octets=rng.randrange(40))
        sent += board.sent()
    board.idle(octets=600)
    assert sent + board.sent() == given
    interrupts = board.c.fake_interrupts(INT_SENT)
    board.idle(octets=600)
    assert board.c.fake_interrupts(INT_SENT) == interrupts > 100
    board.nothing_misused()


@BOTH
def test_a_full_send_ring_takes_what_fits(flags: int, tmp_path: Path) -> None:
    board = Board(tmp_path, flags=flags)
    octets = [n % 256 for n in range(700)]
    assert board.c.f28_serial_room() == 512
    taken = board.give(octets)
    assert taken == 512
    assert board.c.f28_serial_room() == 16  # the FIFO took as many at once
    board.idle(octets=530)
    assert board.sent() == octets[:512]
    assert board.c.f28_serial_room() == 512
    board.nothing_misused()


def test_high_bits_do_not_reach_the_wire(tmp_path: Path) -> None:
    board = Board(tmp_path)
    assert board.give([0xFF41, 0x8042, 0x0143]) == 3
    board.idle(octets=5)
    assert board.sent() == [0x41, 0x42, 0x43]
    board.nothing_misused()


def test_both_rings_wrap_many_times_at_full_rate(tmp_path: Path) -> None:
    """100 000 octets each way at 2.5 Mbaud: the counts of 16 bits wrap, nothing is lost."""
    board = Board(tmp_path, options=("-DF28_BAUD=2500000UL",))
    rng = random.Random(3)
    octets = [rng.randrange(256) for _ in range(100_000)]
    got: list[int] = []
    sent: list[int] = []
    at = 0
    for start in range(0, len(octets), 400):
        board.line(octets[start : start + 400])
        board.idle(octets=200)
        got += serviced(board, 205)
        at += board.give(octets[at : at + 420])
        sent += board.sent()
    board.idle(octets=600)
    assert got == octets
    assert sent + board.sent() == octets[:at]
    assert at > 90_000
    assert (board.overruns, board.errors) == (0, 0)
    board.nothing_misused()


@BOTH
def test_an_interrupt_at_any_access_neither_loses_nor_swaps_an_octet(flags: int, tmp_path: Path) -> None:
    """They strike at each access of the main loop, at each second one, …: where both handle a FIFO, they are masked."""
    board, rng = Board(tmp_path, flags=flags, options=("-DF28_BAUD=2500000UL",)), random.Random(5)
    for every in range(1, 9):
        board.c.fake_strike_every(every)
        octets = [rng.randrange(256) for _ in range(150)]
        before = [board.c.fake_interrupts(number) for number in (INT_RECEIVED, INT_SENT)]
        board.line(octets)
        assert board.give(octets) == len(octets)
        assert serviced(board, 180) == octets
        assert board.sent() == octets
        after = [board.c.fake_interrupts(number) for number in (INT_RECEIVED, INT_SENT)]
        assert min(late - early for early, late in zip(before, after, strict=True)) > 500
    assert (board.overruns, board.errors) == (0, 0)
    board.nothing_misused()


@pytest.mark.parametrize(
    ("baud", "actual"),
    [
        (1_200, 1_200.0192),
        (9_600, 9_600.6144),
        (115_200, 115_207.373),
        (230_400, 231_481.481),
        (460_800, 462_962.963),
        (921_600, 925_925.926),
        (1_000_000, 1_000_000.0),
        (1_250_000, 1_250_000.0),
        (2_500_000, 2_500_000.0),
    ],
)
def test_the_line_runs_at_the_rate_that_was_asked_for(baud: int, actual: float, tmp_path: Path) -> None:
    """The chip's divisor rounds down; the rates are those of BRR = LSPCLK / (8 baud) - 1 with LSPCLK 200 MHz."""
    board = Board(tmp_path, options=(f"-DF28_BAUD={baud}UL",))
    made = 10 * CYCLES_PER_S / board.c.fake_octet_cycles()
    assert made == pytest.approx(actual, rel=1e-6)
    assert abs(made / baud - 1) < 0.02
    board.nothing_misused()


@pytest.mark.parametrize("baud", [300, 1_199, 2_000_000, 3_000_000, 13_000_000])
def test_a_rate_that_the_chip_misses_stops_the_build(baud: int) -> None:
    """2 Mbaud would be off by 4.2 %; below 1200 the pauses between octets are as long as those between frames."""
    command = [*compiler(), "-std=gnu99", "-fsyntax-only", f"-DF28_BAUD={baud}UL", *INCLUDE, *chip_flags()]
    done = subprocess.run([*command, str(PORT / "f28_serial.c")], check=False, capture_output=True, text=True)
    assert done.returncode != 0
    assert "F28_BAUD" in done.stderr
