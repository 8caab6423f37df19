"""Fly on a Dask worker, in a process of each of its threads, as a worker of this machine does.

Threads of one process would share caches, and a flight that crashes would take the Dask worker away. The process is
kept for the next flight and ends with the Dask worker, because its standard input closes.
"""

from __future__ import annotations

import contextlib
import pickle
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import distributed

from flightstack.core.errors import ConfigError
from gcs_cli.campaign.installed import difference, digests, installation
from gcs_cli.campaign.order import Order, below, without_root
from gcs_cli.scenarios.pool import Finished, Pool, Tick
from gcs_cli.scenarios.result import Result, Wanted
from gcs_cli.scenarios.selection import Case

_OPEN = (distributed.Status.running, distributed.Status.paused, distributed.Status.closing_gracefully)


class Answer(NamedTuple):
    """What became of an order: a result, the reason that there is none, or the problem of this worker."""

    result: Result | None = None
    reason: str = ""
    problem: str = ""


_thread = threading.local()
"""``session``, ``root`` and ``pool`` of the client for which this thread flies; ``installed`` files that are equal."""


def fly(session: str, folder: str, wanted: Mapping[str, str], order: bytes) -> Answer:
    """Fly a pickled ``Order``; called by Dask.

    ``session`` is unique to a client, ``folder`` its working directory. An installation that differs from ``wanted``
    flies nothing: its results, and already its orders, may differ.
    """
    worker = distributed.get_worker()
    if getattr(_thread, "session", None) != session:
        if problem := difference(wanted, installation()):
            return Answer(problem=f"worker {worker.address} {problem}")
        _begin(session, Path(worker.local_directory) / f"flightstack-{session}", folder)
    given: Order = pickle.loads(order)
    case = given.place(_thread.root)
    if given.installed != _thread.installed:
        if problem := _problem(case, given.installed):
            return Answer(problem=f"worker {worker.address} {problem}")
        _thread.installed = given.installed
    return _flown(worker, case, given.wanted)


def _problem(case: Case, wanted: Mapping[str, str]) -> str:
    """Return how the installed files of a case differ from those of the client, as the end of a sentence, or empty."""
    try:
        return difference(wanted, digests(case.scenario.installed_files()))
    except ConfigError as error:  # without the controller
        return f"cannot fly: {error}"


def _begin(session: str, root: Path, folder: str) -> None:
    """Start the process of this thread anew, in the place of the client's working directory."""
    if hasattr(_thread, "pool"):
        _thread.pool.close()
    here = below(root, folder)
    here.mkdir(parents=True, exist_ok=True)
    _thread.pool, _thread.root, _thread.session = Pool(1, here), root, session
    _thread.installed = None


def _flown(worker: distributed.Worker, case: Case, wanted: Wanted) -> Answer:
    """Fly a case; stop if the client no longer wants it or the Dask worker ends."""
    key = worker.get_current_task()
    with contextlib.closing(_thread.pool.fly([case], wanted)) as messages:
        for message in messages:
            if isinstance(message, Finished):
                if message.result is None:
                    return Answer(reason=f"{message.reason} on worker {worker.address}")
                return Answer(without_root(message.result, _thread.root))
            if isinstance(message, Tick) and not _is_wanted(worker, key):
                break
    return Answer(reason="it was cancelled")


def _is_wanted(worker: distributed.Worker, key: str) -> bool:
    task = worker.state.tasks.get(key)
    return worker.status in _OPEN and task is not None and task.state != "cancelled"
