"""A simulator and a flight stack as real processes, for tests that talk to them over real sockets."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gcs_cli.endpoint import vehicle_connection
from tests.support.free_instance import free_instance

LONG_S = 60.0
"""A hang guard: no process of a test lives longer."""


@dataclass
class VehicleProcesses:
    """Where the vehicle is."""

    instance: int
    simulator: subprocess.Popen[str] | None
    stack: subprocess.Popen[str]
    folder: Path

    @property
    def link(self) -> str:
        """What ``gcs --connect`` needs."""
        return vehicle_connection(self.instance)


@contextlib.contextmanager
def vehicle(
    folder: Path, *arguments: object, speed: object = 10, with_simulator: bool = True
) -> Iterator[VehicleProcesses]:
    """Run both; ``arguments`` go to the flight stack. Both are ended, whatever happens."""
    instance = free_instance()
    with contextlib.ExitStack() as ends:

        def run(module: str, *words: object) -> subprocess.Popen[str]:
            command = [sys.executable, "-m", module, "--instance", str(instance), *map(str, words)]
            pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
            process = subprocess.Popen(command, cwd=folder, text=True, **pipes)
            ends.callback(process.communicate)
            ends.callback(process.kill)
            return process

        simulator = run("sim_bridge", "--speed", speed) if with_simulator else None
        stack = run("flightstack", *arguments)
        assert stack.stdout is not None
        assert stack.stdout.readline(), "flightstack ended at its start"
        yield VehicleProcesses(instance, simulator, stack, folder)
