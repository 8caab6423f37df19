"""Fly cases in worker processes. The results do not depend on the number of workers."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
from collections.abc import Generator
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from flightstack.process.supervised import own_program
from gcs_cli.scenarios.pipes import receive, send

if TYPE_CHECKING:  # they import the simulator, while the first worker starts
    from gcs_cli.scenarios.result import Result, Wanted
    from gcs_cli.scenarios.selection import Case

_TICK_S = 0.1
_ENDED = object()


class Started(NamedTuple):
    """A worker began to fly a case."""

    case: int


class Finished(NamedTuple):
    """A case was flown; or the process ended that flew it, and how."""

    case: int
    result: Result | None
    reason: str = ""

    @property
    def failed(self) -> bool:
        """True unless the flight passed."""
        return self.result is None or not self.result.passed


class Notice(NamedTuple):
    """A line of a worker, such as the compilation of a kernel."""

    line: str
    is_common: bool = True
    """Each worker has about the same, so that the first one is enough."""


class Tick(NamedTuple):
    """No event for a while: time to redraw."""


Message = Started | Finished | Notice | Tick


class Cases(Protocol):
    """A sequence of cases, which may make each when it is needed."""

    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> Case: ...


def default_jobs() -> int:
    """Return the default number of workers: one for each processor that this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return usable or 1


class _Worker:
    """One process; a thread passes its answers to the pool."""

    def __init__(self, answers: SimpleQueue[tuple[_Worker, Any]], folder: Path | None) -> None:
        self._process = subprocess.Popen(
            own_program("gcs_cli.scenarios.worker"),
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for the parent
        )
        self._answers = answers
        self.index: int | None = None
        """The case that it flies."""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def fly(self, index: int, case: Case, wanted: Wanted) -> None:
        """Begin to fly a case."""
        assert self._process.stdin is not None
        self.index = index
        with contextlib.suppress(OSError):  # it has ended: its thread reports that
            send(self._process.stdin, (case, wanted))

    def _read(self) -> None:
        assert self._process.stdout is not None
        try:
            while True:
                self._answers.put((self, receive(self._process.stdout)))
        except (EOFError, OSError):
            self._answers.put((self, _ENDED))

    def end(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                assert stream is not None
                stream.close()

    def ended(self) -> str:
        """Return how the process ended, whose output has ended."""
        code = self._process.wait()
        self.end()
        return f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"


class Pool:
    """Worker processes, which start when they are needed. Leaving the ``with`` block ends them."""

    def __init__(self, jobs: int, folder: Path | None = None) -> None:
        """Start the first worker, which imports while the caller reads the files.

        Relative paths of cases are relative to ``folder``, by default to the working directory.
        """
        self.jobs = jobs
        """Flights at once, at most."""
        self._folder = folder
        self._answers: SimpleQueue[tuple[_Worker, Any]] = SimpleQueue()
        self._idle = [self._new()]
        self._busy: list[_Worker] = []

    def fly(
        self, cases: Cases, wanted: Wanted, *, stops_at_failure: bool = False
    ) -> Generator[Message, None, None]:
        """Fly the cases and yield their events; end all flights if the iterator is closed.

        With ``stops_at_failure`` no case after the first one that fails is flown, and those that already are end.
        """
        end, next_index = len(cases), 0
        finished: set[int] = set()
        try:
            while len(finished) < end:
                while next_index < end and len(self._busy) < self.jobs:
                    self._take().fly(next_index, cases[next_index], wanted)
                    yield Started(next_index)
                    next_index += 1
                try:
                    worker, message = self._answers.get(timeout=_TICK_S)
                except Empty:
                    yield Tick()
                    continue
                if isinstance(message, str):
                    yield Notice(message)
                    continue
                if worker not in self._busy:  # it ended
                    self._idle = [each for each in self._idle if each is not worker]
                    continue
                flown = self._finish(worker, message)
                finished.add(flown.case)
                if stops_at_failure and flown.failed:
                    end = min(end, flown.case + 1)
                    self._cancel_from(end)
                    finished = {number for number in finished if number < end}
                yield flown
        finally:
            self._cancel_from(0)

    def renew(self) -> None:
        """Replace the idle workers by one that has imported no plug-in controller: its source may change."""
        for worker in self._idle:
            worker.end()
        self._idle = [self._new()]

    def _new(self) -> _Worker:
        return _Worker(self._answers, self._folder)

    def _take(self) -> _Worker:
        worker = self._idle.pop() if self._idle else self._new()
        self._busy.append(worker)
        return worker

    def _finish(self, worker: _Worker, message: Any) -> Finished:
        self._busy.remove(worker)
        assert worker.index is not None
        if message is _ENDED:
            return Finished(worker.index, None, f"the process that flew it {worker.ended()}")
        self._idle.append(worker)
        return Finished(worker.index, message)

    def _cancel_from(self, index: int) -> None:
        """End the flights of the cases from ``index`` on."""
        for worker in [each for each in self._busy if each.index is not None and each.index >= index]:
            self._busy.remove(worker)
            worker.end()

    def close(self) -> None:
        """End all flights and workers."""
        for worker in (*self._busy, *self._idle):
            worker.end()

    def __enter__(self) -> Pool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
