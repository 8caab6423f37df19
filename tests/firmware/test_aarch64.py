"""The core on aarch64, executed by qemu-user: the host's bits with float, Python's with double.

A compiler for aarch64 contracts a * b + c to one operation unless it is told not to, so the flag is tested as well.
"""

from __future__ import annotations

import functools
import struct
from pathlib import Path

import numpy as np
import pytest

from tests.firmware.both_loops import FLOWN, both, run_python
from tests.firmware.core_samples import Sequence, sequence
from tests.firmware.core_support import CORE, DRIVER, ROW_SIZE, Core, same_bits, sources
from tests.firmware.core_support import EXACT as EXACT_CORE
from tests.firmware.step_machines import (
    C,
    aarch64_program,
    first_difference,
    on_aarch64,
    on_host,
    run,
    tool,
)
from tests.firmware.step_streams import flown_steps, random_steps
from tests.support.tools import NIGHTLY

RANDOM_STEPS = 20_000 if NIGHTLY else 6_000


@functools.cache
def steps() -> bytes:
    """Random steps of both controllers, and a whole mission in gusts."""
    return b"".join([*random_steps(RANDOM_STEPS, seed=4), *flown_steps("hop.plan")])


def test_steps_on_aarch64_give_the_hosts_bits(tmp_path: Path) -> None:
    here, there = on_host(steps(), tmp_path), on_aarch64(steps(), tmp_path)
    assert len(here) > RANDOM_STEPS + 1000
    assert first_difference(here, there) == ""


def test_contracted_operations_on_aarch64_would_be_seen(tmp_path: Path) -> None:
    stream = b"".join(random_steps(1000, seed=4))
    assert first_difference(on_host(stream, tmp_path), on_aarch64(stream, tmp_path, "fast")) != ""


def run_there(
    program: Path, numbers: dict[str, float], inputs: Sequence, folder: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Step the core of double on aarch64; return outputs, shape (n, 31), and status, shape (n,)."""
    core, count = Core("double"), len(inputs.flags)
    parameters = np.array([[core.index(name), value] for name, value in numbers.items()])
    arrays = [np.ascontiguousarray(array, np.float64).tobytes() for array in inputs[:3]]
    content = [struct.pack("<I", len(parameters)), parameters.tobytes(), struct.pack("<I", count), *arrays]
    given, made = folder / "input", folder / "output"
    given.write_bytes(b"".join(content) + inputs.flags.tobytes())
    run([tool("qemu-aarch64", "qemu-user"), program, given, made])
    octets, end = made.read_bytes(), 8 * count * ROW_SIZE
    return np.frombuffer(octets[:end]).reshape(count, ROW_SIZE), np.frombuffer(octets[end:], np.uint16)


@pytest.mark.parametrize("name", FLOWN if NIGHTLY else list(FLOWN)[:1])
def test_core_in_double_on_aarch64_has_pythons_bits(name: str, tmp_path: Path) -> None:
    controller, vehicle = FLOWN[name]
    python, c = both(controller, vehicle())
    inputs = sequence(5000, 42, vehicle().weight_n)
    flags = [*EXACT_CORE, "-O2", "-DFS_DOUBLE", f"-I{CORE}", "-fno-math-errno"]
    program = aarch64_program("core_program", *flags, *sources(), DRIVER, C / "core_program.c")
    made, status = run_there(program, c.numbers, inputs, tmp_path)
    expected, expected_status = run_python(python, inputs)
    assert np.array_equal(status, expected_status)
    assert same_bits(made, expected)
