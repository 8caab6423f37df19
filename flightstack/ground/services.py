"""The services of the vehicle, put together: one line each."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack import __version__
from flightstack.commands import VehicleContext
from flightstack.ground.command_service import CommandService
from flightstack.ground.facts import AutopilotFacts
from flightstack.ground.failure_commands import FailureCommands
from flightstack.ground.file_services import file_services
from flightstack.ground.guided_items import GuidedItems
from flightstack.ground.link_commands import LinkCommands
from flightstack.ground.link_loss import LinkLossService
from flightstack.ground.mission_service import MissionService
from flightstack.ground.peer import Peer
from flightstack.ground.service import Service
from flightstack.ground.stream_services import stream_services
from flightstack.mavlink.services.addressing import Address
from flightstack.mavlink.services.component_metadata import ComponentMetadata
from flightstack.mavlink.services.log_stream import LogStream
from flightstack.mavlink.services.param_server import ParamServer
from flightstack.mavlink.services.timesync import TimeService
from flightstack.params.metadata import parameters_json
from flightstack.snapshot import WARNING

VENDOR = "flightstack"


def make_services(
    own: Address,
    vehicle: VehicleContext,
    facts: AutopilotFacts,
    peer_at: Callable[[Hashable], Peer],
    has_room: Callable[[Hashable], bool],
) -> list[Service]:
    """Return every service, in the order in which their messages are sent.

    ``peer_at`` finds a known peer; ``has_room`` is False for a peer that reads more slowly than it is sent to.
    """
    metadata = ComponentMetadata(
        parameters_json(vehicle.params.specs.values()), VENDOR, facts.model, __version__
    )
    log_stream = LogStream(own, lambda: vehicle.open_log_tail(), has_room)  # noqa: PLW0108  # the process sets it later
    link_commands = LinkCommands(own, facts, peer_at, log_stream, metadata)
    failures = FailureCommands(vehicle.simulator, lambda: vehicle.autopilot.behaviour.failures_allowed != 0)
    return [
        MissionService(own, vehicle.autopilot),
        GuidedItems(own, vehicle),
        CommandService(own, vehicle, peer_at, link_commands.answer, failures),
        link_commands,
        *stream_services(own, vehicle.autopilot),
        LinkLossService(vehicle.autopilot),
        TimeService(lambda: facts.time_us),
        ParamServer(own, vehicle.params, lambda text: vehicle.autopilot.say(WARNING, text)),
        *file_services(own, vehicle, metadata, has_room),
        log_stream,
    ]
