"""The port of the simulator, held while its client is connected."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest

from flightstack.testing.instances import free_instance
from gcs_cli.errors import CliError
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import check_ports
from sim_bridge.server.connection import hold, listen

PLAN = Path("hop.plan")


def test_the_port_of_a_connected_simulator_is_busy() -> None:
    instance = free_instance()
    with hold(listener := listen("0.0.0.0", 4560 + instance)):
        listener.close()  # as after a client has connected
        with pytest.raises(CliError, match=f"port {4560 + instance} .* is in use: .*--instance"):
            check_ports(FlyOptions(PLAN, instance=instance))
    check_ports(FlyOptions(PLAN, instance=instance))


def test_nothing_is_held_without_the_names_of_linux(monkeypatch: pytest.MonkeyPatch) -> None:
    with listen("127.0.0.1", 0) as listener:
        monkeypatch.setattr(sys, "platform", "darwin")
        monkeypatch.setattr(socket, "socket", lambda *_: pytest.fail("a socket is created"))
        with hold(listener):
            pass
