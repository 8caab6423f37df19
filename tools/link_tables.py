"""The page of docs/reference about the speed of the link to a target, from the model of its line."""

from __future__ import annotations

from flightstack.firmware.pil.line_model import (
    STATE_OCTETS,
    Line,
    Octets,
    free_running_baud,
    lockstep_hz,
    period_octets,
    replay_hz,
    spare_latency_s,
)

BAUDS = (115_200, 460_800, 921_600, 2_000_000, 2_500_000)
TIMERS_S = (0.0, 1e-3, 16e-3)
RATES_HZ = ((500.0, 5), (1000.0, 10))
"""Inner rate, and inner ticks per outer tick."""
WINDOW, ROTORS = 8, 4

HEAD = """\
# Speed of the link

{note}

Steps per second between host and target, from the octets of each step and a model of the line: ten bits an octet,
0.1 ms for a step on the target, 0.125 ms for USB, and the latency timer of the bridge. FTDI bridges, such as the
XDS100v2 of the LaunchPad, hold received octets until that timer expires: 16 ms by default, 1 ms at least. An exchange
then takes whole periods of the timer. Other bridges forward octets at once, which is the column "0 ms". The host's own
time per step is not included.

`gcs pil doctor` measures a real line. `tests/protocol/test_pil_line_speed.py` compares the model with client and
firmware on a simulated line. A pseudo-terminal has no baud rate: [measurements](pil.md#speed-of-the-link).
"""

SECTION = """
## Inner loop at {inner_hz:g} Hz, outer loop at {outer_hz:g} Hz

| baud | full: 0 ms | 1 ms | 16 ms | short: 0 ms | 1 ms | 16 ms | latency left | replay: 0 ms | 1 ms | 16 ms |
|---|---|---|---|---|---|---|---|---|---|---|
"""

TAIL = """
Full and short: steps of a flight in lockstep; `--loops TARGET,short` flies short ones. Replay: `gcs pil replay`, full
steps in windows of eight. "Latency left" is the mean delay of an exchange that short steps may have, beyond that of USB
and target, to keep the inner rate in real time.

* 500 Hz in lockstep fit at 921 600 baud with short steps if the bridge delays an answer by {half_ms:.2f} ms at most;
  with a latency timer of 1 ms they reach {half_hz:.0f} steps/s.
* 1 kHz fits at 2 Mbaud if it delays an answer by {one_ms:.2f} ms at most; with a timer of 1 ms it reaches
  {one_hz:.0f} steps/s. The F28377S cannot make 2 Mbaud; it makes 2.5 Mbaud.

A free-running target (`TARGET,free`) receives a state of {octets} octets per inner tick: at least
{half_baud:.0f} baud at 500 Hz and {one_baud:.0f} at 1 kHz. A slower line is refused.

A flight in lockstep does not depend on any of this: a slower line makes it longer and changes nothing in it.
"""


def link_page(note: str) -> str:
    """Return the page."""
    sections = [
        SECTION.format(inner_hz=inner_hz, outer_hz=inner_hz / divisor)
        + "".join(_row(baud, inner_hz, divisor) for baud in BAUDS)
        for inner_hz, divisor in RATES_HZ
    ]
    half, one = (period_octets(ROTORS, True, divisor) for _, divisor in RATES_HZ)
    tail = TAIL.format(
        octets=STATE_OCTETS,
        half_baud=free_running_baud(500.0),
        one_baud=free_running_baud(1000.0),
        half_ms=spare_latency_s(Line(921_600), half, 500.0) * 1e3,
        half_hz=lockstep_hz(Line(921_600, 1e-3), half),
        one_ms=spare_latency_s(Line(2_000_000), one, 1000.0) * 1e3,
        one_hz=lockstep_hz(Line(2_000_000, 1e-3), one),
    )
    return HEAD.format(note=note) + "".join(sections) + tail


def _row(baud: int, inner_hz: float, divisor: int) -> str:
    full, short = (period_octets(ROTORS, is_short, divisor) for is_short in (False, True))
    left_s = spare_latency_s(Line(baud), short, inner_hz)
    cells = [
        *_lockstep(baud, full),
        *_lockstep(baud, short),
        f"{left_s * 1e3:.2f} ms" if left_s > 0.0 else "–",
        *(f"{replay_hz(Line(baud, timer_s), full, WINDOW):.0f}" for timer_s in TIMERS_S),
    ]
    return f"| {baud} | {' | '.join(cells)} |\n"


def _lockstep(baud: int, period: list[Octets]) -> list[str]:
    return [f"{lockstep_hz(Line(baud, timer_s), period):.0f}" for timer_s in TIMERS_S]
