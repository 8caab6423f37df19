"""Plans and parameters over loopback, at the vehicle's real-time speed in lockstep, beside the floor of bare datagrams.

Alone: ``python -m benchmarks --only transfers``. The floor: as many round trips of datagrams of the same size
between two processes that only echo.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from benchmarks.measure import Figure, figure
from benchmarks.ports import free_instance
from benchmarks.real_time import child
from flightstack.core.port_numbers import simulator_port
from flightstack.plan import Command, Frame, MissionItem
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint, vehicle_connection
from gcs_cli.plans.compare import differences
from gcs_cli.transfers import param_calls

ITEMS = 1000
_ITEM_BYTES, _REQUEST_BYTES = 50, 17  # frames of MISSION_ITEM_INT and MISSION_REQUEST_INT
_START_S = 60.0
_ECHO = (
    "import socket, sys\n"
    "s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(('127.0.0.1', 0))\n"
    "print(s.getsockname()[1], flush=True)\n"
    "answer = bytes(int(sys.argv[1]))\n"
    "while True:\n"
    "    data, peer = s.recvfrom(2048)\n"
    "    s.sendto(answer, peer)\n"
)


class Transfers(NamedTuple):
    """Times of all rounds [s]."""

    upload_s: Figure
    download_s: Figure
    compare_s: Figure
    parameters_s: Figure
    parameters: int
    floor_s: Figure
    """``ITEMS`` round trips of bare datagrams."""


def transfers(rounds: int) -> Transfers:
    """Measure each in every round."""
    instance = free_instance()
    items = tuple(
        MissionItem(
            Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT, x=473977420 + 10 * seq, y=85455940, z=5.0
        )
        for seq in range(ITEMS)
    )
    taken: list[tuple[float, float, float, float, float]] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        child("sim_bridge", "--speed=1", f"--instance={instance}"),
        child(
            "flightstack", f"--instance={instance}", f"--sim-port={simulator_port(instance)}", "--log=none",
            f"--params={Path(folder) / 'params'}",
        ),
        Connection(parse_endpoint(vehicle_connection(instance))) as connection,
    ):  # fmt: skip
        connection.wait_for_vehicle(_START_S)
        session = connection.session
        connection.wait_for(lambda: bool(session.view.healthy), _START_S)
        count = len(param_calls.fetch_all(connection))  # warms both processes
        for _ in range(rounds):
            times = [time.perf_counter()]
            connection.complete(calls.upload(session, items), "upload")
            times.append(time.perf_counter())
            stored = connection.complete(calls.download(session), "download").items
            times.append(time.perf_counter())
            assert not list(differences(items, stored))
            times.append(time.perf_counter())
            param_calls.fetch_all(connection)
            times.append(time.perf_counter())
            spans = [after - before for before, after in pairwise(times)]
            taken.append((spans[0], spans[1], spans[2], spans[3], _echoes_s(ITEMS)))
    up, down, compare, parameters, floor = (figure(values) for values in zip(*taken, strict=True))
    return Transfers(up, down, compare, parameters, count, floor)


def _echoes_s(count: int) -> float:
    command = [sys.executable, "-c", _ECHO, str(_ITEM_BYTES)]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe,
    ):
        assert process.stdout is not None
        place = ("127.0.0.1", int(process.stdout.readline()))
        began_s = time.perf_counter()
        for _ in range(count):
            probe.sendto(bytes(_REQUEST_BYTES), place)
            probe.recv(2048)
        took_s = time.perf_counter() - began_s
        process.kill()
    return took_s
