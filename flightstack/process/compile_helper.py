"""Compile some kernels in a second process, the compile helper, while this one compiles loops and the others.

The second process writes them to the cache, from which this one reads them. If it fails, this process compiles them.
Kernels that a vehicle in lockstep loads at their first use come last, while it flies.
"""

from __future__ import annotations

import atexit
import importlib
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from flightstack.commander.estimate_checks import LIMITS, watch_estimate
from flightstack.commander.failsafe_monitor import FailsafeMonitor
from flightstack.core.compiled import IS_DISABLED, Kernel, direct
from flightstack.core.contract import STATE_SIZE
from flightstack.core.kernels.cache import is_shared
from flightstack.estimation.agenda import fuse_next
from flightstack.estimation.delayed_filter import field_kernel, imu_kernel, push_kernel
from flightstack.estimation.estimator_params import PARAMS_SIZE, EstimatorParams
from flightstack.estimation.estimator_report import report_kernel
from flightstack.estimation.health import HealthMonitor
from flightstack.estimation.imu_track import ImuTrack
from flightstack.estimation.memory import MEMORY, filter_of, rings_of
from flightstack.estimation.rings import MAG_RING
from flightstack.flight_log.estimator_topics import store_estimator
from flightstack.flight_log.local_position import store_local_position
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.guidance.kernels import goal_kernel
from flightstack.guidance.navigator import Navigator
from flightstack.guidance.params import guidance_params
from flightstack.params.behaviour import Behaviour
from flightstack.params.config import DEFAULT_HOME, ESTIMATED, StackConfig
from flightstack.params.vehicle import DEFAULT_VEHICLE, load_vehicle
from flightstack.process.clock import rates
from flightstack.process.compile_notice import announce_compilation
from flightstack.simulator_link.endpoint import SimulatorEndpoint

GUIDANCE = "flightstack.process.compile_helper:compile_guidance"
COMMANDER = "flightstack.process.compile_helper:compile_commander"
MEASUREMENTS = "flightstack.process.compile_helper:compile_measurements"
ESTIMATOR = "flightstack.process.compile_helper:compile_estimator"
QUIET_TICKS = "flightstack.process.quiet_exchange:compile_any"

helper: subprocess.Popen[bytes] | None = None
_tasks: tuple[str, ...] = ()


def estimator_tasks(config: StackConfig) -> tuple[str, ...]:
    """Return the tasks for the estimator of a vehicle that flies on its sensors, none on the true state."""
    return (MEASUREMENTS, ESTIMATOR) if config.state == ESTIMATED else ()


def start(
    announced: Sequence[str] = (),
    tasks: Sequence[str] = (GUIDANCE, COMMANDER),
    later: Sequence[str] = (),
) -> None:
    """Start the helper with ``tasks``, "module:function" each, if the cache is cold and a second CPU is available.

    Nothing waits for those of ``later``, which it does while this process compiles the filter. It ends at the latest
    with this process. It announces its kernels on stderr if ``announced`` names all kernels of the program.
    """
    global helper, _tasks  # noqa: PLW0603  # one helper for each process
    if helper is not None or not is_useful(
        (goal_kernel, imu_kernel) if MEASUREMENTS in later else (goal_kernel,)
    ):
        return
    path = os.pathsep.join(str(Path(entry).absolute()) for entry in sys.path)
    try:
        helper = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, ";".join(map(",".join, (tasks, later))), *announced],
            stdin=subprocess.PIPE,  # closes with this process
            stdout=subprocess.PIPE,
            stderr=None if announced else subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": path},
            start_new_session=True,  # Ctrl-C on the terminal ends this process, which ends the helper
        )
    except OSError:
        return
    _tasks = tuple(tasks)
    atexit.register(_end, helper)


def _end(helper: subprocess.Popen[bytes]) -> None:
    helper.kill()
    helper.wait()


