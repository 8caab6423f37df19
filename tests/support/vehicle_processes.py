"""A simulator and a flight stack as real processes, for tests that talk to them over real sockets."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint, vehicle_connection
from tests.support.free_instance import free_instance
from tests.support.programs import Program

LONG_S = 60.0
"""A hang guard: no process of a test lives longer."""


@dataclass
class VehicleProcesses:
    """Where the vehicle is."""

    instance: int
    simulator: Program | None
    stack: Program
    folder: Path

    @property
    def link(self) -> str:
        """What ``gcs --connect`` needs."""
        return vehicle_connection(self.instance)

    def wait_until_healthy(self) -> None:
        """Wait for the simulator's first state: until then the vehicle refuses to arm."""
        wait_until_healthy(self.link)


def wait_until_healthy(link: str) -> None:
    """Wait until the vehicle at ``link`` has a valid state; ask, because telemetry stands still before it."""
    with Connection(parse_endpoint(link)) as connection:
        connection.wait_for_vehicle(LONG_S)
        while not connection.session.view.healthy:
            connection.complete(
                calls.command(connection.session, *calls.REQUEST_SYS_STATUS, connection.now_s), "SYS_STATUS"
            )


@contextlib.contextmanager
def vehicle(
    folder: Path, *arguments: object, speed: object = 10, with_simulator: bool = True
) -> Iterator[VehicleProcesses]:
    """Run both; ``arguments`` go to the flight stack. Both are ended, whatever happens."""
    instance = free_instance()
    with contextlib.ExitStack() as ends:

        def run(module: str, *words: object) -> Program:
            process = Program(module, ["--instance", str(instance), *map(str, words)], folder)
            ends.callback(process.communicate)
            ends.callback(process.kill)
            return process

        simulator = run("sim_bridge", "--speed", speed) if with_simulator else None
        stack = run("flightstack", *arguments)
        assert stack.stdout.readline(), "flightstack ended at its start"
        yield VehicleProcesses(instance, simulator, stack, folder)
