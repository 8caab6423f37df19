"""The command line of the ground station, run within the test: a new interpreter for each takes too long."""

from __future__ import annotations

import contextlib
import io
import signal
from typing import NamedTuple

from gcs_cli.__main__ import main


class Ended(NamedTuple):
    """What a process would have left."""

    stdout: str
    stderr: str
    returncode: int


def gcs(*arguments: object) -> Ended:
    """Run ``gcs`` with these arguments."""
    before = signal.getsignal(signal.SIGTERM)
    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main([str(argument) for argument in arguments])
    finally:
        signal.signal(signal.SIGTERM, before)
    return Ended(out.getvalue(), err.getvalue(), code)