def finish(*, with_streams: bool) -> None:
    """Compile what the helper was not given, and wait for its tasks; do nothing if none was started.

    ``with_streams``: wait for the kernel of modes that follow a stream too.
    """
    if helper is None or helper.stdout is None or helper.stdout.closed:
        return
    if COMMANDER not in _tasks:
        compile_commander()
    helper.stdout.read(1)  # one byte after the tasks, none if it failed
    helper.stdout.close()
    if with_streams:
        helper.wait()
    else:
        threading.Thread(target=helper.wait, daemon=True).start()


def is_useful(kernels: Sequence[Any] = (goal_kernel,)) -> bool:
    """Return True if a helper can run beside this process and share its results, and one of ``kernels`` is missing."""
    if IS_DISABLED or not is_shared():
        return False
    cpus = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cpus > 1 and any(has_cache(kernel) and not is_cached(kernel) for kernel in kernels)


def has_cache(kernel: Any) -> bool:
    """Return False if ``kernel`` is compiled in each process: its sources changed after the start of this one."""
    return kernel.stats.cache_path is not None


def is_cached(kernel: Any) -> bool:
    """Return True if the cache on disk holds a compiled version of ``kernel``."""
    return has_cache(kernel) and any(Path(kernel.stats.cache_path).glob(f"*.{kernel.__name__}-*.nbi"))


def compile_guidance() -> Navigator:
    """Compile the kernels of guidance that every flight needs, or load them from the cache."""
    vehicle, loop_rates = load_vehicle(DEFAULT_VEHICLE), rates(500.0, 100.0)
    return Navigator(guidance_params(Behaviour(), vehicle.weight_n), loop_rates.outer_hz)


def compile_commander() -> None:
    """Compile the kernels of failsafes and of the log, or load them from the cache."""
    vehicle, loop_rates = load_vehicle(DEFAULT_VEHICLE), rates(500.0, 100.0)
    simulator = SimulatorEndpoint(vehicle, DEFAULT_HOME, True, 1, loop_rates.interval_us)
    FailsafeMonitor(
        vehicle, Behaviour(), loop_rates.outer_hz, loop_rates.divisor, np.zeros(STATE_SIZE), simulator
    ).warm_up()
    FlightRecorder(lambda: None, {}, dict, DEFAULT_HOME, lambda: simulator.battery)


def compile_estimator() -> None:
    """Compile the kernels of the estimator besides that of the IMU, which takes longer than all others."""
    memory, track = np.zeros(1, MEMORY), ImuTrack().memory
    watch = HealthMonitor(memory).watch
    direct(watch_estimate, memory, watch, track, np.zeros(1, LIMITS), False, False, 0.0)
    direct(push_kernel, memory, MAG_RING, np.zeros(4))
    direct(field_kernel, memory)
    direct(report_kernel, memory, track, 0.0)
    direct(store_local_position, memory, track, False, 0.0, np.zeros(0))
    direct(store_estimator, memory, track, 0.0, np.zeros(0), np.zeros(0))


def compile_measurements() -> None:
    """Compile the part of the filter's kernel that fuses measurements, while the parent compiles what comes before."""
    numba = importlib.import_module("numba")
    memory = numba.typeof(np.zeros(1, MEMORY)).dtype
    params = numba.typeof(EstimatorParams(*np.zeros(PARAMS_SIZE).tolist()))
    filter_kernel, rings_kernel, kernel = cast("tuple[Kernel, ...]", (filter_of, rings_of, fuse_next))
    views = filter_kernel.dispatcher.part_result(memory), rings_kernel.dispatcher.part_result(memory)
    kernel.dispatcher.part_result(memory, *views, params)


def _run(tasks: str) -> None:
    for task in filter(None, tasks.split(",")):
        module, _, function = task.partition(":")
        getattr(importlib.import_module(module), function)()


def _end_with_parent() -> None:
    """Exit when stdin closes. It is read without a buffer, whose lock would abort the interpreter at its end."""
    os.read(0, 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    notice = announce_compilation("flightstack", sys.argv[2:], began=True) if sys.argv[2:] else None
    first, _, last = sys.argv[1].partition(";")
    _run(first)
    if notice is not None:
        notice.stop()  # the vehicle flies
    os.write(1, b"\n")
    _run(last)
    compile_guidance().warm_up_streams()
