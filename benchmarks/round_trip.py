"""Bare TCP round trips between two processes, with the sizes of the lockstep frames and nothing else."""

from __future__ import annotations

import contextlib
import os
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

from benchmarks.echo import receiver
from benchmarks.measure import Figure, figure
from flightstack.simulator_link.hot_frames import ActuatorsFrame, PlantStateFrame


class Way(NamedTuple):
    """How the two ends wait, and where they run."""

    name: str
    spin: bool
    processors: int | None  # None: wherever the scheduler puts them


WAYS = (
    Way("waiting in recv, both on one processor", False, 1),
    Way("waiting in recv, on two processors", False, 2),
    Way("spinning, on two processors", True, 2),
    Way("spinning, where the scheduler puts them", True, None),
)


@contextlib.contextmanager
def _placed(processors: int | None) -> Iterator[list[str]]:
    """Run on one processor; yield the command that puts a child on the same or on another one."""
    allowed = sorted(os.sched_getaffinity(0))
    if processors is None:
        yield []
        return
    os.sched_setaffinity(0, {allowed[0]})
    try:
        yield ["taskset", "-c", str(allowed[processors - 1])]
    finally:
        os.sched_setaffinity(0, allowed)


def _round_trips_us(way: Way, seconds: float) -> list[float]:
    state, answer = bytes(PlantStateFrame().size), ActuatorsFrame().size
    times_us: list[float] = []
    with _placed(way.processors) as prefix, socket.create_server(("127.0.0.1", 0)) as server:
        port, word = server.getsockname()[1], "spin" if way.spin else "wait"
        command = [*prefix, sys.executable, "-m", "benchmarks.echo", str(port), word, str(answer)]
        with subprocess.Popen(command):
            connection = server.accept()[0]
            with connection:
                receive, send, clock_ns = (
                    receiver(connection, way.spin),
                    connection.send,
                    time.perf_counter_ns,
                )
                end_ns = clock_ns() + int(seconds * 1e9)
                began_ns = clock_ns()
                while began_ns < end_ns:
                    send(state)
                    receive()
                    ended_ns = clock_ns()
                    times_us.append((ended_ns - began_ns) / 1e3)
                    began_ns = ended_ns
    return times_us[len(times_us) // 10 :]  # without the beginning


def round_trips(rounds: int, seconds: float) -> dict[str, tuple[Figure, Figure]]:
    """Return median and mean of the round trips for each way [µs]: the mean shows the scheduler's stalls."""
    medians: dict[str, list[float]] = {}
    means: dict[str, list[float]] = {}
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 0
    ways = [way for way in WAYS if way.processors is None or way.processors <= count]
    for _ in range(rounds):
        for way in ways:
            times_us = _round_trips_us(way, seconds)
            medians.setdefault(way.name, []).append(statistics.median(times_us))
            means.setdefault(way.name, []).append(statistics.fmean(times_us))
    return {name: (figure(medians[name]), figure(means[name])) for name in medians}
