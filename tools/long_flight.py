"""Hold a position for simulated hours, and print what grows: memory, log buffers, errors of time and of position.

python -m tools.long_flight --hours 24 --state estimated

A line after each simulated hour, or after a third of less than three. The log is counted and not kept: a world keeps
it in memory, and a flight writes some 400 MB an hour. It exits with 1 if memory grows by more than ``LIMITS`` an hour,
if a step is not exact, or if the vehicle does not hold its place.
"""

from __future__ import annotations

import argparse
import gc
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightstack.flight_log.flight_log import FlightLog
from flightstack.params.config import ESTIMATED, STATES, TRUTH
from flightstack.testing import Setup, World
from flightstack.testing.engine import Engine

HOUR_S = 3600.0
_LEAST_H, _MOST_H = 0.05, 1000.0
_SAMPLES = 3
"""Least number of samples."""
ALTITUDE_M = 5.0
PLACE_M = {TRUTH: 0.1, ESTIMATED: 5.0}
"""Largest distance from the place that is held, in wind and gusts: on sensors mostly the error of GNSS in a day."""


class Kept(NamedTuple):
    """What is kept, or how much more in an hour."""

    memory_mb: float
    """Resident memory of the process; 0 where the system does not tell."""
    objects: float
    """Objects that the garbage collector knows."""
    blocks: float
    """Blocks of memory that Python has allocated."""
    buffers_mb: float
    """Rows of the log that are not written yet."""


LIMITS = Kept(memory_mb=2.0, objects=50.0, blocks=500.0, buffers_mb=0.0)
"""Most growth in a simulated hour."""


class Sample(NamedTuple):
    """The world at one time of its flight."""

    flown_s: float
    """Simulated time since the first sample."""
    wall_s: float
    kept: Kept
    log_mb: float
    """What the log has written."""
    late_us: int
    """Time of vehicle and simulator, less that of the steps: 0 if each step is exact."""
    uneven: int
    """Steps between rows of the log that are not one period."""
    error_m: float
    """Distance from the place that is held."""


class CountedFile:
    """A log file that counts its bytes and keeps none."""

    size = 0

    def write(self, data: bytes | memoryview, /) -> int:
        """Count bytes."""
        self.size += len(data)
        return len(data)

    def truncate(self, size: int, /) -> int:
        """Shorten the file."""
        self.size = size
        return size

    def close(self) -> None:
        """Do nothing."""


class EvenLog(FlightLog):
    """A log that counts rows of the loops that do not follow the one before by one period."""

    def __init__(self, file: CountedFile, rotors: int, periods_us: tuple[int, int]) -> None:
        super().__init__(file, rotors)
        self.uneven = 0
        self._periods_us = periods_us
        self._last_us = [0, 0]
        """Time of the newest row of the inner and of the outer loop; 0 before the first."""

    def flush(self) -> None:
        """Look at the times of the rows before they are written."""
        for index, trace in enumerate((self.inner, self.outer)):
            if trace.n:
                times_us = np.concatenate(
                    ([self._last_us[index]], trace.times_us[: trace.n].astype(np.int64))
                )
                steps_us = np.diff(times_us if times_us[0] else times_us[1:])
                self.uneven += int(np.count_nonzero(steps_us != self._periods_us[index]))
                self._last_us[index] = int(times_us[-1])
        super().flush()

    @property
    def buffers_mb(self) -> float:
        """Size of all buffered rows, also of empty ones."""
        traces = (self.inner, self.outer, *self.sampled.values())
        return 1e-6 * sum(trace.rows.nbytes + trace.times_us.nbytes for trace in traces)


class CountingEngine(Engine):
    """Counts the log, and keeps none."""

    file: CountedFile
    log: EvenLog

    def _open_log(self) -> FlightLog:
        rates = self.stack.rates
        self.file = CountedFile()
        periods_us = (rates.interval_us, rates.interval_us * rates.divisor)
        self.log = EvenLog(self.file, len(self.stack.vehicle.rotors), periods_us)
        return self.log


def setup(state: str, loops: str = "python") -> Setup:
    """Return a vehicle in wind and gusts whose battery lasts for days."""
    return Setup(
        vehicle="x_quad", wind=(3.0, 2.0), gust=0.8, battery_capacity_mah=1e6, state=state, loops=loops
    )


