"""Compile the kernels of guidance and commander in a second process, while this one compiles loops and plant.

The second process writes them to the cache, from which this one reads them. If it fails, this process compiles them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numba
import numpy as np

from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.core.contract import STATE_SIZE
from flightstack.core.kernel_cache import is_shared
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.guidance.kernels import goal_kernel, stream_kernel
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.params import guidance_params
from flightstack.params.behaviour import Behaviour
from flightstack.params.config import DEFAULT_HOME
from flightstack.params.vehicle import DEFAULT_VEHICLE, load_vehicle
from flightstack.process.clock import rates
from flightstack.process.compile_notice import announce_compilation
from flightstack.simulator_link.endpoint import SimulatorEndpoint

_helper: subprocess.Popen[bytes] | None = None


def start(announced: Sequence[str] = ()) -> None:
    """Start the helper if the cache is cold and a second CPU is available. It ends at the latest with this process.

    It announces its kernels on stderr if ``announced`` names all kernels of the program.
    """
    global _helper  # noqa: PLW0603  # one helper for each process
    if _helper is not None or not _is_useful():
        return
    path = os.pathsep.join(str(Path(entry).absolute()) for entry in sys.path)
    try:
        _helper = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, *announced],
            stdin=subprocess.PIPE,  # closes with this process
            stdout=subprocess.DEVNULL,
            stderr=None if announced else subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": path},
        )
    except OSError:
        return


def wait() -> None:
    """Wait until the helper has ended, if one was started."""
    if _helper is not None and _helper.stdin is not None:
        _helper.wait()
        _helper.stdin.close()


def _is_useful() -> bool:
    """Return True if a helper can run beside this process and share its results, and has something to do."""
    if numba.config.DISABLE_JIT or not is_shared():
        return False
    cpus = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cpus > 1 and not (_is_cached(stream_kernel) and _is_cached(goal_kernel))


def _is_cached(kernel: Any) -> bool:
    return any(Path(kernel.stats.cache_path).glob(f"*.{kernel.__name__}-*.nbi"))


def compile_kernels() -> None:
    """Compile the kernels that every vehicle needs beside its loops, or load them from the cache."""
    vehicle, behaviour, loop_rates = load_vehicle(DEFAULT_VEHICLE), Behaviour(), rates(500.0, 100.0)
    simulator = SimulatorEndpoint(vehicle, DEFAULT_HOME, True, 1, loop_rates.interval_us)
    Navigator(guidance_params(behaviour, vehicle.weight_n), loop_rates.outer_hz)
    FailsafeMonitor(
        vehicle, behaviour, loop_rates.outer_hz, loop_rates.divisor, np.zeros(STATE_SIZE), simulator
    ).warm_up()
    FlightRecorder(lambda: None, {}, dict, DEFAULT_HOME, lambda: simulator.battery)


def _end_with_parent() -> None:
    """Exit when stdin closes. It is read without a buffer, whose lock would abort the interpreter at its end."""
    os.read(0, 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if sys.argv[1:]:
        announce_compilation("flightstack", sys.argv[1:], began=True)
    compile_kernels()
