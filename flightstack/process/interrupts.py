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

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_IMPORTER = "<frozen importlib._bootstrap>"
_AGAIN_S = 0.01
"""Time after which a signal is repeated that could not raise."""


class Interrupts:
    """Raises KeyboardInterrupt on SIGINT and SIGTERM, as soon as no import runs.

    When Python itself ends, the signals are ignored: its default action would replace the exit code.
    """

    def __init__(self) -> None:
        self.reported = False
        """Set to True to ignore further signals. No function: Python may run a handler where one begins."""
        atexit.register(_ignore)
        sys.unraisablehook = self._repeat_ignored
        for number in _SIGNALS:
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.reported:
            return
        if not _can_raise(frame):
            _repeat(number)
            return
        signal.setitimer(signal.ITIMER_REAL, 0.0)  # nothing is left to repeat
        raise KeyboardInterrupt

    def _repeat_ignored(self, ignored: sys.UnraisableHookArgs) -> None:
        """Repeat a KeyboardInterrupt that Python ignores; print any other exception."""
        if issubclass(ignored.exc_type, KeyboardInterrupt):
            _repeat(signal.SIGINT)
        else:
            sys.__unraisablehook__(ignored)


def report(line: object) -> None:
    """Print the line of a KeyboardInterrupt to stderr, and end with the program's exit code after it.

    If it interrupted an ``exec``, such as that of a dataclass, Python would end with the signal instead.
    """
    from flightstack.process.console import complain  # noqa: PLC0415  # signals are caught before it is imported

    exec("")  # the next one resets that
    complain(line)


def end_with(code: int) -> int:
    """Return the program's exit code; from now on a signal ends the process with it at once."""
    for number in _SIGNALS:
        signal.signal(number, lambda *_: os._exit(code))
    return code


def _ignore() -> None:
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _can_raise(frame: FrameType | None) -> bool:
    """Return False within an import or the ``__set_name__`` of a class."""
    while frame is not None:
        if frame.f_code.co_filename == _IMPORTER or frame.f_code.co_name == "__set_name__":
            return False
        frame = frame.f_back
    return True


def _repeat(number: int) -> None:
    """Send a signal again a little later."""
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(number))
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