def samples(conditions: Setup, interval_s: float, count: int, telemetry: bool = True) -> Iterator[Sample]:
    """Take off, hold a position, and yield ``count`` samples, one each ``interval_s`` of simulated time.

    The first one comes after ``interval_s`` as well: buffers and caches have their size then. ``telemetry``: stream at
    PX4's default rates instead of a few messages a second.
    """
    with World(conditions, make_engine=CountingEngine, telemetry=telemetry) as world:
        engine = world.engine
        assert isinstance(engine, CountingEngine)
        world.wait_until_ready()
        world.takeoff(ALTITUDE_M)
        world.run_until("mode == 'HOLD'")
        began_s, from_us, start_us = time.perf_counter(), engine.stack.now.time_us, engine.simulator.time_us
        step_us = round(interval_s * engine.stack.rates.inner_hz) * engine.stack.rates.interval_us
        for number in range(1, count + 1):
            world.run_for(interval_s)
            passed_us = engine.stack.now.time_us - from_us, engine.simulator.time_us - start_us
            state = world.state
            yield Sample(
                number * step_us * 1e-6,
                time.perf_counter() - began_s,
                Kept(memory_mb(), *counted(), engine.log.buffers_mb),
                engine.file.size * 1e-6,
                max((passed - number * step_us for passed in passed_us), key=abs),
                engine.log.uneven,
                max(abs(state.north_m), abs(state.east_m), abs(state.altitude_m - ALTITUDE_M)),
            )


def memory_mb() -> float:
    """Return the resident memory of this process; 0 where the system does not tell."""
    try:
        text = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return 0.0
    return next(int(line.split()[1]) / 1024 for line in text.splitlines() if line.startswith("VmRSS"))


def counted() -> tuple[int, int]:
    """Return the number of objects and of blocks of memory, without garbage."""
    gc.collect()
    return len(gc.get_objects()), sys.getallocatedblocks()


def growth(first: Sample, last: Sample) -> Kept:
    """Return the growth in a simulated hour, or in a shorter time between the samples."""
    flown_h = max(1.0, (last.flown_s - first.flown_s) / HOUR_S)
    return Kept(*((after - before) / flown_h for before, after in zip(first.kept, last.kept, strict=True)))


def problems(first: Sample, last: Sample, state: str) -> list[str]:
    """Return what is wrong with a flight on a state, a line for each."""
    found = [
        f"{name} grows by {grown:.3g} an hour, at most {limit:g} is allowed"
        for name, grown, limit in zip(Kept._fields, growth(first, last), LIMITS, strict=True)
        if grown > limit
    ]
    if last.late_us or last.uneven:
        found.append(f"steps are not exact: {last.late_us} µs late, {last.uneven} rows of the log uneven")
    if not last.error_m < PLACE_M[state]:
        found.append(f"the vehicle is {last.error_m:.3g} m from the place that it holds")
    return found


def line(sample: Sample, before_s: float) -> str:
    """Return the line of a sample; ``before_s`` is the wall time of the one before."""
    kept = sample.kept
    return (
        f"{sample.flown_s / HOUR_S:9.2f} {sample.wall_s - before_s:8.1f} {kept.memory_mb:10.1f} {kept.objects:9.0f} "
        f"{kept.blocks:9.0f} {kept.buffers_mb:11.2f} {sample.log_mb:9.0f} {sample.late_us:8d} {sample.uneven:7d} "
        f"{sample.error_m:8.3f}"
    )


def hours(text: str) -> float:
    """Return a number of hours; raise ArgumentTypeError."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not _LEAST_H <= number <= _MOST_H:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from {_LEAST_H} to {_MOST_H}")
    return number


def intervals(flown_h: float) -> tuple[float, int]:
    """Return the time between samples [s], an hour at most, and their number: some, so that growth can be seen."""
    count = max(_SAMPLES, math.ceil(flown_h))
    return flown_h / count * HOUR_S, count


HEAD = "  flown, h  wall, s  memory, MB   objects    blocks  buffers, MB  log, MB  late, µs  uneven  error, m"


def main() -> int:
    """Fly and print; return 1 if something grows or is not exact."""
    parser = argparse.ArgumentParser(prog="python -m tools.long_flight", description=__doc__)
    parser.add_argument("--hours", type=hours, default=24.0, help="simulated time (default %(default)g)")
    parser.add_argument("--state", choices=STATES, default=TRUTH)
    parser.add_argument("--loops", default="python", help="as those of flightstack")
    parser.add_argument(
        "--telemetry", action="store_true", help="stream at PX4's rates: takes twice the time"
    )
    given = parser.parse_args()
    print(HEAD)
    seen: list[Sample] = []
    interval_s, count = intervals(given.hours)
    for sample in samples(setup(given.state, given.loops), interval_s, count, given.telemetry):
        print(line(sample, seen[-1].wall_s if seen else 0.0), flush=True)
        seen.append(sample)
    found = problems(seen[0], seen[-1], given.state)
    print("\n".join(found) or "nothing grows, and each step is exact")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
