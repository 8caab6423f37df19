"""A flight stack that imports its modules while the command checks its options: a third of its start.

A module of its own, with few imports: a command starts the process before it imports what it needs itself.
"""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Sequence
from pathlib import Path

from flightstack.process.supervised import order, prepared

_STACK = "flightstack"


class PreparedStack:
    """A process that waits for the command line of a flight stack. One that got none ends with the ``with`` block."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = subprocess.Popen(
            prepared("flightstack.process.program"),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def take(self, module: str, arguments: Sequence[str], output: Path) -> subprocess.Popen[bytes] | None:
        """Run ``module`` with its output in the file ``output``; return None if this process cannot.

        That is the case for another module than the flight stack, after the first call, and if the process has ended.
        One whose imports fail says why in ``output``.
        """
        process = self._process
        if module != _STACK or process is None or process.poll() is not None:
            return None
        assert process.stdin is not None
        try:
            process.stdin.write(order(str(output.absolute()), module, *arguments))
            process.stdin.flush()
        except OSError:
            return None
        self._process = None
        return process

    def __enter__(self) -> PreparedStack:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            assert self._process.stdin is not None
            with contextlib.suppress(OSError):
                self._process.stdin.close()
