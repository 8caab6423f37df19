"""How late the loop is in real time at 500 Hz, beside a bare C loop on the same machine at the same time."""

from __future__ import annotations

import contextlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.three_processes import INSTANCE, ROOT
from flightstack.clock import DeadlineScheduler, LoopTiming, ask_for_punctual_sleeps

PERIOD_NS = 2_000_000
SLICES = 5
SLACK_NS, DEFAULT_SLACK_NS = 1, 50_000
PERCENTILES = (50.0, 99.0, 99.9, 100.0)


def compiled(folder: Path) -> Path | None:
    """Compile the C loop; None when there is no compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    program = folder / "clock_nanosleep"
    source = Path(__file__).with_name("clock_nanosleep.c")
    subprocess.run([compiler, "-O2", "-o", str(program), str(source)], check=True)
    return program


def _c_loop(program: Path, slack_ns: int, count: int) -> list[float]:
    command = [str(program), str(PERIOD_NS), str(count), str(slack_ns)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return [float(line) for line in done.stdout.split()]


def _our_scheduler(count: int) -> list[float]:
    timing = LoopTiming(PERIOD_NS)
    kept: list[float] = []
    timing.lateness.add = kept.append  # type: ignore[assignment,method-assign]
    ask_for_punctual_sleeps()
    scheduler = DeadlineScheduler(timing)
    while len(kept) < count:
        scheduler.wait()
    with contextlib.suppress(OSError):  # the default again: children inherit it
        Path("/proc/self/timerslack_ns").write_text("0", encoding="ascii")
    return kept


def _flight_stack(seconds: float) -> list[float]:
    """Run simulator and flight stack, both in real time, and return the lateness of the loop."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "lateness"
        port = f"{4560 + INSTANCE}"
        simulator = subprocess.Popen(
            [sys.executable, "-m", "sim_bridge", f"--port={port}"], cwd=ROOT, stdout=subprocess.DEVNULL
        )
        stack = subprocess.Popen(
            [
                sys.executable, "-m", "benchmarks.timed_stack", str(file), "--clock=realtime",
                f"--sim-port={port}", f"--instance={INSTANCE}", f"--gcs-port={14550 + 10 * INSTANCE}",
                f"--log={folder}/flight.ulg",
            ],
            cwd=ROOT, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
            station.bind(("127.0.0.1", 14550 + 10 * INSTANCE))
            station.settimeout(30.0)
            station.recv(4096)  # its first heartbeat: it runs
            time.sleep(seconds)
        for process in (stack, simulator):
            process.send_signal(signal.SIGINT)
            process.wait(timeout=30.0)
        values = [float(line) for line in file.read_text(encoding="ascii").split()]
    return values[250:]  # the first half second is start-up


def lateness(seconds: float) -> tuple[dict[str, list[float]], bool]:
    """Return percentiles [µs] of each loop's lateness, over ``seconds`` in slices; whether C was there."""
    count = round(seconds / SLICES / (PERIOD_NS * 1e-9))
    with tempfile.TemporaryDirectory() as folder:
        program = compiled(Path(folder))
        loops: dict[str, Callable[[], list[float]]] = {}
        if program is not None:
            loops["C, clock_nanosleep, timer slack 1 ns"] = lambda: _c_loop(program, SLACK_NS, count)
            loops["C, clock_nanosleep, default timer slack"] = lambda: _c_loop(
                program, DEFAULT_SLACK_NS, count
            )
        loops["our scheduler, nothing to do"] = lambda: _our_scheduler(count)
        loops["flight stack, --clock realtime"] = lambda: _flight_stack(seconds / SLICES + 0.5)
        seen: dict[str, list[float]] = {name: [] for name in loops}
        for _ in range(SLICES):
            for name, run in loops.items():
                seen[name] += run()
    figures = {
        name: [float(value) / 1e3 for value in np.percentile(values, PERCENTILES)]
        for name, values in seen.items()
    }
    return figures, program is not None
