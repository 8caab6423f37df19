"""Interface of the vehicle's services, and the list of all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import partial
from typing import Protocol, runtime_checkable

from flightstack import __version__
from flightstack.core.contract import Vector3
from flightstack.core.enums import Severity
from flightstack.core.portable_math import yaw_angle
from flightstack.mavlink.link import Address, Message
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
from flightstack.services.streams.link_loss import GroundLinkMonitor, stream_monitors
from flightstack.services.streams.manual_server import ManualServer
from flightstack.services.streams.setpoint_server import PoseReference, SetpointServer
from flightstack.services.streams.timesync import TimeService
from flightstack.services.telemetry.telemetry import Telemetry
from flightstack.vehicle.assembly import VehicleParts
from flightstack.vehicle.status import VehicleInfo


class Service(Protocol):
    """A MAVLink protocol as a state machine without I/O.

    ``now_s`` is the link clock, which runs on while simulated time stands still.
    """

    @property
    def handles(self) -> frozenset[str]:
        """Type names of the messages that ``receive`` takes."""
        ...

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message from ``peer``. Ignore messages for other vehicles; never raise."""
        ...

    def poll(self, now_s: float) -> Iterable[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer; None stands for every peer that was heard."""
        ...

    def next_deadline(self) -> float | None:
        """Return the link time of the next poll if no message arrives before; None for never.

        −inf stands for every poll. The hub takes this at its word: before that time it does not poll the service.
        """
        ...


@runtime_checkable
class CountsVehicleTime(Protocol):
    """A service whose poll is due by the vehicle's clock."""

    def idle_s(self) -> float:
        """Return the vehicle time for which ``poll`` does nothing, if no message arrives [s]."""
        ...


OWN_MESSAGES = frozenset({"MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_REQUEST", "MISSION_REQUEST_INT"})
"""Messages that come by the thousand in a transfer, and change no service but their own."""


class Schedule:
    """Polls each service when it is due, and all of them after a message: in flight one of thirteen is due.

    A message for one service may change another: a command sets a parameter, which the parameter server announces.
    After one of ``OWN_MESSAGES``, only its services are polled.
    """

    def __init__(self, services: Sequence[Service]) -> None:
        self._services = services
        self._own: dict[str, list[int]] = {
            kind: [index for index, service in enumerate(services) if kind in service.handles]
            for kind in OWN_MESSAGES
        }
        self._clocks = {
            i: service for i, service in enumerate(services) if isinstance(service, CountsVehicleTime)
        }
        self._due_s: dict[int, float] = {}  # by the index of the service; not of those that are never due
        self.wake()

    def wake(self, message_type: str = "") -> None:
        """Poll all services at the next poll, or those that a message of this type may change."""
        if message_type in self._own:
            self._due_s.update(dict.fromkeys(self._own[message_type], -math.inf))
            return
        self._due_s = dict.fromkeys(range(len(self._services)), -math.inf)

    def idle_s(self, now_s: float) -> float:
        """Return the time for which no service is due, if link clock and vehicle clock run alike [s]."""
        idle_s = math.inf
        for index, due_s in self._due_s.items():
            clock = self._clocks.get(index) if due_s == -math.inf else None
            idle_s = min(idle_s, due_s - now_s if clock is None else clock.idle_s())
        return idle_s

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer; None stands for every peer that was heard."""
        addressed: list[tuple[Hashable | None, Message]] = []
        due = sorted([index for index, due_s in self._due_s.items() if due_s <= now_s])  # in sending order
        for index in due:
            addressed += self._services[index].poll(now_s)
        for index in due:
            due_s = self._services[index].next_deadline()
            if due_s is None:
                del self._due_s[index]
            else:
                self._due_s[index] = due_s
        return addressed


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
    log_stream = LogStream(own, lambda: vehicle.open_log_tail(), has_room)  # noqa: PLW0108  # the process sets it later
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
