"""Generated C in double, called with Python's values, and the same laws in Python without Numba."""

from __future__ import annotations

import ctypes
import math
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np

from flightstack.firmware.generator.law import python_function
from flightstack.firmware.generator.unit import Program, write
from flightstack.firmware.toolchain.build import EXACT, firmware_root, host_compiler

WARNINGS = (
    "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wconversion", "-Wshadow", "-Wstrict-prototypes",
    "-Wmissing-prototypes", "-Wundef", "-Wvla", "-Wcast-qual", "-Wpointer-arith", "-Wdouble-promotion",
)  # fmt: skip


def compile_program(program: Program, folder: Path, real: str = "double") -> ctypes.CDLL:
    """Write the units of a program, compile them with all warnings as errors, and load them."""
    sources = write(program.written(), folder)
    root, library = firmware_root(), folder / "laws.so"
    command = [*host_compiler().command, *EXACT, *WARNINGS, "-shared", "-fPIC"]
    command += ["-DFS_DOUBLE"] if real == "double" else []
    command += [f"-I{root / name}" for name in ("core", "laws")]
    done = subprocess.run(
        [*command, *map(str, sources), str(root / "core" / "fs_math.c"), "-o", str(library)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(library))


# ------------------------------------------------------------------ Python without Numba


def _square_root(value: Any) -> Any:
    return np.float64(math.sqrt(value)) if value >= 0.0 else np.float64(math.nan)


def _floor(value: Any) -> Any:
    return math.floor(value) if math.isfinite(value) else value


_MATH = SimpleNamespace(
    **{name: value for name, value in vars(math).items() if not name.startswith("_")}
    | {"sqrt": _square_root, "floor": _floor, "copysign": lambda a, b: np.float64(math.copysign(a, b))}
    | {"ldexp": lambda a, b: np.ldexp(np.float64(a), b)}
)


def in_python(target: Any, known: dict[Any, Any] | None = None) -> Callable[..., Any]:
    """Return a law and all that it calls as plain Python, whose divisions and roots are IEEE 754's on NumPy scalars."""
    known = {} if known is None else known
    python = python_function(target)
    assert isinstance(python, FunctionType)
    if python in known:
        return known[python]  # type: ignore[no-any-return]
    names: dict[str, Any] = {}
    copy = FunctionType(python.__code__, names, python.__name__, python.__defaults__, python.__closure__)
    known[python] = copy
    for name, value in python.__globals__.items():
        if name in python.__code__.co_names and python_function(value) is not None:
            names[name] = in_python(value, known)
        else:
            names[name] = value
    names |= {"math": _MATH, "float": np.float64}
    return copy
