"""The services of the vehicle: one list."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial

from flightstack import __version__
from flightstack.core.contract import Vector3
from flightstack.core.enums import Severity
from flightstack.core.portable_math import yaw_angle
from flightstack.mavlink.link import Address
from flightstack.mavlink.param_pack import pack_file
from flightstack.mavlink.text_file import PastText, pack_texts
from flightstack.params.metadata import parameters_json
from flightstack.services.commands.command_server import CommandService
from flightstack.services.commands.context import VehicleContext
from flightstack.services.commands.guided import GuidedItems
from flightstack.services.commands.link_commands import LinkCommands
from flightstack.services.commands.system import FailureCommands
from flightstack.services.files.component_metadata import ComponentMetadata, vehicle_files
from flightstack.services.files.ftp_server import FtpServer
from flightstack.services.logs.log_server import LogServer
from flightstack.services.logs.log_stream import LogStream
from flightstack.services.mission.mission_server import MissionService
from flightstack.services.params.param_server import ParamServer
from flightstack.services.routing.peer import Peer
from flightstack.services.routing.router import Service
from flightstack.services.streams.link_loss import GroundLinkMonitor, stream_monitors
from flightstack.services.streams.manual_server import ManualServer
from flightstack.services.streams.setpoint_server import PoseReference, SetpointServer
from flightstack.services.streams.timesync import TimeService
from flightstack.services.telemetry.telemetry import Telemetry
from flightstack.vehicle.assembly import VehicleParts
from flightstack.vehicle.status import VehicleInfo

VENDOR = "flightstack"


def make_services(
    own: Address,
    vehicle: VehicleContext,
    parts: VehicleParts,
    telemetry: Telemetry,
    info: VehicleInfo,
    peer_at: Callable[[Hashable], Peer],
    has_room: Callable[[Hashable], bool],
) -> list[Service]:
    """Return every service, in sending order.

    ``peer_at`` finds a known peer; ``has_room`` is False for a congested peer.
    """
    metadata = ComponentMetadata(
        parameters_json(vehicle.params.specs.values()), VENDOR, info.model, __version__
    )
    log_stream = LogStream(own, vehicle.logs.open_tail, has_room)
    link_commands = LinkCommands(own, telemetry, peer_at, log_stream, metadata)
    failures = FailureCommands(vehicle.simulator, lambda: parts.now.behaviour.failures_allowed != 0)
    return [
        MissionService(own, parts),
        GuidedItems(own, vehicle),
        CommandService(own, vehicle, peer_at, link_commands.answer, failures),
        link_commands,
        *stream_services(own, parts, info),
        GroundLinkMonitor(parts.now, parts.failsafes.links),
        TimeService(lambda: parts.now.time_us),
        ParamServer(own, vehicle.params, lambda text: parts.journal.say(Severity.WARNING, text)),
        *file_services(own, vehicle, metadata, has_room),
        log_stream,
    ]


def stream_services(own: Address, parts: VehicleParts, info: VehicleInfo) -> tuple[Service, Service]:
    """Return the services of offboard setpoints and manual control, each with the monitor of its stream."""
    now = parts.now

    def reference() -> PoseReference:
        state: list[float] = now.state.tolist()
        return PoseReference(
            Vector3(*state[:3]), yaw_angle(*state[6:10]), info.frame, parts.area.home.altitude_m
        )

    offboard, manual = stream_monitors(now, parts.failsafes.links)
    return (
        SetpointServer(
            own,
            reference,
            partial(parts.navigator.set_offboard, max_thrust_n=info.max_thrust_n),
            partial(parts.journal.say, Severity.WARNING),
            offboard,
        ),
        ManualServer(own, parts.requests.take_sticks, manual),
    )


def file_services(
    own: Address,
    vehicle: VehicleContext,
    metadata: ComponentMetadata,
    has_room: Callable[[Hashable], bool],
) -> tuple[Service, Service]:
    """Return the MAVLink FTP server and the log server."""
    texts = vehicle.journal.texts

    def past_texts() -> bytes:
        return pack_texts(PastText(1e-6 * text.time_us, text.severity, text.text) for text in texts)

    pack = partial(pack_file, vehicle.params)
    files = vehicle_files(metadata, pack, vehicle.logs, past_texts)
    return (
        FtpServer(own, files, has_room),
        LogServer(own, vehicle.logs, lambda: vehicle.now.status.armed, vehicle.journal.say, has_room),
    )
