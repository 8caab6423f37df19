"""Simulator and flight stack as real processes, for clients that we did not write."""

from __future__ import annotations

from pathlib import Path

from flightstack.core.port_numbers import api_client_port, ground_station_port, tcp_port
from flightstack.params.config import TRUTH
from flightstack.testing.instances import free_instance
from flightstack.testing.server import client_timeouts
from tests.support.process import Process
from tests.support.vehicle_processes import INNER_HZ

HOST = "127.0.0.1"


class RealVehicle:
    """``sim-bridge`` and ``flightstack`` at an instance of their own, at a speed against real time."""

    def __init__(self, directory: Path, speed: float, *options: str) -> None:
        """Start both; ``directory`` takes logs, parameters and plans, ``options`` go to ``flightstack``.

        Without an option ``--state`` the vehicle flies on the true state: clients and their messages are tested.
        """
        self.speed = speed
        self.instance = free_instance()
        self.api_port = api_client_port(self.instance)
        self.gcs_port = ground_station_port(self.instance)
        self.tcp_port = tcp_port(self.instance)
        self.log = directory / "flight.ulg"
        number = ("--instance", str(self.instance))
        self.simulator = Process("sim_bridge", *number, "--speed", str(speed))
        losses = [f"--param={name}={value}" for name, value in client_timeouts(speed).items()]
        self.stack = Process(
            "flightstack",
            *number,
            *("--inner-hz", str(INNER_HZ)),
            *("--log", str(self.log)),
            *("--state-dir", str(directory)),
            *("--state", TRUTH),
            *losses,
            *options,
        )
        try:
            self.stack.wait_for("flightstack: paper_quad")
        except AssertionError:
            self.kill()
            raise

    def stop(self) -> None:
        """End both as Ctrl-C does, and expect that they end in order."""
        self.stack.interrupt()
        codes = self.stack.end(), self.simulator.end()
        assert codes == (0, 0), self.output

    def kill(self) -> None:
        """End both, whatever they do."""
        self.stack.kill()
        self.simulator.kill()

    @property
    def output(self) -> str:
        """What both processes said."""
        return f"--- flightstack\n{self.stack.output}\n--- sim-bridge\n{self.simulator.output}"
