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
    FAKE,
    FRAMING,
    INCLUDE,
    INT_RECEIVED,
    INT_SENT,
    LEVEL,
    OVERRUN,
    PAUSE,
    PORT,
    Board,
)

BOTH = pytest.mark.parametrize("flags", [LEVEL, EDGE], ids=["level", "edge"])


def serviced(board: Board, octets: float) -> list[int]:
    """Run the port's serial part alone for a time, as the main loop does; return what it received."""
    got: list[int] = []
    end = board.c.fake_time() + octets * board.c.fake_octet_cycles()
    while board.c.fake_time() < end:
        board.c.f28_serial_service()
        got += board.take()
        board.give([])
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
    board.c.Interrupt_disableGlobal()
    board.line(range(30))
    board.idle(octets=32)
    board.c.Interrupt_enableGlobal()
    assert serviced(board, 2) == list(range(14, 30))
    assert board.overruns == 1
    board.line(range(100, 140))
    assert serviced(board, 45) == list(range(100, 140))
    assert board.overruns == 1
    board.nothing_misused()


@BOTH
def test_a_framing_error_costs_no_other_octet(flags: int, tmp_path: Path) -> None:
    board = Board(tmp_path, flags=flags)
    board.line([1, 2, 3 | FRAMING, 4, 5])
    assert serviced(board, 8) == [1, 2, 3, 4, 5]  # the checksum of the frame judges the 3
    assert (board.errors, board.overruns) == (1, 0)
    board.nothing_misused()


@BOTH
def test_an_overrun_before_the_fifo_is_counted_and_cleared(flags: int, tmp_path: Path) -> None:
    board = Board(tmp_path, flags=flags)
    board.line([1, OVERRUN, 3, PAUSE, PAUSE, OVERRUN | FRAMING, 4])
    assert serviced(board, 9) == [1, 3, 4]
    assert (board.errors, board.overruns) == (0, 2)
    board.nothing_misused()


@BOTH
def test_the_receiver_comes_back_after_a_break(flags: int, tmp_path: Path) -> None:
    """After a break the SCI receives nothing until its software reset; octets from before it are kept."""
    board = Board(tmp_path, flags=flags)
    board.line([1, 2, BREAK, PAUSE, 3, 4])
    assert serviced(board, 9) == [1, 2, 3, 4]
    assert board.errors == 1
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
def test_an_interrupt_at_any_call_neither_loses_nor_swaps_an_octet(flags: int, tmp_path: Path) -> None:
    """They strike at every call of the main loop, at every second one, …: where both handle a FIFO, they are masked."""
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


@pytest.mark.parametrize("baud", [300, 2_000_000, 3_000_000, 13_000_000])
def test_a_rate_that_the_chip_misses_stops_the_build(baud: int) -> None:
    """2 Mbaud would be off by 4.2 %; 300 needs a divisor of 17 bits."""
    command = [*compiler(), "-std=c99", "-fsyntax-only", f"-DF28_BAUD={baud}UL", *INCLUDE, f"-I{FAKE}"]
    done = subprocess.run([*command, str(PORT / "f28_serial.c")], check=False, capture_output=True, text=True)
    assert done.returncode != 0
    assert "F28_BAUD" in done.stderr
