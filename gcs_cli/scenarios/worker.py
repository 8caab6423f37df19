"""A process that flies cases: ``python -m gcs_cli.scenarios.worker``, started by ``gcs_cli.scenarios.pool``.

It reads pickled cases from stdin and writes pickled answers to stdout. It ends as soon as stdin closes, at the latest
with its parent, however that ends.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from queue import SimpleQueue
from typing import IO, Any

from flightstack.process.compile_notice import CompileNotice
from gcs_cli.scenarios.flying import fly_case
from gcs_cli.scenarios.pipes import receive, send


def main() -> None:
    """Fly the cases of stdin until it closes."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    tasks: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, tasks), daemon=True).start()
    CompileNotice(lambda line: send(answers, line), ()).start()
    with contextlib.suppress(OSError):  # the parent has ended
        while True:
            send(answers, fly_case(*tasks.get()))


def _read(stream: IO[bytes], tasks: SimpleQueue[Any]) -> None:
    """Pass the tasks on; end the process, also in flight, once there are no more."""
    try:
        while True:
            tasks.put(receive(stream))
    except (EOFError, OSError):
        os._exit(0)


if __name__ == "__main__":
    main()
