"""The services that show files: MAVLink FTP and the log protocol, joined to parameters and logs."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack.mavlink.link import Address
from flightstack.mavlink.param_pack import pack_file
from flightstack.services.commands import VehicleContext
from flightstack.services.files.component_metadata import ComponentMetadata, vehicle_files
from flightstack.services.files.ftp_server import FtpServer
from flightstack.services.logs.log_server import LogServer
from flightstack.services.service import Service


def file_services(
    own: Address,
    vehicle: VehicleContext,
    metadata: ComponentMetadata,
    has_room: Callable[[Hashable], bool],
) -> tuple[Service, Service]:
    """Return the services of MAVLink FTP and of the log protocol."""
    files = vehicle_files(metadata, lambda arguments: pack_file(vehicle.params, arguments), vehicle.logs)
    return (
        FtpServer(own, files, has_room),
        LogServer(own, vehicle.logs, lambda: vehicle.now.status.armed, vehicle.journal.say, has_room),
    )
