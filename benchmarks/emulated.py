"""A mission of more than a minute at 500 Hz with the loops in Python, in C, and on the emulated Cortex-M4F."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from benchmarks.measure import Figure, figure
from benchmarks.ports import free_instance
from flightstack.params.config import TRUTH

ROOT = Path(__file__).resolve().parent.parent
PLAN = ROOT / "benchmarks" / "minute.plan"
LOOPS = ("python", "c", "emulated")


class Flown(NamedTuple):
    """Figures of ``gcs fly`` with one kind of loops."""

    simulated_s: float
    wall_s: Figure
    """From the start of the mission to the end of the flight."""
    minute_s: Figure
    """What 60 s of the mission took, in proportion."""
    processor_s: Figure
    """Processor time of all three processes for 60 s of the mission, their start and the report included."""


def _spent_s() -> float:
    """Return the processor time of all processes that were started and have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _fly(loops: str) -> tuple[float, float, float]:
    """Return simulated time, wall time and processor time of a flight [s]."""
    before_s = _spent_s()
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "gcs_cli", "fly", str(PLAN), "--json", "--out", folder, "--loops", loops,
            "--instance", str(free_instance()), "--state", TRUTH,
        ]  # fmt: skip
        done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        raise RuntimeError(f"gcs fly --loops {loops} ended with {done.returncode}: {done.stderr.strip()}")
    summary = json.loads(done.stdout)
    return float(summary["sim_time_s"]), float(summary["wall_time_s"]), _spent_s() - before_s


def flights(rounds: int) -> dict[str, Flown]:
    """Fly with each kind of loops, interleaved; the first flight of each only compiles and warms the caches."""
    seen: dict[str, list[tuple[float, float, float]]] = {loops: [] for loops in LOOPS}
    for turn in range(rounds + 1):
        for loops in LOOPS:
            took = _fly(loops)
            if turn:
                seen[loops].append(took)
    return {
        loops: Flown(
            flown[0][0],
            figure(wall_s for _, wall_s, _ in flown),
            figure(60.0 * wall_s / simulated_s for simulated_s, wall_s, _ in flown),
            figure(60.0 * spent_s / simulated_s for simulated_s, _, spent_s in flown),
        )
        for loops, flown in seen.items()
    }
