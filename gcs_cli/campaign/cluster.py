"""Fly cases on the workers of a Dask cluster: ``gcs campaign --scheduler tcp://HOST:PORT``.

Dask schedules, flies the flights of a lost worker again, and takes workers that join. The client keeps the journal: a
lost scheduler loses no flight that is over.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import functools
import logging
import math
import pickle
import secrets
import socket
import time
import warnings
from collections.abc import Generator, Iterator, Mapping, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any

import distributed

from gcs_cli.campaign.cluster_worker import Answer, fly
from gcs_cli.campaign.flyer import SchedulerLostError
from gcs_cli.campaign.installed import installation
from gcs_cli.campaign.order import Files, Order
from gcs_cli.errors import NO_ANSWER, USAGE, CliError
from gcs_cli.scenarios.pool import Cases, Finished, Message, Notice, Started, Tick
from gcs_cli.scenarios.result import Wanted

ANSWER_S = 10.0
"""Longest wait for the scheduler's first answer."""
_AHEAD, _FEWEST = 2, 2
"""Flights at the scheduler: for each thread of a worker one that is flown and the next one; at least."""
_TICK_S = 0.1
_SIZE_S = 1.0
"""Time between two requests for the size of the cluster."""
_CLOSE_S = 2.0
"""Longest wait for the end of the connection: without its scheduler Dask tries to connect for a while."""
_PACKAGE = "flightstack"
_LOST = (OSError, concurrent.futures.CancelledError, distributed.client.ClosedClientError)
"""What Dask raises without its scheduler."""


def _silence() -> None:
    """Discard Dask's log: one sentence of this program says what happened."""
    names = ("distributed", "tornado", "asyncio")
    for name in [*names, *logging.root.manager.loggerDict]:  # Dask gives several loggers levels of their own
        if name.partition(".")[0] in names:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


class ClusterPool:
    """The workers of a Dask cluster in place of processes of this machine. Leaving the ``with`` block disconnects."""

    def __init__(self, address: str) -> None:
        """Raise CliError (usage) for what is no address."""
        self._address = address
        _silence()
        try:
            self._place: tuple[str, int] = distributed.comm.get_address_host_port(address, strict=True)
        except ValueError:
            problem = "is no address of a scheduler, such as tcp://10.0.0.1:8786"
            raise CliError(f"--scheduler: {address} {problem}", USAGE) from None
        self._session = secrets.token_hex(8)
        self._files = Files()
        self._client: Any = None
        self._installation: Mapping[str, str] = {}

    def fly(self, cases: Cases, wanted: Wanted) -> Generator[Message, None, None]:
        """Fly the cases and yield their events; cancel all flights if the iterator is closed.

        Raise SchedulerLostError; CliError without a scheduler, or for a worker whose results may differ; OSError.
        """
        if not cases:
            return
        client = self._connected()
        run = _Run(client, self._address, (self._session, str(Path.cwd()), self._installation))
        try:
            while run.over < len(cases):
                numbers = range(run.submitted, min(run.submitted + run.room(), len(cases)))
                if numbers:
                    run.submit([self._files.order(cases[number], wanted) for number in numbers])
                    yield from map(Started, numbers)
                yield from run.events()
        finally:
            run.cancel()

    def _connected(self) -> Any:
        """Return the client, connected at its first use: a campaign that is over needs no cluster."""
        if self._client is None:
            self._installation = installation()
            warnings.filterwarnings("ignore", module="distributed")  # other versions of libraries
            try:
                _wait_for(self._place)
                self._client = distributed.Client(self._address, timeout=ANSWER_S, set_as_default=False)
            except ImportError as error:
                raise CliError(f"--scheduler {self._address}: {error}", USAGE) from None
            except OSError:
                problem = "no Dask scheduler answers: start one with `dask scheduler`, or check the address"
                raise CliError(f"--scheduler {self._address}: {problem}", NO_ANSWER) from None
        return self._client

    def __enter__(self) -> ClusterPool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._client is not None:
            with contextlib.suppress(*_LOST):
                self._client.close(timeout=_CLOSE_S)


def _wait_for(place: tuple[str, int]) -> None:
    """Wait until something listens at host and port; raise OSError after ``ANSWER_S``.

    Dask waits too, but a Ctrl-C then leaves a client that ends after 20 s, with a traceback.
    """
    deadline_s = time.monotonic() + ANSWER_S
    while True:
        try:
            with socket.create_connection(place, timeout=ANSWER_S):
                return
        except OSError:
            if time.monotonic() >= deadline_s:
                raise
            time.sleep(_TICK_S)


