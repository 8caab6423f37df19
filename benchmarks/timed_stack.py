"""The flight stack itself, with each lateness of its loop kept and written out at the end.

Arguments: the file to write, then those of ``flightstack``.
"""

from __future__ import annotations

import sys
from pathlib import Path

from flightstack import clock
from flightstack.__main__ import main

lateness_ns: list[int] = []


class KeptTiming(clock.LoopTiming):
    """Timing that keeps every lateness, and not the last ones only."""

    def __init__(self, period_ns: int) -> None:
        super().__init__(period_ns)
        self.lateness = _Kept()


class _Kept(clock.Durations):
    def add(self, nanoseconds: int) -> None:
        lateness_ns.append(nanoseconds)
        super().add(nanoseconds)


if __name__ == "__main__":
    clock.LoopTiming = KeptTiming  # type: ignore[misc]  # before the stack is built and asks for it
    file = Path(sys.argv.pop(1))
    try:
        main()
    finally:
        file.write_text("\n".join(map(str, lateness_ns)), encoding="ascii")
