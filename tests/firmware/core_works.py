"""The workout run on builds of the core, and the comparison of what they make."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import numpy as np

from tests.firmware.core_support import (
    PYTHON,
    ROOT,
    Core,
    run_tool,
)
from tests.firmware.core_workout import workout


def of_real(real: str) -> list[str]:
    return ["-DFS_DOUBLE"] if real == "double" else []


@functools.cache
def made_here(real: str) -> dict[str, np.ndarray]:
    """What the plain build makes of the workout."""
    return workout(Core(real))


def work_out(real: str, library: Path, out: Path, **environment: str) -> dict[str, np.ndarray]:
    """Run the workout on a library in a process of its own."""
    command = [PYTHON, "-m", "tests.firmware.core_workout", real, library, out]
    run_tool(command, cwd=ROOT, env={**os.environ, **environment})
    with np.load(out) as made:
        return dict(made)


def assert_equal(made: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    assert made.keys() == expected.keys()
    for name, values in made.items():
        assert np.array_equal(values, expected[name], equal_nan=values.dtype.kind == "f"), name
