"""Compile the core for tests and call it with NumPy arrays."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tests.firmware.kept_builds import alone
from tests.support.tools import missing

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "firmware" / "core"
DRIVER = Path(__file__).parent / "c" / "core_driver.c"
WARNINGS = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Wstrict-prototypes",
    "-Werror",
]
EXACT = ["-std=c99", "-ffp-contract=off", "-fno-fast-math"]
OUTER_DUE, SET_TARGET, RESET = 1, 2, 4
ROW_SIZE = 31
UNWRITTEN = 0xA5
"""Each byte of memory before the core writes it: nothing is zero by chance."""
PARTS = {
    "attitude target": slice(0, 4),
    "target thrust": slice(4, 5),
    "reference attitude": slice(5, 9),
    "reference rates": slice(9, 12),
    "reference acceleration": slice(12, 15),
    "thrust": slice(15, 16),
    "torque": slice(16, 19),
    "achieved thrust": slice(19, 20),
    "achieved torque": slice(20, 23),
    "rotor command": slice(23, 31),
}
"""Columns of the output of a step as the driver writes it."""


def compiler(*names: str) -> str:
    """Return the first C compiler of these that is installed; skip the test when there is none."""
    for name in names or (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        if name and shutil.which(name):
            return name
    return missing(f"no C compiler: {', '.join(names) or 'cc'}")


def sources() -> list[Path]:
    """Return the C files of the core."""
    return sorted(CORE.glob("*.c"))


@functools.cache
def library_path(real: str, cc: str = "", flags: tuple[str, ...] = ("-O2",)) -> Path:
    """Compile core and driver into a shared library, once for each state of the sources."""
    cc = cc or compiler()
    define = ["-DFS_DOUBLE"] if real == "double" else []
    command = [cc, *EXACT, *flags, *define, f"-I{CORE}", "-shared", "-fPIC", "-fno-math-errno"]
    digest = hashlib.sha256(" ".join(command).encode())
    for path in [*sorted(CORE.glob("*.[ch]")), DRIVER]:
        digest.update(path.read_bytes())
    folder = Path(tempfile.gettempdir()) / f"flightstack-core-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    path = folder / f"{digest.hexdigest()[:16]}.so"
    with alone(path):
        if not path.exists():
            fresh = path.with_suffix(f".{os.getpid()}")
            subprocess.run(
                [*command, *map(str, sources()), str(DRIVER), "-lm", "-o", str(fresh)],
                check=True, capture_output=True, text=True,
            )  # fmt: skip
            fresh.replace(path)
    return path


class Core:
    """The core in one precision; arrays go in and out with its dtype."""

    def __init__(self, real: str, path: Path | None = None) -> None:
        self.real = real
        self.dtype = np.dtype(np.float64 if real == "double" else np.float32)
        self.library = ctypes.CDLL(str(path or library_path(real)))
        self.library.drive_sizes.restype = ctypes.c_uint32
        self.c_real = ctypes.c_double if real == "double" else ctypes.c_float
        for name in ("drive_get", "drive_integral"):
            getattr(self.library, name).restype = self.c_real
        self.library.fs_param_name.restype = ctypes.c_char_p
        self.library.fs_param_find.restype = ctypes.c_int16
        self.library.fs_param_find.argtypes = [ctypes.c_char_p]
        self.library.fs_param_count.restype = ctypes.c_uint16
        assert self.library.drive_sizes(0) == self.dtype.itemsize

    def array(self, values: Any) -> np.ndarray:
        """Return values as a contiguous array of the core's type, a copy."""
        return np.array(values, dtype=self.dtype, order="C")

    def unwritten(self, *shape: int) -> np.ndarray:
        """Return room for results of the core's type: what is left out shows as NaN."""
        return np.full(shape, np.nan, self.dtype)

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the driver; arrays are passed by address and may be written."""
        given = [
            argument.ctypes.data_as(ctypes.c_void_p)
            if isinstance(argument, np.ndarray)
            else ctypes.c_uint32(argument)
            if isinstance(argument, int)
            else argument
            for argument in arguments
        ]
        getattr(self.library, name)(*given)

    def index(self, name: str) -> int:
        """Return the index of a parameter."""
        found = self.library.fs_param_find(name.encode())
        assert found >= 0, name
        return int(found)


class Loops:
    """Loops in C, driven as ``PythonLoops`` is."""

    def __init__(self, core: Core, numbers: Mapping[str, float]) -> None:
        self.core, self.numbers = core, dict(numbers)
        self.memory = np.full(core.library.drive_sizes(1), UNWRITTEN, np.uint8)
        core.call("drive_init", self.memory)
        for name, value in numbers.items():
            assert self.set(name, value) == 0, name

    def set(self, name: str, value: float) -> int:
        """Set a parameter; return 0 or 1 for refused."""
        pointer = self.memory.ctypes.data_as(ctypes.c_void_p)
        return int(self.core.library.drive_set(pointer, self.core.index(name), self.core.c_real(value)))

    def get(self, name: str) -> float:
        """Return a parameter."""
        return float(
            self.core.library.drive_get(self.memory.ctypes.data_as(ctypes.c_void_p), self.core.index(name))
        )

    def values(self) -> list[float]:
        """Return all parameters, in the order of their indices."""
        get, pointer = self.core.library.drive_get, self.memory.ctypes.data_as(ctypes.c_void_p)
        return [get(pointer, index) for index in range(self.core.library.fs_param_count())]

    @property
    def integrals(self) -> list[float]:
        pointer = self.memory.ctypes.data_as(ctypes.c_void_p)
        return [float(self.core.library.drive_integral(pointer, axis)) for axis in range(3)]

    def run(
        self, states: Any, setpoints: Any, targets: Any, flags: Sequence[int] | np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Step once for each row; return outputs, shape (n, 31), and status, shape (n,)."""
        core, count = self.core, len(flags)
        rows, status = np.zeros((count, ROW_SIZE), core.dtype), np.zeros(count, np.uint16)
        kept = [core.array(states), core.array(setpoints), core.array(targets), np.array(flags, np.uint16)]
        assert [k.shape for k in kept] == [(count, 13), (count, 11), (count, 5), (count,)]
        core.call("drive_loops", self.memory, count, *kept, rows, status, None, 0)
        return rows.astype(np.float64), status


