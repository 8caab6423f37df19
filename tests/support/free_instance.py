"""An instance with free ports, so that tests do not collide with a flight or another test run on this machine."""

from __future__ import annotations

import os
from pathlib import Path

from flightstack.transports.udp import PortBusyError, UdpSocket
from gcs_cli.errors import CliError
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import check_ports

FIRST, COUNT = 60, 40
WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
"""Parallel test processes: each has its own range of instances, so that two do not take the same one."""


def free_instance() -> int:
    """Return an instance with free ports. Parallel test runs start the search at different instances."""
    own = range(FIRST + WORKER, FIRST + COUNT, WORKERS)
    for offset in range(len(own)):
        options = FlyOptions(Path(), instance=own[(os.getpid() + offset) % len(own)])
        try:
            check_ports(options)
            UdpSocket("127.0.0.1", options.gcs_port).close()
        except (CliError, PortBusyError):
            continue
        return options.instance
    raise AssertionError("all ports are in use")
