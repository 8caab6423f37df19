"""The services that take streams, joined to the autopilot."""

from __future__ import annotations

from flightstack.autopilot import Autopilot
from flightstack.contract import Vector3
from flightstack.ground.service import Service
from flightstack.guidance.setpoints import OffboardSetpoint
from flightstack.mavlink.services.addressing import Address
from flightstack.mavlink.services.manual_server import ManualServer
from flightstack.mavlink.services.setpoint_messages import Here
from flightstack.mavlink.services.setpoint_server import SetpointServer
from flightstack.mavlink.services.stream_watch import StreamWatch
from flightstack.mavlink.telemetry import euler
from flightstack.snapshot import WARNING


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
