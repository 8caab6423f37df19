"""Children of ``gcs fly``, ``gcs pil``, ``gcs paper`` and ``gcs test`` in this process, started from the warm server.

A child takes 0.1 s of CPU time to start instead of 1.2 s. It ends with its parent as any child does. So do children of
programs that the server has started. Tests of a parent that is killed start new interpreters.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any
from unittest import mock

import gcs_cli.fly.processes
import gcs_cli.scenarios.pool
from tests.support.programs import Program


def _start(command: Sequence[str], **options: Any) -> Program:
    """Start ``python … -m MODULE ARGUMENTS``."""
    first = command.index("-m") + 1
    return Program(command[first], command[first + 1 :], listens=True, **options)


def _logged(command: Sequence[str], *, stdout: IO[bytes] | int, **_: Any) -> Any:
    """Start a program with a binary pipe, whose output goes to the file ``stdout``, or nowhere."""
    with open(os.devnull, "wb") as nowhere:
        child: Any = _start(command, log=nowhere if isinstance(stdout, int) else stdout)
    child.stdin = child.stdin.detach()
    child.stdout.close()
    return child


def _worker(command: Sequence[str], *, cwd: Path | None, **_: Any) -> Any:
    """Start a program with binary pipes."""
    child: Any = _start(command, directory=cwd, shares_errors=True)
    child.stdin, child.stdout = child.stdin.detach(), child.stdout.detach()
    return child


@contextlib.contextmanager
def warm_children() -> Iterator[None]:
    """Start the children of commands in this process from the warm server."""
    names = {"PIPE": subprocess.PIPE, "STDOUT": subprocess.STDOUT, "DEVNULL": subprocess.DEVNULL}
    with (
        mock.patch.object(gcs_cli.fly.processes, "subprocess", SimpleNamespace(Popen=_logged, **names)),
        mock.patch.object(gcs_cli.scenarios.pool, "subprocess", SimpleNamespace(Popen=_worker, **names)),
    ):
        yield
