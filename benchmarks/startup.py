"""Processor time of ``gcs --help`` and of the start of commands, and the time from a heartbeat to the answer.

Alone: ``python -m benchmarks --only startup``. A relay between command and vehicle notes when the first heartbeat goes
to the command, so that neither the start of Python nor the wait for the vehicle's heartbeat counts.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.measure import Figure, figure
from benchmarks.ports import free_instance
from benchmarks.real_time import child
from benchmarks.three_processes import ROOT
from flightstack.core.port_numbers import simulator_port, vehicle_ground_port

HELPS = (("--help",), ("status", "--help"), ("param", "get", "--help"), ("fly", "--help"))
ANSWERS = (("status",), ("status", "--json"), ("param", "get", "MPC_XY_CRUISE"), ("mode",))
_WAIT_S = 60.0
_FRAME, _AUTOPILOT = 0xFD, 1


class Startup(NamedTuple):
    """Figures of the commands, by their words."""

    python_cpu_s: Figure
    """Processor time of Python that does nothing."""
    help_cpu_s: dict[str, Figure]
    answer_cpu_s: dict[str, Figure]
    answer_s: dict[str, Figure]
    """Time from the first heartbeat of the vehicle to the end of the process."""
    all_s: dict[str, Figure]
    """Time from the start of the process to its end."""


class _Relay:
    """Passes datagrams between one client and the vehicle; ``heartbeat_s`` is the time of the first heartbeat."""

    def __init__(self, vehicle_port: int) -> None:
        self._vehicle = ("127.0.0.1", vehicle_port)
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind(("127.0.0.1", 0))
        self._back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._back.bind(("127.0.0.1", 0))
        self._client: tuple[str, int] | None = None
        self._runs = True
        self.heartbeat_s: float | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    @property
    def address(self) -> str:
        return f"udpout:127.0.0.1:{self._front.getsockname()[1]}"

    def begin(self) -> None:
        self._client = self.heartbeat_s = None

    def close(self) -> None:
        self._runs = False
        self._thread.join()
        self._front.close()
        self._back.close()

    def _run(self) -> None:
        while self._runs:
            for ready in select.select([self._front, self._back], [], [], 0.1)[0]:
                data, peer = ready.recvfrom(2048)
                if ready is self._front:
                    self._client = peer
                    self._back.sendto(data, self._vehicle)
                elif self._client is not None:
                    if self.heartbeat_s is None and _is_heartbeat(data):
                        self.heartbeat_s = time.perf_counter()
                    self._front.sendto(data, self._client)


def _is_heartbeat(data: bytes) -> bool:
    return data[0] == _FRAME and data[6] == _AUTOPILOT and data[7:10] == bytes(3)


@contextlib.contextmanager
def _vehicle() -> Iterator[int]:
    """Run a vehicle in real time; yield its port."""
    instance = free_instance()
    with (
        tempfile.TemporaryDirectory() as folder,
        child("sim_bridge", "--speed=1", f"--instance={instance}"),
        child(
            "flightstack", f"--instance={instance}", f"--sim-port={simulator_port(instance)}", "--log=none",
            f"--params={Path(folder) / 'params'}",
        ),
    ):  # fmt: skip
        yield vehicle_ground_port(instance)


def _run(*arguments: str) -> tuple[float, float, float]:
    """Run a Python program; return its processor time, its start and its end [s]."""
    began_s = time.perf_counter()
    with subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL, cwd=ROOT) as process:
        _, status, usage = os.wait4(process.pid, 0)
        ended_s = time.perf_counter()
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(arguments)} ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime, began_s, ended_s


def startup(rounds: int) -> Startup:
    """Measure each command in every round."""
    python: list[float] = []
    helps: dict[str, list[float]] = {}
    taken: dict[str, list[tuple[float, float, float]]] = {}
    with _vehicle() as port:
        relay = _Relay(port)
        try:
            _run("-m", "gcs_cli", "--connect", relay.address, f"--timeout={_WAIT_S}", "wait", "ready")
            for _ in range(rounds):
                python.append(_run("-c", "pass")[0])
                for words in HELPS:
                    helps.setdefault(" ".join(words), []).append(_run("-m", "gcs_cli", *words)[0])
                for words in ANSWERS:
                    relay.begin()
                    cpu_s, began_s, ended_s = _run("-m", "gcs_cli", "--connect", relay.address, *words)
                    heartbeat_s = relay.heartbeat_s or began_s
                    taken.setdefault(" ".join(words), []).append(
                        (cpu_s, ended_s - heartbeat_s, ended_s - began_s)
                    )
        finally:
            relay.close()
    columns = ({name: figure(v[i] for v in values) for name, values in taken.items()} for i in range(3))
    return Startup(figure(python), {name: figure(values) for name, values in helps.items()}, *columns)
