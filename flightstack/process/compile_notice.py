"""Progress of kernel compilation on stderr; kernels loaded from the cache are not reported."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from numba.core import event

_COMPILATION = "numba:compile"
"""Numba's event of the compilation of one function."""
_LOOPS_S, _ESTIMATOR_S = 10, 40
"""Time of a vehicle on the true state, and of one on its sensors."""


class CompileNotice(event.Listener):  # type: ignore[misc]  # Numba has no types
    """Reports each kernel before its compilation, which includes the functions that it calls."""

    def __init__(self, say: Callable[[str], None], kernels: Sequence[str], began: bool = False) -> None:
        """``kernels`` are the names of the program's kernels. ``began``: another process has said how long it takes."""
        self._say, self._kernels = say, tuple(kernels)
        self._depth = 0
        self._began = began

    def on_start(self, event: event.Event) -> None:
        """Report a kernel at the start of its compilation."""
        self._depth += 1
        if self._depth == 1:
            self._report(base_name(event.data["dispatcher"].py_func.__name__))

    def on_end(self, event: event.Event) -> None:
        """Track nested compilations."""
        self._depth -= 1

    def stop(self) -> None:
        """Report no more."""
        event.unregister(_COMPILATION, self)

    def _report(self, kernel: str) -> None:
        if not self._began:
            self._began = True
            seconds = _ESTIMATOR_S if "imu_kernel" in self._kernels else _LOOPS_S
            self._say(f"compiling kernels, once; this takes about {seconds} s on two idle cores")
        place = ""
        if kernel in self._kernels:
            place = f" {self._kernels.index(kernel) + 1} of {len(self._kernels)}"
        self._say(f"compiling kernel{place}: {kernel}")


def base_name(kernel: str) -> str:
    """Return the name of a kernel without the suffix of ``specialise``."""
    return kernel.partition("__")[0]


def announce_compilation(program: str, kernels: Sequence[str], began: bool = False) -> CompileNotice:
    """Report each kernel that ``program`` compiles on stderr, until the notice is stopped."""

    def say(text: str) -> None:
        print(f"{program}: {text}", file=sys.stderr, flush=True)

    notice = CompileNotice(say, kernels, began)
    event.register(_COMPILATION, notice)
    return notice
