"""A command of gcs to a vehicle in this process."""

from __future__ import annotations

from pathlib import Path

from tests.support.commands import Ended, gcs
from tests.support.fake_vehicle import FakeVehicle, serve

MISSIONS = Path(__file__).parents[2] / "missions"


def told(vehicle: FakeVehicle, *arguments: object) -> Ended:
    """Run ``gcs`` with the link to ``vehicle``."""
    with serve(vehicle) as socket:
        return gcs("--connect", f"udpout:127.0.0.1:{socket.address[1]}", *arguments)
