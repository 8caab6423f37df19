"""The programs as processes, with the part of ``subprocess.Popen``'s interface that tests use."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import IO, Any

PROGRAMS = ("flightstack", "sim_bridge", "gcs_cli")
ROOT = Path(__file__).resolve().parents[2]
LARGEST_ANSWER = 4096
GIVEN = 3
"""Descriptor of a program's own socket to the server that has started it."""
ASKS: list[socket.socket] = []
"""That socket in a program of the server; nothing in a test process."""
NEW_INTERPRETERS = "FLIGHTSTACK_TEST_NEW_INTERPRETERS"
"""Environment variable of programs whose own children are new interpreters, as those of users are."""
_ONE_AT_A_TIME = threading.Lock()


@cache
def _server() -> socket.socket:
    """Return the server of this program, or start that of this test process; it ends with this process."""
    if ASKS:
        return ASKS[0]
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [sys.executable, "-m", "tests.support.warm_server"]
    server = subprocess.Popen(command, stdin=its, cwd=ROOT, start_new_session=True)
    its.close()

    def end() -> None:
        ours.close()
        server.wait()

    atexit.register(end)
    return ours


def started_by(pid: int) -> dict[str, int]:
    """Return module and process id of the programs that a program of this process's server has started."""
    has_server = _server.cache_info().currsize > 0
    found: dict[str, int] = json.loads(_answer({"children_of": pid})) if has_server else {}
    return found


def _answer(request: dict[str, Any], descriptors: Sequence[int] = ()) -> bytes:
    """Return the answer of the server."""
    with _ONE_AT_A_TIME:
        server = _server()
        socket.send_fds(server, [json.dumps(request).encode()], list(descriptors))
        return server.recv(LARGEST_ANSWER)


class Program:
    """A running program; ``stdin`` (with ``listens``), ``stdout`` and ``stderr`` are text pipes."""

    def __init__(
        self,
        module: str,
        arguments: Sequence[str],
        directory: Path | None = None,
        *,
        listens: bool = False,
        joins_output: bool = False,
        shares_errors: bool = False,
        log: IO[bytes] | None = None,
        imports: Sequence[str] = (),
    ) -> None:
        """Start ``python -m MODULE ARGUMENTS``; the server imports the modules ``imports`` before its first start.

        With ``joins_output``, standard error goes to ``stdout``, and with ``shares_errors`` to that of this process;
        with a ``log``, both outputs go to that file instead.
        """
        self.args = (module, *arguments)
        self.returncode: int | None = None
        self.stdin: IO[str] | None = None
        input_end, own_end = os.pipe() if listens else (os.open(os.devnull, os.O_RDONLY), None)
        if own_end is not None:
            self.stdin = open(own_end, "w")  # noqa: SIM115
        output, output_end = (
            os.pipe() if log is None else (os.open(os.devnull, os.O_RDONLY), os.dup(log.fileno()))
        )
        if shares_errors:
            errors, errors_end = None, os.dup(2)
        else:
            errors, errors_end = (None, output_end) if joins_output or log is not None else os.pipe()
        self._report, report_end = os.pipe()
        request = {
            "module": module,
            "arguments": list(arguments),
            "directory": str(directory or Path.cwd()),
            "environment": dict(os.environ),
            "imports": list(imports),
            "parent": os.getpid(),
        }
        given = [input_end, output_end, errors_end, report_end]
        self.pid = int(_answer(request, given))
        for descriptor in set(given):
            os.close(descriptor)
        self.stdout: IO[str] = open(output)  # noqa: SIM115
        self.stderr: IO[str] | None = None if errors is None else open(errors)  # noqa: SIM115

    def poll(self) -> int | None:
        """Return the exit code, negative for a signal, or None while it runs."""
        return self._end(0.0)

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code; raise TimeoutExpired."""
        code = self._end(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return code

    def _end(self, timeout_s: float | None) -> int | None:
        if self.returncode is None and select.select([self._report], [], [], timeout_s)[0]:
            self.returncode = int(os.read(self._report, 32))
            os.close(self._report)
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):  # it ended, which is reported a moment later
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Read the remaining output, wait for the end and close the pipes; raise TimeoutExpired."""
        texts = ["", ""]

        def read(index: int, stream: IO[str] | None) -> None:
            if stream is not None and not stream.closed:
                with stream:
                    texts[index] = stream.read()

        readers = [
            threading.Thread(target=read, args=each, daemon=True)
            for each in enumerate((self.stdout, self.stderr))
        ]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join(timeout)
        if self.stdin is not None:
            self.stdin.close()
        return texts[0], texts[1]
