"""The real thing: ``gcs fly`` with its two children, and the start-up of each process."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.measure import Figure, figure
from benchmarks.ports import free_instance
from flightstack.core.port_numbers import simulator_port
from flightstack.params.config import DEFAULT_HOME, ESTIMATED, TRUTH
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.endpoint import SimulatorEndpoint

ROOT = Path(__file__).resolve().parent.parent
PLAN = ROOT / "missions" / "square.plan"


class Case(NamedTuple):
    """What ``gcs fly`` flies."""

    inner_hz: float
    state: str

    def __str__(self) -> str:
        return f"{self.inner_hz:g} Hz, {self.state}"


ON_TRUTH, ON_SENSORS = Case(500.0, TRUTH), Case(500.0, ESTIMATED)
CASES = (ON_TRUTH, Case(250.0, TRUTH), ON_SENSORS)


class Flights(NamedTuple):
    """Figures of ``gcs fly`` of one case."""

    factor: Figure
    step_us: Figure


def fly(inner_hz: float, plant: str = "rigid", state: str = TRUTH) -> tuple[dict[str, Any], float]:
    """Fly once; return the summary and how long the whole command took [s]."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "gcs_cli", "fly", str(PLAN), "--json", "--out", folder,
            "--inner-hz", f"{inner_hz:g}", "--instance", str(free_instance()), "--plant", plant,
            "--state", state,
        ]  # fmt: skip
        began_s = time.perf_counter()
        done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT)
        took_s = time.perf_counter() - began_s
    if done.returncode:
        raise RuntimeError(f"gcs fly ended with {done.returncode}: {done.stderr.strip()}")
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary, took_s


def flights(cases: tuple[Case, ...], rounds: int) -> dict[Case, Flights]:
    """Fly each case, interleaved; its first flight only warms the caches."""
    for case in cases:
        fly(case.inner_hz, state=case.state)
    seen: dict[Case, list[tuple[float, float]]] = {case: [] for case in cases}
    for _ in range(rounds):
        for case in cases:
            factor = fly(case.inner_hz, state=case.state)[0]["real_time_factor"]
            seen[case].append((factor, 1e6 / factor / case.inner_hz))
    return {
        case: Flights(*(figure(values) for values in zip(*flown, strict=True)))
        for case, flown in seen.items()
    }


def _run_s(*arguments: str) -> float:
    began_s = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", *arguments], check=True, capture_output=True, cwd=ROOT, env=os.environ
    )
    return time.perf_counter() - began_s


def _simulator_s() -> float:
    """Time from the start of ``sim-bridge`` to its first state."""
    port = simulator_port(free_instance())
    hello = SimulatorEndpoint(load_vehicle("paper_quad"), DEFAULT_HOME, lockstep=True).initial_requests(2000)
    command = [sys.executable, "-m", "sim_bridge", "--speed=max", f"--port={port}"]
    began_s = time.perf_counter()
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while True:
            try:
                connection = socket.create_connection(("127.0.0.1", port))
                break
            except ConnectionRefusedError:
                if process.poll() is not None:
                    raise RuntimeError(f"sim-bridge ended with {process.returncode}") from None
                time.sleep(0.002)
        with connection:
            connection.sendall(hello)
            connection.recv(4096)
            took_s = time.perf_counter() - began_s
    return took_s


def _ready_s() -> float:
    """Time from the start of ``gcs sim`` to a vehicle on its sensors that can arm."""
    command = [sys.executable, "-m", "gcs_cli", "sim", f"--instance={free_instance()}"]
    files = ["--log=none", "--state-dir=none", "--params=none"]
    began_s = time.perf_counter()
    with subprocess.Popen([*command, *files], cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = process.stdout.readline()
        took_s = time.perf_counter() - began_s
        process.send_signal(signal.SIGINT)
    if " is ready" not in said:
        raise RuntimeError(f"gcs sim ended with {process.returncode}: {said}")
    return took_s


def start_ups(rounds: int) -> dict[str, Figure]:
    """Return how long each process takes to be of use [s], with compiled kernels in the cache."""
    fly(500.0, state=ESTIMATED)
    seen: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, took_s in (
            ("gcs --help", _run_s("gcs_cli", "--help")),
            ("sim-bridge, to its first state", _simulator_s()),
            ("flightstack --check (loops loaded, nothing connected)", _run_s("flightstack", "--check")),
            ("gcs sim, to a vehicle that can arm (goal 0.8)", _ready_s()),
            ("gcs fly missions/square.plan, all of it (goal 1.2)", fly(500.0, state=ESTIMATED)[1]),
        ):
            seen.setdefault(name, []).append(took_s)
    return {name: figure(values) for name, values in seen.items()}
