"""The search for an instance whose ports are free."""

from __future__ import annotations

import os
import socket
from collections.abc import Collection
from pathlib import Path

from flightstack.core.port_numbers import api_client_port, ground_station_port, tcp_port
from flightstack.transports.udp import PortBusyError, UdpSocket
from gcs_cli.errors import CliError
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import check_ports
from gcs_cli.link.endpoint import LOOPBACK

FIRST, COUNT = 60, 40
"""Instances that are tried; users begin at 0."""


class ServerError(RuntimeError):
    """A vehicle could not be started, or its processes ended."""


class ServerRefusalError(ServerError):
    """A vehicle cannot have a condition that was asked for."""


def free_instance(taken: Collection[int] = (), count: int = 1) -> int:
    """Return the first of ``count`` successive instances with free ports, none in ``taken``.

    Each parallel worker of pytest-xdist has instances of its own, and tries those of others last; processes begin at
    different ones. Raise ServerError if there are none.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    size = max(count, COUNT // workers)
    start = FIRST + worker * size % COUNT
    own = list(range(start, min(start + size, FIRST + COUNT) - count + 1))
    begin = os.getpid() % len(own) if own else 0
    others = [first for first in range(FIRST, FIRST + COUNT - count + 1) if first not in own]
    for first in (*own[begin:], *own[:begin], *others):
        if all(instance not in taken and _is_free(instance) for instance in range(first, first + count)):
            return first
    raise ServerError(f"all ports of instances {FIRST} to {FIRST + COUNT - 1} are in use")


def _is_free(instance: int) -> bool:
    """Return True if all ports of vehicle and clients can be bound."""
    try:
        check_ports(FlyOptions(Path(), instance=instance))
        for port in (ground_station_port(instance), api_client_port(instance)):
            UdpSocket(LOOPBACK, port).close()
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((LOOPBACK, tcp_port(instance)))
    except (CliError, PortBusyError, OSError):
        return False
    return True
