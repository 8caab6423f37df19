"""A Dask cluster on this machine: a scheduler and workers, each a process, at ports that the system selects."""

from __future__ import annotations

import contextlib
from pathlib import Path

from tests.support.process import Process


class Cluster:
    """Leaving the ``with`` block kills all processes."""

    def __init__(self, folder: Path, preload: str = "") -> None:
        """Start the scheduler, which runs the Python text ``preload``; workers have ``folder`` as working directory."""
        self._folder = folder
        self._stack = contextlib.ExitStack()
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", preload=preload)
        line = self.scheduler.wait_for("Scheduler at:")
        self.address = line.split()[-1]
        """Such as ``tcp://127.0.0.1:41234``."""

    def _start(self, command: str, *arguments: str, preload: str) -> Process:
        options = ["--no-dashboard"]
        if preload:
            file = self._folder / f"{command}_preload.py"
            file.write_text(preload, encoding="utf-8")
            options += ["--preload", str(file)]
        with contextlib.chdir(self._folder):
            process = Process("dask", command, *arguments, *options)
        self._stack.callback(process.kill)
        return process

    def add_worker(self, preload: str = "") -> Process:
        """Start a worker with one thread."""
        arguments = (self.address, "--nthreads", "1", "--no-nanny", "--local-directory", str(self._folder))
        return self._start("worker", *arguments, preload=preload)

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
