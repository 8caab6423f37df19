"""Start the programs by a fork of a process that has imported them: a start takes 50 ms instead of 1.2 s.

``python -m tests.support.warm_server`` has a socket as its standard input. A request is a JSON object with the keys
``module``, ``arguments``, ``directory``, ``environment`` and ``imports`` (modules that the server imports before its
first start), and four file descriptors: the program's standard input, output and error, and a pipe for its exit code.
The answer is the process id.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import runpy
import selectors
import signal
import socket
import sys
from typing import Any

from flightstack.params.config import StackConfig
from flightstack.params.vehicle import load_vehicle
from flightstack.process.assembly import build
from sim_bridge.simulator import Simulator
from tests.support.programs import PROGRAMS

LARGEST_REQUEST = 1 << 18
LATER = (
    "flightstack.process.app",
    "sim_bridge.server.server",
    "sim_bridge.server.session",
    "gcs_cli.link.connection",
)
"""Modules that the programs import when they run."""


def load() -> None:
    """Import the programs and load their kernels."""
    for name in LATER:
        importlib.import_module(name)
    for program in PROGRAMS:
        importlib.import_module(f"{program}.__main__")
        del sys.modules[f"{program}.__main__"]  # executed again in each program
    build(StackConfig(vehicle="paper_quad", gains="tuned"), lambda: None)
    Simulator(load_vehicle("paper_quad"))


def become(request: dict[str, Any], streams: list[int]) -> None:
    """Run the program in this process, as ``python -u -m MODULE ARGUMENTS`` does. Ends with SystemExit."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    os.closerange(3, max(*streams, 1024))
    os.chdir(request["directory"])
    os.environ.clear()
    os.environ.update(request["environment"])
    added = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    sys.path[1:1] = [path for path in added if path not in sys.path]
    sys.stdin = open(0, closefd=False)  # noqa: SIM115  # open until the program ends
    sys.stdout = open(1, "w", buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.argv = [request["module"], *request["arguments"]]
    runpy.run_module(request["module"], run_name="__main__", alter_sys=True)
    sys.exit(0)


class Server:
    """Starts programs on request, and reports their exit codes."""

    def __init__(self, requests: socket.socket) -> None:
        self._requests = requests
        self._selector = selectors.DefaultSelector()
        self._selector.register(requests, selectors.EVENT_READ)

    def serve(self) -> None:
        """Serve until the client closes the socket, and end the programs that a killed client left behind."""
        while self._serve_once():
            pass
        for key in list(self._selector.get_map().values()):
            if key.data is not None:
                signal.pidfd_send_signal(key.fd, signal.SIGKILL)

    def _serve_once(self) -> bool:
        for key, _ in self._selector.select():
            if key.data is not None:
                self._report_end(key.fd, *key.data)
            elif not self._start():
                return False
        return True

    def _start(self) -> bool:
        message, descriptors, _, _ = socket.recv_fds(self._requests, LARGEST_REQUEST, 4)
        if not message:
            return False
        *streams, report = descriptors
        request = json.loads(message)
        for name in request["imports"]:
            importlib.import_module(name)
        pid = os.fork()
        if pid == 0:
            become(request, streams)
        self._requests.send(str(pid).encode())
        for stream in streams:
            os.close(stream)
        self._selector.register(os.pidfd_open(pid), selectors.EVENT_READ, (pid, report))
        return True

    def _report_end(self, handle: int, pid: int, report: int) -> None:
        self._selector.unregister(handle)
        os.close(handle)
        _, status = os.waitpid(pid, 0)
        with contextlib.suppress(BrokenPipeError):  # the test has closed its end
            os.write(report, str(os.waitstatus_to_exitcode(status)).encode())
        os.close(report)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    load()
    Server(socket.socket(fileno=os.dup(0))).serve()
