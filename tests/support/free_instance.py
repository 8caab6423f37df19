"""An instance whose ports nobody uses, so that a flight or another test run on this machine does not disturb."""

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
"""Test processes side by side: each has instances of its own, so that none takes what another has just found free."""


def free_instance() -> int:
    """Return an instance with free ports; test runs side by side begin to search at different ones."""
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
