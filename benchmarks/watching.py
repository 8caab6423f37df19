"""Processor time of ``gcs watch`` while a vehicle flies: each screen at two sizes, in a terminal that reads at once.

Alone: ``python -m benchmarks --only watch``. Other programs evict its caches: read the least times.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.measure import Figure, figure
from benchmarks.ports import free_instance
from benchmarks.real_time import child
from benchmarks.three_processes import ROOT
from flightstack.core.port_numbers import simulator_port
from flightstack.plan import Command, Frame, MissionItem
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint, vehicle_connection
from gcs_cli.tui.screens import SCREENS

SIZES = ((80, 24), (200, 50))
FIELDS = ("ATTITUDE.roll", "ATTITUDE.pitch", "LOCAL_POSITION_NED.vx", "LOCAL_POSITION_NED.z")
"""Fields of the plot."""
_START_S, _SETTLE_S, _COUNT_S = 60.0, 3.0, 5.0


class Watched(NamedTuple):
    """Shares of a core by screen and size, and the rate of the messages that the vehicle sent."""

    shares_percent: dict[str, dict[tuple[int, int], Figure]]
    messages_hz: float


class _Terminal:
    """``gcs watch`` on a pseudo-terminal whose output is read and dropped."""

    def __init__(self, connection: str, columns: int, rows: int) -> None:
        self._controller, terminal = pty.openpty()
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        environment = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        command = [sys.executable, "-m", "gcs_cli", "watch", "--connect", connection]
        self.process = subprocess.Popen(
            command, stdin=terminal, stdout=terminal, stderr=terminal, cwd=ROOT, env=environment
        )
        os.close(terminal)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # the end of the process
            while os.read(self._controller, 65536):
                pass

    def type(self, keys: str) -> None:
        os.write(self._controller, keys.encode())

    def cpu_s(self) -> float:
        """Return the processor time of all threads so far."""
        tasks = Path(f"/proc/{self.process.pid}/task").glob("*/schedstat")
        return 1e-9 * sum(int(task.read_text("ascii").split()[0]) for task in tasks)

    def close(self) -> None:
        self.process.terminate()
        self.process.wait()
        self._reader.join()
        os.close(self._controller)


@contextlib.contextmanager
def _flight() -> Iterator[tuple[str, Connection]]:
    """Fly a vehicle around a square in real time; yield its address and a connection."""
    instance = free_instance()
    with (
        tempfile.TemporaryDirectory() as folder,
        child("sim_bridge", "--speed=1", f"--instance={instance}"),
        child(
            "flightstack", f"--instance={instance}", f"--sim-port={simulator_port(instance)}", "--log=none",
            f"--params={Path(folder) / 'params'}",
        ),
    ):  # fmt: skip
        address = vehicle_connection(instance)
        with Connection(parse_endpoint(address)) as connection:
            connection.wait_for_vehicle(_START_S)
            session = connection.session
            connection.wait_for(lambda: bool(session.view.healthy), _START_S)
            connection.complete(calls.upload(session, _square()), "upload")
            connection.command(calls.START_MISSION, "mission start")
            connection.wait_for(lambda: session.view.mission.current == 2, _START_S)
            yield address, connection


def _square() -> tuple[MissionItem, ...]:
    """Return a takeoff and a square of 60 m that is flown without end."""
    places = [(0, 0), (600, 0), (600, 800), (0, 800)]
    corners = [
        MissionItem(
            Command.NAV_WAYPOINT,
            Frame.GLOBAL_RELATIVE_ALT,
            x=473977420 + 9 * north,
            y=85455940 + 10 * east,
            z=8.0,
        )
        for north, east in places
    ]
    takeoff = MissionItem(Command.NAV_TAKEOFF, Frame.GLOBAL_RELATIVE_ALT, x=473977420, y=85455940, z=5.0)
    return (takeoff, *corners, MissionItem(Command.DO_JUMP, Frame.MISSION, param1=1.0, param2=-1.0))


def watching(rounds: int, seconds: float) -> Watched:
    """Watch each screen for ``seconds`` in every round, at each size."""
    taken: dict[str, dict[tuple[int, int], list[float]]] = {}
    with _flight() as (address, connection):
        messages_hz = _messages_hz(connection)
        connection.close()
        for size in SIZES:
            terminal = _Terminal(address, *size)
            time.sleep(_SETTLE_S)
            _choose_fields(terminal)
            for _ in range(rounds):
                for entry in SCREENS:
                    terminal.type(entry.key)
                    time.sleep(_SETTLE_S)
                    began_s, used_s = time.perf_counter(), terminal.cpu_s()
                    time.sleep(seconds)
                    share = (terminal.cpu_s() - used_s) / (time.perf_counter() - began_s)
                    taken.setdefault(entry.title, {}).setdefault(size, []).append(100 * share)
            terminal.close()
    shares = {
        title: {size: figure(values) for size, values in of_sizes.items()}
        for title, of_sizes in taken.items()
    }
    return Watched(shares, messages_hz)


def _messages_hz(connection: Connection) -> float:
    count = 0

    def observe(_message: object, _now_s: float) -> None:
        nonlocal count
        count += 1

    connection.fleet.observe = observe
    connection.wait_for(lambda: False, _COUNT_S)
    connection.fleet.observe = None
    return count / _COUNT_S


def _choose_fields(terminal: _Terminal) -> None:
    plot = next(entry for entry in SCREENS if entry.mode == "plot")
    terminal.type(plot.key + "\r")
    for field in FIELDS:
        terminal.type(field + "\r" + "\x7f" * len(field))
        time.sleep(_SETTLE_S)  # each key searches the fields
    terminal.type("\x1b")
    time.sleep(_SETTLE_S)
