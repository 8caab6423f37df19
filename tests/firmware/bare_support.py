"""The main loop of ports/bare on a board in memory: a ``ByteLink`` whose time passes by reads."""

from __future__ import annotations

import ctypes
import functools
import shutil
import tempfile
from pathlib import Path

from flightstack.firmware.sources import PORTABLE, c_files, firmware_root
from flightstack.firmware.toolchain.build import EXACT, cached, definitions, host_compiler, includes
from tests.firmware.step_machines import state_flag

C = Path(__file__).parent / "c"
FAULTS = (
    "SMALL_RING", "NO_TIME", "SLOW_TIME", "FAST_TIME", "TIME_RUNS_BACK", "NO_CYCLES", "CYCLES_COUNT_DOWN",
    "SEVEN_BITS", "XON_XOFF", "NEW_LINES", "DROPS_SENT", "ECHO", "STACK_FULL", "WAS_WATCHDOG", "NOISE",
    "NO_US", "US_STAND_STILL", "US_SLOW", "US_RUN_BACK", "US_WRAP_EARLY", "US_WRAP",
)  # fmt: skip
"""Faults of bare_bench.c, counted from 1."""


@functools.cache
def bench(*flags: str) -> Path:
    """Return the main loop with the board in memory as a library."""
    bare = firmware_root() / "ports" / "bare"
    sources = [
        *(path for folder in PORTABLE for path in c_files(folder)),
        *sorted(bare.glob("*.c")),
        C / "bare_bench.c",
    ]
    compiler = host_compiler()
    fixed = [*EXACT, "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", '-DFS_BOARD="board in memory"']
    state = state_flag(C / "bare_bench.c")
    command = [*fixed, *definitions(compiler), *includes(*PORTABLE, "ports/bare"), state, *flags]
    return cached("bare.so", compiler, command, sources, sorted(bare.glob("*.h")))


class BareLink:
    """A ``ByteLink`` to the board in memory."""

    name = "a board in memory"

    def __init__(self, fault: str = "", flags: tuple[str, ...] = ()) -> None:
        """Start a copy of the library, so that its memory is its own."""
        self._folder = tempfile.TemporaryDirectory(prefix="flightstack-bare-")
        copy = shutil.copy(bench(*flags), self._folder.name)
        self._c = ctypes.CDLL(copy)
        self._c.bench_sent.restype = ctypes.c_uint32
        self._c.bench_start(FAULTS.index(fault) + 1 if fault else 0)
        self._room = (ctypes.c_ubyte * 32768)()

    def write(self, data: bytes) -> None:
        """Let bytes arrive all at once."""
        self._c.bench_receive(data, len(data))

    def read(self, timeout_s: float) -> bytes:
        """Let one pass go by, or the whole timeout without an answer."""
        self._c.bench_run(0)
        data = self._taken()
        if not data:
            self._c.bench_run(round(timeout_s * 1e6))
        return data

    def _taken(self) -> bytes:
        return bytes(self._room[: self._c.bench_sent(self._room, len(self._room))])

    def close(self) -> None:
        """Remove the copy."""
        self._folder.cleanup()
