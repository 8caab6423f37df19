"""Simulator and flight stack as processes, for tests over real sockets."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from flightstack.mavlink.dialect import mavlink
from flightstack.params.config import TRUTH
from flightstack.testing.instances import free_instance
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint, vehicle_connection
from tests.support.programs import Program

LONG_S = 60.0
"""Hang guard [s]."""

INNER_HZ = 250
"""Rate of the inner loop. The default rate costs twice the CPU time, which tests of links and commands do not need."""

IN_AIR = mavlink.MAV_LANDED_STATE_IN_AIR


@dataclass
class VehicleProcesses:
    """Processes and instance number of a vehicle."""

    instance: int
    simulator: Program | None
    stack: Program
    folder: Path

    @property
    def link(self) -> str:
        """Argument of ``gcs --connect``."""
        return vehicle_connection(self.instance)

    def wait_until_healthy(self) -> None:
        """Wait for the first state of the simulator, before which the vehicle refuses to arm."""
        wait_until_healthy(self.link)

    def wait_until_in_air(self) -> None:
        """Wait until the vehicle reports that it flies: it accepts a takeoff earlier."""
        with Connection(parse_endpoint(self.link)) as connection:
            connection.wait_for_vehicle(LONG_S)
            assert connection.wait_for(lambda: connection.session.view.landed_state == IN_AIR, LONG_S)


def wait_until_healthy(link: str) -> None:
    """Wait until the vehicle at ``link`` has a valid state. It sends SYS_STATUS only on request before."""
    with Connection(parse_endpoint(link)) as connection:
        connection.wait_for_vehicle(LONG_S)
        while not connection.session.view.healthy:
            connection.complete(
                calls.command(connection.session, *calls.REQUEST_SYS_STATUS, connection.now_s), "SYS_STATUS"
            )


@contextlib.contextmanager
def vehicle(
    folder: Path,
    *arguments: object,
    speed: object = 1,
    with_simulator: bool = True,
    instance: int | None = None,
) -> Iterator[VehicleProcesses]:
    """Run both and end them at exit; ``arguments`` are those of the flight stack. Without ``instance``, a free one.

    The vehicle flies on the true state: links and commands are tested, and sensors would cost a third of a core. One
    that waits takes half of a core at ten times real time, so that a test gives a ``speed`` only if it flies.
    """
    instance = free_instance() if instance is None else instance
    with contextlib.ExitStack() as ends:

        def run(module: str, *words: object) -> Program:
            process = Program(module, ["--instance", str(instance), *map(str, words)], folder)
            ends.callback(process.communicate)
            ends.callback(process.kill)
            return process

        simulator = run("sim_bridge", "--speed", speed) if with_simulator else None
        stack = run("flightstack", "--state", TRUTH, "--inner-hz", INNER_HZ, *arguments)
        assert stack.stdout.readline(), "flightstack ended at its start"
        yield VehicleProcesses(instance, simulator, stack, folder)
