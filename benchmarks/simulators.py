"""Other simulators, from a Python with their package: ``--against rotorpy=PYTHON,pybullet_drones=PYTHON,jax=PYTHON``.

A vehicle flies rounds of a square of 4 m at 1 m/s with the controller of its simulator, at 500 Hz, on the true state.
It has no autopilot: no modes, failsafes, messages or log. The scripts in ``simulator_flights`` call the public
interface of each. A process of each flies all rounds: imports and compilation count in the first one alone.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import IO, NamedTuple

from benchmarks.peer_error import PeerError

_FOLDER = Path(__file__).parent / "simulator_flights"
_LARGEST_ERROR_M = 1.0
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "JAX_PLATFORMS": "cpu"}
"""Threads that wait for each other would count as processor time."""
_LIMIT_S = 300.0
"""Longest wall time of an answer: the first one includes imports and compilation."""


class Flight(NamedTuple):
    """One row of a simulator."""

    title: str
    seconds: float
    """Simulated time of a flight: a few seconds of wall time."""
    arguments: tuple[str, ...] = ()


class Simulator(NamedTuple):
    """A simulator in a Python package."""

    package: str
    """The module that has to be there."""
    requirement: str
    """What pip installs."""
    script: str
    flights: tuple[Flight, ...]

    def problem(self, python: Path) -> str:
        """Return the reason why the interpreter cannot fly it, or an empty text."""
        if not (python.is_file() and os.access(python, os.X_OK)):
            return f"{python} is no Python: give that of a virtual environment with {self.package}"
        seek = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({self.package!r}) is None)"
        try:
            found = subprocess.run(
                [python, "-I", "-c", seek], capture_output=True, check=False, timeout=_LIMIT_S
            )
        except subprocess.TimeoutExpired:
            return f"{python} does not answer within {_LIMIT_S:g} s"
        if found.returncode:
            return f'{python} has no {self.package}: {python} -m pip install "{self.requirement}"'
        return ""

    @contextlib.contextmanager
    def opened(self, python: Path) -> Iterator[dict[str, Callable[[], float]]]:
        """Yield what flies once, by the name of its row."""
        with contextlib.ExitStack() as stack:
            yield {
                each.title: partial(fly, each, stack.enter_context(_running(python, self.script, each)))
                for each in self.flights
            }


SIMULATORS = {
    "rotorpy": Simulator(
        "rotorpy",
        "rotorpy",
        "rotorpy_square.py",
        (Flight("RotorPy, with IMU and motion capture", 4.0),),
    ),
    "pybullet_drones": Simulator(
        "gym_pybullet_drones",
        "gym-pybullet-drones @ git+https://github.com/learnsyslab/gym-pybullet-drones",
        "pybullet_drones_square.py",
        (Flight("gym-pybullet-drones", 10.0),),
    ),
    "jax": Simulator(
        "crazyflow",
        "crazyflow",
        "crazyflow_square.py",
        (
            Flight("Crazyflow (JAX), 1 world", 20.0, ("1",)),
            Flight("Crazyflow (JAX), 1000 worlds at once", 4.0, ("1000",)),
        ),
    ),
}


class _Process(NamedTuple):
    program: subprocess.Popen[str]
    errors: IO[str]

    def ask(self, line: str) -> str:
        """Send a line; return the answer, or an empty text if the process has ended.

        It is ended after ``_LIMIT_S``. Lines that are no JSON are what the simulator prints.
        """
        stdin, stdout = self.program.stdin, self.program.stdout
        assert stdin is not None
        assert stdout is not None
        late = threading.Timer(_LIMIT_S, self.end)
        late.start()
        try:
            with contextlib.suppress(BrokenPipeError):
                print(line, file=stdin, flush=True)
            return next((line for line in iter(stdout.readline, "") if line.startswith('{"')), "")
        finally:
            late.cancel()

    def end(self) -> None:
        """End the process and those that it started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.program.pid, signal.SIGKILL)

    def last_error(self) -> str:
        """Return the last line that the process wrote to stderr."""
        self.errors.seek(0)
        lines = self.errors.read().strip().splitlines()
        return lines[-1] if lines else f"ended with code {self.program.wait()}"


@contextlib.contextmanager
def _running(python: Path, script: str, flight: Flight) -> Iterator[_Process]:
    """Run a script in an empty directory, and end it."""
    command = [str(python), str(_FOLDER / script), *flight.arguments]
    plain = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+", encoding="utf-8") as errors:
        program = subprocess.Popen(
            command,
            cwd=folder,
            env={**plain, **_ONE_THREAD},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            start_new_session=True,
        )
        process = _Process(program, errors)
        try:
            yield process
        finally:
            process.end()
            program.communicate()


def fly(flight: Flight, process: _Process) -> float:
    """Fly once; return the real-time factor by processor time, of all worlds together. Raise PeerError."""
    answer = process.ask(f"{flight.seconds:g}")
    if not answer:
        raise PeerError(f"{flight.title}: {process.last_error()}")
    try:
        flown = json.loads(answer)
        error_m, simulated_s, processor_s = (
            float(flown[name]) for name in ("error_m", "simulated_s", "processor_s")
        )
    except (ValueError, KeyError, TypeError):
        raise PeerError(f"{flight.title}: no figures in its answer {answer.strip()!r}") from None
    if not error_m < _LARGEST_ERROR_M:
        raise PeerError(f"{flight.title} did not fly the square: {error_m:.3g} m from it at the end")
    return simulated_s / processor_s
