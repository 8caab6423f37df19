"""The services of the vehicle, put together: one line each."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack import __version__
from flightstack.core.enums import Severity
from flightstack.mavlink.link import Address
from flightstack.params.metadata import parameters_json
from flightstack.services.commands import VehicleContext
from flightstack.services.commands.command_service import CommandService
from flightstack.services.commands.failure_commands import FailureCommands
from flightstack.services.commands.link_commands import LinkCommands
from flightstack.services.files.component_metadata import ComponentMetadata
from flightstack.services.files.file_services import file_services
from flightstack.services.logs.log_stream import LogStream
from flightstack.services.mission.guided_items import GuidedItems
from flightstack.services.mission.mission_service import MissionService
from flightstack.services.params.param_server import ParamServer
from flightstack.services.routing.link_loss import LinkLossService
from flightstack.services.routing.peer import Peer
from flightstack.services.service import Service
from flightstack.services.streams.stream_services import stream_services
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
    """Return every service, in the order in which their messages are sent.

    ``peer_at`` finds a known peer; ``has_room`` is False for a peer that reads more slowly than it is sent to.
    """
    metadata = ComponentMetadata(
        parameters_json(vehicle.params.specs.values()), VENDOR, info.model, __version__
    )
    log_stream = LogStream(own, lambda: vehicle.open_log_tail(), has_room)  # noqa: PLW0108  # the process sets it later
    link_commands = LinkCommands(own, telemetry, peer_at, log_stream, metadata)
    failures = FailureCommands(vehicle.simulator, lambda: parts.now.behaviour.failures_allowed != 0)
    return [
        MissionService(own, parts),
        GuidedItems(own, vehicle),
        CommandService(own, vehicle, peer_at, link_commands.answer, failures),
        link_commands,
        *stream_services(own, parts, info),
        LinkLossService(parts.now, parts.supervisor.links),
        TimeService(lambda: parts.now.time_us),
        ParamServer(own, vehicle.params, lambda text: parts.journal.say(Severity.WARNING, text)),
        *file_services(own, vehicle, metadata, has_room),
        log_stream,
    ]
