"""Record of a flight on a target: cost of each step and statistics of the link."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from flightstack.core.atomic_file import write_bytes_atomically, write_text_atomically
from flightstack.core.contract import LoopFlags
from flightstack.firmware.pil.client import PilCounters
from flightstack.firmware.pil.steps import PilReport

LINK_FILE, STEPS_FILE = "pil-link.json", "pil-steps.npz"
COST_UNITS = ("none", "cycles", "instructions", "ns")
STEP_ROW = np.dtype(
    [
        ("step", "u4"),
        ("flags", "u4"),
        ("status", "u4"),
        ("cost", "u4", (4,)),
        ("attempts", "u2"),
        ("round_trip_s", "f8"),
    ]
)
"""One step: number, ``LoopFlags``, FS_PIL_REPORT.status, cost of outer loop, inner loop, mixer and whole step, number
of attempts, and wall time from the first attempt to the report."""


class Trace(NamedTuple):
    """Code of an emulated target that ran."""

    image: str
    """Path of the ELF file."""
    executed: list[tuple[int, int]]
    """First address and end of each range."""


@runtime_checkable
class TracedLink(Protocol):
    """A link to a target whose execution is observed."""

    @property
    def trace(self) -> Trace:
        """Unit that has run until now."""


class PilRecord:
    """Rows of all steps, and information about target and link."""

    def __init__(
        self,
        target: str,
        identity: dict[str, Any],
        status_at_start: dict[str, Any],
        note: str | None = None,
    ) -> None:
        """``status_at_start`` is FS_PIL_STATUS before the first step: its counters continue from earlier flights.

        ``note`` is a sentence about the link.
        """
        self._note = note
        self._target, self._identity, self._status_at_start = target, identity, status_at_start
        self._rows: np.ndarray[Any, np.dtype[np.void]] = np.zeros(1024, STEP_ROW)
        self._count = 0
        self.status: dict[str, Any] | None = None
        """FS_PIL_STATUS after the last step, or None."""
        self.trace: Trace | None = None
        """Executed code of an emulated target, or None."""
        self.free_running: dict[str, Any] | None = None
        """Figures of a free-running target, see ``free_running.FreeRunning.figures``, or None."""

    def add(self, flags: int, report: PilReport, attempts: int, round_trip_s: float) -> None:
        """Record a step; discard a single trial step before the first flight."""
        if flags & LoopFlags.RESET and self._count == 1:
            self._count = 0
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros(self._count, STEP_ROW)])
        self._rows[self._count] = (report.step, flags, report.status, report.cost, attempts, round_trip_s)
        self._count += 1

    @property
    def steps(self) -> np.ndarray[Any, np.dtype[np.void]]:
        """Recorded rows; see ``STEP_ROW``."""
        return self._rows[: self._count]

    def summary(self, counters: PilCounters, ending: str | None) -> dict[str, Any]:
        """Return the content of ``pil-link.json``."""
        trips = self.steps["round_trip_s"]
        return {
            "target": self._target,
            "note": self._note,
            "identity": self._identity,
            "steps": self._count,
            "link": asdict(counters),
            "round_trip_s": _figures(trips) if len(trips) else None,
            "status_at_start": self._status_at_start,
            "status": self.status,
            "free_running": self.free_running,
            "ending": ending,
            "trace": None if self.trace is None else self.trace._asdict(),
        }

    def write(self, log: Path, counters: PilCounters, texts: list[str], ending: str | None) -> None:
        """Write both files beside the flight's log; ``ending`` is why the target failed. Raise OSError."""
        folder, prefix = log.parent, log.stem.removesuffix("flight")
        folder.mkdir(parents=True, exist_ok=True)
        content = {**self.summary(counters, ending), "texts": texts}
        write_text_atomically(folder / f"{prefix}{LINK_FILE}", json.dumps(content, indent=2) + "\n")
        buffer = io.BytesIO()
        np.savez_compressed(buffer, steps=self.steps)
        write_bytes_atomically(folder / f"{prefix}{STEPS_FILE}", buffer.getvalue())


def _figures(values: np.ndarray[Any, Any]) -> dict[str, float]:
    return {
        "min": float(values.min()),
        "mean": float(values.mean()),
        "median": float(np.median(values)),
        "p99": float(np.percentile(values, 99)),
        "max": float(values.max()),
    }
