"""SIGINT and SIGTERM as KeyboardInterrupt, which no import can change or lose.

An exception in an import may become another one, such as that of a class whose ``__set_name__`` raises, and one in
``__del__`` or in the callback of a weak reference is ignored by Python.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from types import FrameType

_ENDING = (signal.SIGINT, signal.SIGTERM)
_IMPORTER = "<frozen importlib._bootstrap>"
_LIMIT_S = 1.0
"""Longest time for which a signal waits for the end of an import, which may hang."""


class Interrupts:
    """Raises KeyboardInterrupt on SIGINT and SIGTERM: at once, or right after the import that runs.

    A second signal, or the limit of time, does not wait for the import. A signal that the parent ignores, such as
    SIGINT of a shell's background job, stays ignored. When Python itself ends, all are ignored: their default action
    would replace the exit code.
    """

    def __init__(self) -> None:
        self.reported = False
        """Set it to True to ignore further signals. An assignment: a signal could interrupt the call of a function."""
        self._waits = False
        self._may_interrupt_imports = False

    def catch(self) -> None:
        """Begin to raise."""
        self.reported = self._waits = False
        atexit.register(_ignore)
        sys.unraisablehook = self._keep_ignored
        signal.signal(signal.SIGALRM, self._on_signal)
        for number in _caught():
            signal.signal(number, self._on_signal)

    def end_with(self, code: int) -> int:
        """Return the program's exit code; from now on a signal ends the process with it at once."""
        self.reported = True
        exec("")  # else Python ends with SIGINT after one in another `exec`, such as that of a dataclass
        for number in _caught():
            signal.signal(number, lambda *_: os._exit(code))
        return code

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._waits:
            self._may_interrupt_imports = True
        elif number != signal.SIGALRM and not self.reported:
            self._wait()
        self._raise_if_possible(frame)

    def _wait(self) -> None:
        """Keep a signal: raise at the first call or return of a function where that is possible."""
        self._waits, self._may_interrupt_imports = True, False
        signal.setitimer(signal.ITIMER_REAL, _LIMIT_S)
        sys.setprofile(self._raise_if_possible)

    def _raise_if_possible(self, frame: FrameType | None, *_: object) -> None:
        if not self._waits or not (self.reported or _can_raise(frame, self._may_interrupt_imports)):
            return
        sys.setprofile(None)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        self._waits = False
        if not self.reported:
            raise KeyboardInterrupt

    def _keep_ignored(self, ignored: sys.UnraisableHookArgs) -> None:
        """Raise a KeyboardInterrupt again that Python ignores; print any other exception."""
        if issubclass(ignored.exc_type, KeyboardInterrupt):
            self._wait()
        else:
            sys.__unraisablehook__(ignored)


signals = Interrupts()
"""The signals of this process."""


def report(line: object) -> None:
    """Print the line of a KeyboardInterrupt to stderr."""
    from flightstack.process.console import complain  # noqa: PLC0415  # signals are caught before it is imported

    complain(line)


def _caught() -> list[signal.Signals]:
    return [number for number in _ENDING if signal.getsignal(number) is not signal.SIG_IGN]


def _ignore() -> None:
    for number in (*_ENDING, signal.SIGALRM):
        signal.signal(number, signal.SIG_IGN)


def _can_raise(frame: FrameType | None, in_import: bool) -> bool:
    """Return False within the ``__set_name__`` of a class, what Python calls on an ignored exception, or an import."""
    while frame is not None:
        code = frame.f_code
        if code.co_name in ("__set_name__", "_keep_ignored"):
            return False
        if code.co_filename == _IMPORTER and not in_import:
            return False
        frame = frame.f_back
    return True
