"""An AVR gives the host's bits: its int has 16 bits, and its arithmetic with float is a library of another origin."""

from __future__ import annotations

from pathlib import Path

from tests.firmware.step_machines import first_difference, on_avr, on_host
from tests.firmware.step_streams import flown_steps, random_steps
from tests.support.tools import NIGHTLY

RANDOM_STEPS = 100_000 if NIGHTLY else 1_500
FLOWN_STEPS = None if NIGHTLY else 500
"""A simulated AVR makes some 500 steps in a second."""


def test_random_steps_give_the_same_bits(tmp_path: Path) -> None:
    stream = b"".join(random_steps(RANDOM_STEPS, seed=7))
    there = on_avr(stream, tmp_path)
    assert len(there) == RANDOM_STEPS + 1
    assert there[-1] == 0, "parameters were refused"
    assert first_difference(on_host(stream, tmp_path), there) == ""


def test_a_mission_gives_the_same_bits(tmp_path: Path) -> None:
    """From the take-off on; the whole mission at night."""
    stream = b"".join(flown_steps("square.plan")[:FLOWN_STEPS])
    assert first_difference(on_host(stream, tmp_path), on_avr(stream, tmp_path)) == ""
