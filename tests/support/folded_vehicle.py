"""Messages of a vehicle folded into its view, through pymavlink's encoder and decoder."""

from __future__ import annotations

from typing import Any

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from gcs_cli.vehicle.view_builder import update
from gcs_cli.vehicle.view_types import VehicleView

HOLD_MODE, MISSION_MODE, RETURN_MODE = (4 << 16 | sub << 24 for sub in (3, 4, 5))
"""Modes of PX4."""


class Vehicle:
    """Sends messages as one system and folds them."""

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        self.link = Link(system_id, component_id)
        self.view = VehicleView()

    def send(self, message: Any, now_s: float = 1.0) -> VehicleView:
        return self.receive(self.link.encode(message), now_s)

    def receive(self, frame: bytes, now_s: float = 1.0) -> VehicleView:
        """Fold a frame of the vehicle."""
        for decoded in Link(0, 0).decode(frame):
            self.view = update(self.view, decoded, now_s)
        return self.view


def heartbeat(
    base: int = 1, mode: int = MISSION_MODE, state: int = 4, autopilot: int = 12, kind: int = 2
) -> Any:
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, base, mode, state, 3)
