"""Start the programs by a fork of a process that has imported them: a start takes 50 ms instead of 1.2 s.

``python -m tests.support.warm_server`` has a socket as its standard input. A request is a JSON object with the keys
``module``, ``arguments``, ``directory``, ``environment``, ``imports`` (modules that the server imports before its
first start) and ``parent`` (the client's process id), and four file descriptors: the program's standard input, output
and error, and a pipe for its exit code. The answer is the process id. A request with the key ``children_of``, a
process id, is answered by the programs that this process has started: their process ids by module.

Each program has a socket to the server too, by which it starts its children.
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
from tests.support.process import program_of
from tests.support.programs import ASKS, GIVEN, LARGEST_ANSWER, NEW_INTERPRETERS, PROGRAMS
from tests.support.warm_children import warm_children

LARGEST_REQUEST = 1 << 18
LATER = (
    "flightstack.process.command",
    "sim_bridge.command",
    "flightstack.process.program",
    "sim_bridge.program",
    "sim_bridge.server.session",
    "gcs_cli.link.connection",
    "gcs_cli.fly.fly_run",
    "gcs_cli.scenarios.worker",
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
    """Run the program in this process, as ``python -u -m MODULE ARGUMENTS`` does. Ends with SystemExit.

    ``streams`` are standard input, output and error, and the socket to the server.
    """
    for number, stream in enumerate(streams):
        os.dup2(stream, number, inheritable=number < GIVEN)
    os.closerange(GIVEN + 1, max(*streams, 1024))
    ASKS.append(socket.socket(fileno=GIVEN))
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
    with contextlib.nullcontext() if NEW_INTERPRETERS in os.environ else warm_children():
        runpy.run_module(request["module"], run_name="__main__", alter_sys=True)
    sys.exit(0)


class Server:
    """Starts programs on request, and reports their exit codes."""

    def __init__(self, requests: socket.socket) -> None:
        self._requests = requests
        self._selector = selectors.DefaultSelector()
        self._selector.register(requests, selectors.EVENT_READ)
        self._programs: dict[int, tuple[int, str]] = {}
        """Parent and module of each running program."""

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
                continue
            asking: Any = key.fileobj
            if not self._answer(asking):
                if asking is self._requests:
                    return False
                self._selector.unregister(asking)  # a program that has ended
                asking.close()
        return True

    def _answer(self, asking: socket.socket) -> bool:
        try:
            message, descriptors, _, _ = socket.recv_fds(asking, LARGEST_REQUEST, 4)
        except ConnectionResetError:  # it has been killed before it read its answer
            return False
        if not message:
            return False
        request = json.loads(message)
        if "children_of" in request:
            found = {
                module: pid
                for pid, (parent, module) in self._programs.items()
                if parent == request["children_of"]
            }
            answer = json.dumps(found)
            assert len(answer) < LARGEST_ANSWER
        else:
            answer = str(self._start(request, descriptors))
        with contextlib.suppress(ConnectionError):  # the program has been killed
            asking.send(answer.encode())
        return True

    def _start(self, request: dict[str, Any], descriptors: list[int]) -> int:
        *streams, report = descriptors
        for name in request["imports"]:
            importlib.import_module(name)
        ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        pid = os.fork()
        if pid == 0:
            become(request, [*streams, its.fileno()])
        its.close()
        for stream in streams:
            os.close(stream)
        module, arguments = request["module"], request["arguments"]
        self._programs[pid] = request["parent"], program_of(module, arguments)
        self._selector.register(ours, selectors.EVENT_READ)
        self._selector.register(os.pidfd_open(pid), selectors.EVENT_READ, (pid, report))
        return pid

    def _report_end(self, handle: int, pid: int, report: int) -> None:
        self._selector.unregister(handle)
        os.close(handle)
        _, status = os.waitpid(pid, 0)
        del self._programs[pid]
        with contextlib.suppress(BrokenPipeError):  # the test has closed its end
            os.write(report, str(os.waitstatus_to_exitcode(status)).encode())
        os.close(report)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    load()
    Server(socket.socket(fileno=os.dup(0))).serve()
