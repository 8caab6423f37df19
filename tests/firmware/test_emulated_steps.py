"""The emulated Cortex-M4F gives the host's bits, and a step costs no more instructions than it did."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from flightstack.firmware.numbers import default_numbers
from flightstack.firmware.toolchain.build import EXACT
from tests.firmware.step_machines import (
    INCLUDES,
    LOOPS,
    STEPS,
    C,
    Costs,
    first_difference,
    gcc_image,
    hashes,
    on_cortex_m4,
    on_host,
    run,
    tool,
    zig_image,
)
from tests.firmware.step_streams import flown_steps, parameter_frame, random_steps
from tests.support.tools import NIGHTLY

RANDOM_STEPS = 100_000 if NIGHTLY else 6_000
CALM_PLAN = "square.plan" if NIGHTLY else "hop.plan"
COMPILERS = ["zig", "gcc"] if NIGHTLY else ["zig"]
"""Of the missions; the random steps, which run both laws, are compiled by both."""
MEAN_INSTRUCTIONS = {"zig": 1700, "gcc": 1840}
MOST_INSTRUCTIONS = {"zig": 2290, "gcc": 2620}
MOST_IN_GUSTS_INSTRUCTIONS = {"zig": 2390, "gcc": 2700}
"""By compiler, 5 % above what was measured: gcc compiles file by file, without link-time optimisation."""
MOST_OF_ANY_INSTRUCTIONS = 2900
LAWS = [pytest.param(0, id="pid"), pytest.param(1, id="backstepping")]
Emulated = Callable[[bytes, str], tuple[np.ndarray, Costs]]


@cache
def flown() -> bytes:
    """A mission in wind with gusts: take-off, square, return, landing."""
    return b"".join(flown_steps("square.plan"))


@cache
def calm() -> bytes:
    """A mission in calm air."""
    return b"".join(flown_steps(CALM_PLAN, air={}))


def by_law(law: int, stream: bytes) -> bytes:
    return parameter_frame("FS_CTRL", float(law)) + stream


@cache
def random_stream() -> bytes:
    """Steps far from flight: all of roll, pitch, thrust and yaw limited, large angles, also in a step that resets."""
    return b"".join(random_steps(RANDOM_STEPS, seed=4))


@pytest.fixture(scope="module")
def emulated() -> Emulated:
    """Return a function that runs each stream once on the emulator, by compiler: bits and costs are of one run."""
    return cache(lambda stream, name: on_cortex_m4(stream, zig_image() if name == "zig" else gcc_image()))


@pytest.mark.parametrize("name", COMPILERS)
def test_random_steps_give_the_same_bits(emulated: Emulated, name: str, tmp_path: Path) -> None:
    here, (there, _) = on_host(random_stream(), tmp_path), emulated(random_stream(), name)
    assert len(here) == RANDOM_STEPS + 1
    assert here[-1] == 0, "parameters were refused"
    assert first_difference(here, there) == ""


@pytest.mark.parametrize("name", COMPILERS)
@pytest.mark.parametrize("law", LAWS)
def test_a_whole_mission_gives_the_same_bits(emulated: Emulated, law: int, name: str, tmp_path: Path) -> None:
    stream = by_law(law, flown())
    here, (there, _) = on_host(stream, tmp_path), emulated(stream, name)
    assert len(here) > 10_000
    assert first_difference(here, there) == ""


def test_no_step_is_decided_by_memory_that_was_never_written(tmp_path: Path) -> None:
    """MemorySanitizer, which clang alone has: codec and loops on this machine, both laws, every limit."""
    (tmp_path / "steps").write_bytes(b"".join(random_steps(5_000, seed=5)))
    sources = [*LOOPS, *STEPS, C / "steps_host.c"]
    flags = [*EXACT, *INCLUDES, "-fsanitize=memory", "-fno-sanitize-recover=all", "-g", "-O1"]
    run([tool("clang", "clang"), *flags, *sources, "-lm", "-o", tmp_path / "program"])
    run([tmp_path / "program", tmp_path / "steps", tmp_path / "hashes"])
    assert len(hashes((tmp_path / "hashes").read_bytes())) == 5_001


def test_a_gain_off_by_one_bit_is_seen(tmp_path: Path) -> None:
    stream = random_steps(1_000, seed=6)
    gain = np.float32(default_numbers()["PID_ROLL_P"])
    changed = [parameter_frame("PID_ROLL_P", float(np.nextafter(gain, np.float32(np.inf)))), *stream]
    here, (there, _) = on_host(b"".join(stream), tmp_path), on_cortex_m4(b"".join(changed), zig_image())
    assert first_difference(here, there) != ""


def test_instruction_counts_repeat_exactly(emulated: Emulated) -> None:
    stream = by_law(0, calm())
    assert on_cortex_m4(stream, zig_image())[1] == emulated(stream, "zig")[1]


@pytest.mark.parametrize("name", COMPILERS)
@pytest.mark.parametrize("law", LAWS)
def test_a_step_stays_within_its_instructions(emulated: Emulated, law: int, name: str) -> None:
    """The gate: docs/explanation/firmware.md has what each kind of step takes.

    In calm air the costliest step is the first one, which resets; in gusts it is one that limits thrust and yaw in a
    tick of the outer loop.
    """
    # measured with zig: 1598 to 1624; 2158 to 2180, and 2252 to 2274
    # measured with gcc: 1730 to 1755; 2472 to 2493, and 2550 to 2571
    for flight, most in ((calm(), MOST_INSTRUCTIONS), (flown(), MOST_IN_GUSTS_INSTRUCTIONS)):
        _, costs = emulated(by_law(law, flight), name)
        assert costs.mean["whole"] < MEAN_INSTRUCTIONS[name], costs
        assert costs.most["whole"] < most[name], costs


@pytest.mark.parametrize("name", COMPILERS)
def test_any_step_stays_within_its_instructions(emulated: Emulated, name: str) -> None:
    _, costs = emulated(random_stream(), name)
    assert costs.most["whole"] < MOST_OF_ANY_INSTRUCTIONS, costs  # measured: 2458 and 2726
