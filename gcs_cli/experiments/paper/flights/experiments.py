"""Fly many cases in several processes, and keep of each the parts for results and report.

The cases are independent: any number of processes gives the same results, in the order of the cases.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, NamedTuple

import numpy as np

from gcs_cli.errors import CliError
from gcs_cli.experiments.paper.flights.cases import (
    DESIRED,
    IDEAL,
    NO_LIMITS,
    NUDGE,
    PLAIN,
    SHAPED,
    STEPS,
    condition_of,
)
from gcs_cli.experiments.paper.flights.closed_loop import fly
from gcs_cli.experiments.paper.flights.metrics import effort, measure, path_metrics
from gcs_cli.experiments.paper.flights.types import AxisMetrics, Case, Recording

MOST_JOBS = 8
THIN = 4
"""Decimation of a recording that is only drawn, to 250 Hz."""
FULL = (DESIRED, *STEPS)
"""Trajectories whose recordings are kept tick by tick: the plants are compared along them."""
_DRAWN = (PLAIN, IDEAL, NO_LIMITS, SHAPED, NUDGE.name)


class Flown(NamedTuple):
    """The results of all cases."""

    entries: dict[str, dict[str, Any]]
    """For results.json, by the case's key."""
    recordings: dict[str, Recording]
    """Of the cases that are drawn."""


def default_jobs() -> int:
    """Return the default number of processes."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return min(MOST_JOBS, usable or 1)


def entry_of(recording: Recording) -> dict[str, Any]:
    """Return the entry of a case in results.json."""
    path = path_metrics(recording)
    ended = {"time_s": recording.ended_s, "why": recording.ended_why, "how": recording.ended_how}
    return {
        **recording.case._asdict(),
        "force_ned_n": list(recording.case.force_ned_n),
        "torque_frd_n_m": list(recording.case.torque_frd_n_m),
        "metrics": {name: _plain(axis) for name, axis in measure(recording).items()},
        "path": None if path is None else path._asdict(),
        "effort": effort(recording)._asdict(),
        "ended": None if recording.ended_s is None else ended,
    }


def _plain(axis: AxisMetrics) -> dict[str, Any]:
    return {**axis._asdict(), "moves": [move._asdict() for move in axis.moves]}


def thinned(recording: Recording, every: int = THIN) -> Recording:
    """Return the recording with one of ``every`` rows."""
    arrays: dict[str, Any] = {
        name: value[::every].copy()
        for name, value in recording._asdict().items()
        if isinstance(value, np.ndarray)
    }
    return recording._replace(**arrays)


def experiment(case: Case) -> tuple[dict[str, Any], Recording | None]:
    """Fly a case; return its entry, and its recording if it is drawn; raise ConfigError."""
    recording = fly(case)
    entry = entry_of(recording)
    condition = condition_of(case)
    if condition not in _DRAWN:
        return entry, None
    if case.trajectory in FULL and condition != IDEAL:
        return entry, recording
    return entry, thinned(recording)


def run_cases(
    cases: Sequence[Case], jobs: int, tell: Callable[[int, int], None] = lambda done, total: None
) -> Flown:
    """Fly the cases; ``tell`` is called with the number of finished cases and their total. Raise ConfigError.

    One job starts no process.
    """
    found: dict[str, tuple[dict[str, Any], Recording | None]] = {}
    tell(0, len(cases))
    if jobs == 1:
        for case in cases:
            found[case.key] = experiment(case)
            tell(len(found), len(cases))
    else:
        _warm_up(cases)
        found = run_in_processes(cases, jobs, tell)
    ordered = [(case.key, *found[case.key]) for case in cases]
    return Flown(
        {name: entry for name, entry, _ in ordered},
        {name: recording for name, _, recording in ordered if recording is not None},
    )


def _warm_up(cases: Sequence[Case]) -> None:
    """Compile each kernel once in this process, so that the others read it from the cache."""
    kinds = {(case.plant, case.controller): case for case in cases}
    for case in kinds.values():
        fly(case._replace(trajectory="step_roll", inner_hz=250))


def run_in_processes(
    cases: Sequence[Case], jobs: int, tell: Callable[[int, int], None]
) -> dict[str, tuple[dict[str, Any], Recording | None]]:
    """Fly ``cases`` in ``jobs`` processes; ``tell(done, total)`` is called after each."""
    found: dict[str, tuple[dict[str, Any], Recording | None]] = {}
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"))
    try:
        with _interrupts_ignored():
            waiting: dict[Future[tuple[dict[str, Any], Recording | None]], str] = {
                pool.submit(experiment, case): case.key for case in cases
            }
        for future in as_completed(waiting):
            found[waiting[future]] = future.result()
            tell(len(found), len(cases))
    except BrokenProcessPool:
        raise CliError(
            "a process that flew experiments was ended from outside; --jobs 1 needs none"
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return found


@contextlib.contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Ignore Ctrl-C while processes are started, which inherit this: only the parent ends them."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
