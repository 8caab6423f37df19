"""Whether the loops keep their rate in real time at 500 Hz, whoever is on the ground links.

Alone: ``python -m benchmarks --only load``. The cases take turns, so that a busy machine is unfair to none.
"""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.ports import free_instance
from benchmarks.real_time import PERIOD_NS, child
from benchmarks.three_processes import ROOT
from flightstack.core.port_numbers import ground_station_port, simulator_port

START_TICKS = 500
_START_S = 60.0


class Case(NamedTuple):
    """Who is there."""

    name: str
    stations: int
    noise_hz: float
    lazy: int


CASES = (
    Case("no client", 0, 0.0, 0),
    Case("1 ground station", 1, 0.0, 0),
    Case("50 ground stations", 50, 0.0, 0),
    Case("1, and 5 000 datagrams of noise a second", 1, 5000.0, 0),
    Case("1, and a TCP client that never reads", 1, 0.0, 1),
    Case("50, the noise and the client that never reads", 50, 5000.0, 1),
)


class Seen(NamedTuple):
    """What a case showed, all rounds together; times in µs."""

    late_p50_us: float
    late_p99_us: float
    tick_p50_us: float
    tick_p99_us: float
    tick_max_us: float
    overruns: int
    """Ticks that took longer than a period."""
    missed: int
    """Deadlines that passed while a tick was late: ticks that never were."""
    ticks: int
    frames_hz: float
    """Frames that the station served worst received each second."""


def _run(case: Case, seconds: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return lateness and duration of each tick [ns], and the frames per second of the station served worst."""
    instance = free_instance()
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as running:
        file = Path(folder) / "lateness"
        station = running.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        station.bind(("127.0.0.1", ground_station_port(instance)))
        station.settimeout(1.0)
        port = f"port={simulator_port(instance)}"
        simulator = running.enter_context(child("sim_bridge", f"--{port}", f"--instance={instance}"))
        stack = running.enter_context(
            child(
                "benchmarks.timed_stack", str(file), "--clock=realtime", f"--sim-{port}",
                f"--instance={instance}", f"--gcs-port={ground_station_port(instance)}", "--log=none", "--params=none",
                errors=subprocess.PIPE,
            )
        )  # fmt: skip
        _wait_for(station, stack)
        command = [sys.executable, "-m", "benchmarks.load_clients", str(instance), *map(str, case[1:])]
        load = running.enter_context(
            subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        )
        time.sleep(seconds + START_TICKS * PERIOD_NS * 1e-9)
        seen = json.loads(load.communicate("", timeout=_START_S)[0])
        for process in (stack, simulator):
            process.send_signal(signal.SIGINT)
            process.wait(timeout=_START_S)
        late = np.loadtxt(file)[START_TICKS:]
        took = np.loadtxt(file.with_suffix(".execution"))[START_TICKS:]
    return late, took, min(seen["frames"], default=0) / seen["seconds"]


def _wait_for(station: socket.socket, stack: subprocess.Popen[bytes]) -> None:
    """Wait for the first heartbeat: then the flight stack runs."""
    deadline_s = time.monotonic() + _START_S
    while stack.poll() is None and time.monotonic() < deadline_s:
        with contextlib.suppress(TimeoutError):
            station.recv(4096)
            return
    stack.kill()
    said = stack.communicate()[1].decode(errors="replace").strip()
    raise RuntimeError(f"the flight stack did not start: {said or 'no word from it'}")


def loads(seconds: float, rounds: int) -> dict[str, Seen]:
    """Run each case in each round for ``seconds``."""
    runs: dict[str, list[tuple[np.ndarray, np.ndarray, float]]] = {case.name: [] for case in CASES}
    _run(CASES[0], 1.0)  # only warms the caches of both processes
    for _ in range(rounds):
        for case in CASES:
            runs[case.name].append(_run(case, seconds))
    return {name: _summary(seen) for name, seen in runs.items()}


def _summary(runs: list[tuple[np.ndarray, np.ndarray, float]]) -> Seen:
    late = np.concatenate([run[0] for run in runs])
    took = np.concatenate([run[1] for run in runs])
    missed = int((late // PERIOD_NS).sum())
    late_us, took_us = late * 1e-3, took * 1e-3
    return Seen(
        *(float(np.percentile(late_us, p)) for p in (50.0, 99.0)),
        *(float(np.percentile(took_us, p)) for p in (50.0, 99.0, 100.0)),
        int((took > PERIOD_NS).sum()),
        missed,
        len(took),
        min(run[2] for run in runs),
    )
