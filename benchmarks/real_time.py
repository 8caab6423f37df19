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
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.ports import free_instance
from benchmarks.three_processes import ROOT
from flightstack.core.port_numbers import ground_station_port, simulator_port
from flightstack.process.clock import DeadlineScheduler, LoopTiming, minimise_timer_slack

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
    minimise_timer_slack()
    scheduler = DeadlineScheduler(timing)
    while len(kept) < count:
        scheduler.wait()
    with contextlib.suppress(OSError):  # the default again: children inherit it
        Path("/proc/self/timerslack_ns").write_text("0", encoding="ascii")
    return kept


def _flight_stack(seconds: float) -> list[float]:
    """Run simulator and flight stack, both in real time, and return the lateness of the loop."""
    instance = free_instance()
    ground = ground_station_port(instance)
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as running:
        file = Path(folder) / "lateness"
        station = running.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        station.bind(("127.0.0.1", ground))
        station.settimeout(30.0)
        port = f"port={simulator_port(instance)}"
        simulator = running.enter_context(child("sim_bridge", f"--{port}", f"--instance={instance}"))
        stack = running.enter_context(
            child(
                "benchmarks.timed_stack", str(file), "--clock=realtime", f"--sim-{port}",
                f"--instance={instance}", f"--gcs-port={ground}", f"--log={folder}/flight.ulg",
            )
        )  # fmt: skip
        station.recv(4096)  # its first heartbeat: it runs
        time.sleep(seconds)
        for process in (stack, simulator):
            process.send_signal(signal.SIGINT)
            process.wait(timeout=30.0)
        values = [float(line) for line in file.read_text(encoding="ascii").split()]
    return values[250:]  # the first half second is start-up


@contextlib.contextmanager
def child(
    module: str, *arguments: str, errors: int = subprocess.DEVNULL
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a module as a process that ends with the block."""
    command = [sys.executable, "-m", module, *arguments]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=errors) as process:
        try:
            yield process
        finally:
            process.kill()


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
