"""The flight stack itself, with each lateness of its loop kept and written out at the end.

Arguments: the file to write, then those of ``flightstack``. How long each turn of the loop took, ground links
included, goes to a file of the same name that ends in ``.execution``.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from flightstack.__main__ import main
from flightstack.process import clock

lateness_ns: list[int] = []
execution_ns: list[int] = []


class KeptTiming(clock.LoopTiming):
    """Timing that keeps every lateness, and not the last ones only."""

    def __init__(self, period_ns: int) -> None:
        super().__init__(period_ns)
        self.lateness = _Kept(lateness_ns)


class _Kept(clock.Durations):
    def __init__(self, kept: list[int]) -> None:
        super().__init__()
        self._kept = kept

    def add(self, nanoseconds: int) -> None:
        self._kept.append(nanoseconds)
        super().add(nanoseconds)


class TimedScheduler(clock.DeadlineScheduler):
    """Scheduler that keeps how long its caller was away: the tick and all that is done between two."""

    _began_ns = 0

    def wait(self) -> int:
        """Note the turn that has ended, and begin the next."""
        if self._began_ns:
            execution_ns.append(time.monotonic_ns() - self._began_ns)
        periods = super().wait()
        self._began_ns = time.monotonic_ns()
        return periods


if __name__ == "__main__":
    # before the stack is built and asks for them
    clock.LoopTiming = KeptTiming  # type: ignore[misc]
    clock.DeadlineScheduler = TimedScheduler  # type: ignore[misc]
    file = Path(sys.argv.pop(1))
    try:
        main()
    finally:
        file.write_text("\n".join(map(str, lateness_ns)), encoding="ascii")
        file.with_suffix(".execution").write_text("\n".join(map(str, execution_ns)), encoding="ascii")