class _Run:
    """Flights at the scheduler: a few more than it has threads, however many there are to fly."""

    def __init__(self, client: Any, address: str, session: tuple[str, str, Mapping[str, str]]) -> None:
        self._client, self._address, self._session = client, address, session
        self._flying: dict[int, tuple[Any, concurrent.futures.Future[Answer | None]]] = {}
        """Future of Dask, and the answer that is fetched when it is done, by the number of their cases."""
        self._done: SimpleQueue[int] = SimpleQueue()
        self._threads, self._next_size_s = 1, -math.inf
        self._seen: set[str] = set()
        """Addresses of workers that were checked."""
        self._has_noted = False
        self.submitted = self.over = 0
        """Numbers of cases."""

    def room(self) -> int:
        """Return how many more flights are to be submitted; workers come and go."""
        now_s = time.monotonic()
        if now_s >= self._next_size_s:
            self._next_size_s = now_s + _SIZE_S
            with self._losing_scheduler():
                threads: Mapping[str, int] = self._client.nthreads()
                if not threads.keys() <= self._seen:
                    self._check_installed()
            self._threads = sum(threads.values())
        return max(_AHEAD * self._threads, _FEWEST) - len(self._flying)

    def _check_installed(self) -> None:
        """Raise CliError (usage) for a process that cannot read its messages: it would end without saying why."""
        versions = self._client.get_versions(packages=[_PACKAGE])
        for name, each in {"the scheduler": versions["scheduler"], **versions["workers"]}.items():
            if each["packages"].get(_PACKAGE) is None:
                place = name if name == "the scheduler" else f"worker {name}"
                raise CliError(f"{place} has no flightstack: install the same as on the client", USAGE)
        self._seen |= versions["workers"].keys()

    def submit(self, orders: Sequence[Order]) -> None:
        """Submit the next cases at once: alone each takes the scheduler three times as long."""
        task = functools.partial(fly, *self._session)
        with self._losing_scheduler():
            futures = self._client.map(task, list(map(pickle.dumps, orders)), pure=False)
        for number, future in enumerate(futures, self.submitted):
            self._flying[number] = future, self._fetch(number, future)
        self.submitted += len(orders)

    def _fetch(self, number: int, future: Any) -> concurrent.futures.Future[Answer | None]:
        """Return the future answer to a flight, None if Dask will have none; once it is done, so is ``number``.

        A result that is lost with its worker is computed again, after a long time without workers: it is awaited in
        Dask's thread. Dask fetches together what is done at the same time.
        """
        answer = self._client.gather(future, errors="skip", asynchronous=True)
        fetched: concurrent.futures.Future[Answer | None] = asyncio.run_coroutine_threadsafe(
            answer, self._client.loop.asyncio_loop
        )
        fetched.add_done_callback(lambda _: self._done.put(number))
        return fetched

    def events(self) -> Iterator[Message]:
        """Yield what happened since the last call; wait a little."""
        if self._threads == 0 and not self._has_noted:
            yield Notice(f"{self._address} has no workers: the flights wait for one", is_common=False)
        self._has_noted = self._threads == 0
        try:
            numbers = [self._done.get(timeout=_TICK_S)]
        except Empty:
            yield Tick()
            return
        with contextlib.suppress(Empty):
            while True:
                numbers.append(self._done.get_nowait())
        for number in numbers:  # all of them before the next ones are submitted at once
            future, fetched = self._flying.pop(number)
            with self._losing_scheduler():
                answer = fetched.result()
            self.over += 1
            yield self._finished(number, future, answer)

    def _finished(self, number: int, future: Any, answer: Answer | None) -> Finished:
        """Return the end of a flight; ``answer`` is None if Dask has none."""
        if answer is None:
            return Finished(number, None, self._why_lost(future))
        if answer.problem:
            raise CliError(f"{answer.problem}: install the same on the client and on all workers", USAGE)
        return Finished(number, answer.result, answer.reason)

    def _why_lost(self, future: Any) -> str:
        if future.cancelled():
            raise SchedulerLostError(f"the scheduler {self._address} was lost", NO_ANSWER)
        with self._losing_scheduler():
            error = future.exception()
        if isinstance(error, distributed.KilledWorker):
            count = error.allowed_failures + 1
            return f"it was lost with its worker {'once' if count == 1 else f'{count} times'}"
        first = str(error).partition("\n")[0]
        problem = f"{type(error).__name__}: {first}"
        remedy = "install the same on the scheduler and on all workers as on the client"
        raise CliError(f"the cluster cannot fly: {problem}: {remedy}", USAGE)

    @contextlib.contextmanager
    def _losing_scheduler(self) -> Iterator[None]:
        try:
            yield
        except _LOST:
            raise SchedulerLostError(f"the scheduler {self._address} was lost", NO_ANSWER) from None

    def cancel(self) -> None:
        """Cancel all flights."""
        if self._flying and self._client.status == "running":
            with contextlib.suppress(*_LOST):
                self._client.cancel([future for future, _ in self._flying.values()])
