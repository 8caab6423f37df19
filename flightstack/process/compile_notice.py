"""Progress of compilation on stderr: one line for each kernel that is compiled, none for those read from the cache."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from numba.core import event

_COMPILATION = "numba:compile"
"""Numba's event around the compilation of one function; a function read from the cache has none."""


class CompileNotice(event.Listener):  # type: ignore[misc]  # Numba has no types
    """Reports each kernel before it is compiled; the functions that a kernel calls are part of it."""

    def __init__(self, say: Callable[[str], None], kernels: Sequence[str]) -> None:
        """``kernels``: names of all kernels that the program needs, in the order of compilation."""
        self._say, self._kernels = say, tuple(kernels)
        self._depth = 0
        self._began = False

    def on_start(self, event: event.Event) -> None:
        """Report a kernel whose compilation begins."""
        self._depth += 1
        if self._depth == 1:
            self._report(base_name(event.data["dispatcher"].py_func.__name__))

    def on_end(self, event: event.Event) -> None:
        """Count the way out of nested compilations."""
        self._depth -= 1

    def _report(self, kernel: str) -> None:
        if not self._began:
            self._began = True
            self._say("compiling kernels, once; this takes about half a minute on an idle machine")
        place = ""
        if kernel in self._kernels:
            place = f" {self._kernels.index(kernel) + 1} of {len(self._kernels)}"
        self._say(f"compiling kernel{place}: {kernel}")


def base_name(kernel: str) -> str:
    """Return the name of a kernel without the suffix that ``specialise`` gives it."""
    return kernel.partition("__")[0]


def announce_compilation(program: str, kernels: Sequence[str]) -> None:
    """Report on stderr, from now on, each kernel that ``program`` compiles."""

    def say(text: str) -> None:
        print(f"{program}: {text}", file=sys.stderr, flush=True)

    event.register(_COMPILATION, CompileNotice(say, kernels))
