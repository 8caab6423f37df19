"""The programs' command lines, run in the test process: a new interpreter takes a second to start."""

from __future__ import annotations

import contextlib
import io
import signal
import sys
from collections.abc import Callable
from typing import NamedTuple
from unittest import mock

import flightstack.__main__
import gcs_cli.__main__
import sim_bridge.__main__


class Ended(NamedTuple):
    """Output and exit code of a run."""

    stdout: str
    stderr: str
    returncode: int


def gcs(*arguments: object) -> Ended:
    """Run ``gcs`` with these arguments."""
    return _run("gcs", gcs_cli.__main__.main, arguments)


def flightstack_command(*arguments: object) -> Ended:
    """Run ``flightstack`` with arguments by which it ends: ``--check``, or an error."""
    return _run("flightstack", flightstack.__main__.main, arguments)


def sim_bridge_command(*arguments: object) -> Ended:
    """Run ``sim-bridge`` with arguments by which it ends."""
    return _run("sim-bridge", sim_bridge.__main__.main, arguments)


def _run(name: str, main: Callable[[], int | None], arguments: tuple[object, ...]) -> Ended:
    """Call ``main`` as the script ``name`` does; restore the signal handlers."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    out, err = io.StringIO(), io.StringIO()
    try:
        with (
            mock.patch.object(sys, "argv", [name, *map(str, arguments)]),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            code = main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return Ended(out.getvalue(), err.getvalue(), code or 0)
