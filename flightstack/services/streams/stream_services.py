"""The services that take streams, joined to the autopilot."""

from __future__ import annotations

from flightstack.core.contract import Vector3
from flightstack.guidance.setpoints import OffboardSetpoint
from flightstack.mavlink.addressing import Address
from flightstack.services.service import Service
from flightstack.services.streams.manual_server import ManualServer
from flightstack.services.streams.setpoint_messages import Here
from flightstack.services.streams.setpoint_server import SetpointServer
from flightstack.services.streams.stream_watch import StreamWatch
from flightstack.services.telemetry import euler
from flightstack.vehicle.autopilot import Autopilot
from flightstack.vehicle.snapshot import WARNING


class OffboardInbox:
    """The autopilot as the setpoint service sees it."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._frame = autopilot.places.frame

    def here(self) -> Here:
        """Tell where the vehicle is now."""
        state: list[float] = self._autopilot.now.state.tolist()
        home = self._autopilot.home
        return Here(Vector3(*state[:3]), euler(state[6:10])[2], self._frame, home.altitude_m)

    def take_offboard(self, setpoint: OffboardSetpoint) -> None:
        """Remember the newest setpoint."""
        self._autopilot.take_offboard(setpoint)

    def refuse_offboard(self, reason: str) -> None:
        """Tell the operator why setpoints are not taken."""
        self._autopilot.say(WARNING, reason)


def stream_services(own: Address, autopilot: Autopilot) -> tuple[Service, Service]:
    """Return the services of offboard setpoints and of manual control; each keeps its own fact of the links."""

    def vehicle_time_us() -> int:
        return autopilot.now.time_us

    def set_offboard_lost(lost: bool) -> None:
        autopilot.links.offboard_lost = lost

    def set_manual_lost(lost: bool) -> None:
        autopilot.links.manual_lost = lost

    offboard = StreamWatch(vehicle_time_us, lambda: autopilot.behaviour.offboard_loss_s, set_offboard_lost)
    manual = StreamWatch(vehicle_time_us, lambda: autopilot.behaviour.manual_loss_s, set_manual_lost)
    return (
        SetpointServer(own, OffboardInbox(autopilot), offboard),
        ManualServer(own, autopilot.take_sticks, manual),
    )
