"""The services that take streams: offboard setpoints and manual control."""

from __future__ import annotations

from functools import partial

from flightstack.core.contract import Vector3
from flightstack.core.enums import Severity
from flightstack.mavlink.link import Address
from flightstack.services.service import Service
from flightstack.services.streams.manual_server import ManualServer
from flightstack.services.streams.setpoint_messages import Here
from flightstack.services.streams.setpoint_server import SetpointServer
from flightstack.services.streams.stream_watch import StreamWatch
from flightstack.services.telemetry.fields import euler
from flightstack.vehicle.assembly import VehicleParts
from flightstack.vehicle.status import VehicleInfo


def stream_services(own: Address, parts: VehicleParts, info: VehicleInfo) -> tuple[Service, Service]:
    """Return the services of offboard setpoints and of manual control; each reports the loss of its stream."""
    now, links = parts.now, parts.supervisor.links

    def vehicle_time_us() -> int:
        return now.time_us

    def set_offboard_lost(lost: bool) -> None:
        links.offboard_lost = lost

    def set_manual_lost(lost: bool) -> None:
        links.manual_lost = lost

    def here() -> Here:
        state: list[float] = now.state.tolist()
        return Here(Vector3(*state[:3]), euler(state[6:10])[2], info.frame, parts.area.home.altitude_m)

    offboard = StreamWatch(vehicle_time_us, lambda: now.behaviour.offboard_loss_s, set_offboard_lost)
    manual = StreamWatch(vehicle_time_us, lambda: now.behaviour.manual_loss_s, set_manual_lost)
    return (
        SetpointServer(
            own,
            here,
            partial(parts.navigator.set_offboard, max_thrust_n=info.max_thrust_n),
            partial(parts.journal.say, Severity.WARNING),
            offboard,
        ),
        ManualServer(own, parts.requests.take_sticks, manual),
    )
