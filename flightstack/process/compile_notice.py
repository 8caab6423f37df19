"""Progress of kernel compilation on stderr; kernels loaded from the cache are not reported."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from typing import Any

_COMPILATION = "numba:compile"
"""Numba's event of the compilation of one function."""
_LOOPS_S, _ESTIMATOR_S = 7, 20
"""Time of a vehicle on the true state, and of one on its sensors."""


class CompileNotice:
    """Reports each kernel before its compilation, which includes the functions that it calls."""

    def __init__(self, say: Callable[[str], None], kernels: Sequence[str], began: bool = False) -> None:
        """``kernels`` are the names of the program's kernels. ``began``: another process has said how long it takes."""
        self._say, self._kernels = say, tuple(kernels)
        self._depth = 0
        self._began = began

    def notify(self, event: Any) -> None:
        """Report a kernel at the start of its compilation, and track nested compilations; called by Numba."""
        if event.is_start and not self._depth:
            self._report(base_name(event.data["dispatcher"].py_func.__name__))
        self._depth += 1 if event.is_start else -1

    def start(self) -> None:
        """Report the compilations of this process."""
        events = _numba_events()
        events.Listener.register(CompileNotice)
        events.register(_COMPILATION, self)

    def stop(self) -> None:
        """Report no more."""
        _numba_events().unregister(_COMPILATION, self)

    def _report(self, kernel: str) -> None:
        if not self._began:
            self._began = True
            seconds = _ESTIMATOR_S if "imu_kernel" in self._kernels else _LOOPS_S
            self._say(f"compiling kernels, once; this takes about {seconds} s on two idle cores")
        place = ""
        if kernel in self._kernels:
            place = f" {self._kernels.index(kernel) + 1} of {len(self._kernels)}"
        self._say(f"compiling kernel{place}: {kernel}")


def _numba_events() -> Any:
    return importlib.import_module(
        "numba.core.event"
    )  # late: commands that fly nothing check the same options


def base_name(kernel: str) -> str:
    """Return the name of a kernel without the suffix of ``specialise``."""
    return kernel.partition("__")[0]


def announce_compilation(program: str, kernels: Sequence[str], began: bool = False) -> CompileNotice:
    """Report each kernel that ``program`` compiles on stderr, until the notice is stopped."""

    def say(text: str) -> None:
        print(f"{program}: {text}", file=sys.stderr, flush=True)

    notice = CompileNotice(say, kernels, began)
    notice.start()
    return notice