def ulps(difference: np.ndarray, scale: np.ndarray | float, dtype: np.dtype[Any]) -> np.ndarray:
    """Return differences in units of the last place of ``scale`` in a floating-point type."""
    return np.abs(difference) / np.spacing(np.abs(np.asarray(scale)).astype(dtype)).astype(np.float64)


def same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    """Tell whether two arrays of float64 are equal to the last bit, signs of zeros too; a NaN equals any NaN."""
    equal = np.ascontiguousarray(one).view(np.int64) == np.ascontiguousarray(other).view(np.int64)
    return bool((equal | (np.isnan(one) & np.isnan(other))).all())


class Compared(NamedTuple):
    """A quantity from both sides, shape (samples, width)."""

    c: np.ndarray
    python: np.ndarray

    def has_same_bits(self) -> bool:
        """Tell whether every number is the same to the last bit."""
        return same_bits(self.c, self.python)

    def full_scale_ulps(self) -> np.ndarray:
        """Difference of each sample in float32's ulps of the largest value."""
        return ulps(self._distance(), np.abs(self.python).max(), np.dtype(np.float32))

    def _distance(self) -> np.ndarray:
        return np.linalg.norm(self.c - self.python, axis=1)


def run_tool(command: Sequence[str | Path], **options: Any) -> str:
    """Run a command of the tests; return what it printed, show all of it when it fails."""
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


PYTHON = sys.executable
