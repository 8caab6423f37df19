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


def free_instance(taken: Collection[int] = ()) -> int:
    """Return an instance with free ports that is not in ``taken``; raise ServerError if there is none.

    Parallel workers of pytest-xdist try different instances, and processes begin at different ones.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    own = list(range(FIRST + worker % COUNT, FIRST + COUNT, workers))
    begin = os.getpid() % len(own)
    others = [instance for instance in range(FIRST, FIRST + COUNT) if instance not in own]
    for instance in (*own[begin:], *own[:begin], *others):
        if instance not in taken and _is_free(instance):
            return instance
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
