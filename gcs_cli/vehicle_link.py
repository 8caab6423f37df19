"""Open the link to the vehicle with the options of a command."""

from __future__ import annotations

from pathlib import Path

import typer

from flightstack.mavlink.signing import LinkSigning
from flightstack.process.console import complain
from flightstack.process.signing_file import open_shared_signing
from gcs_cli.errors import PortInUseError
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import VEHICLE_CONNECTION, parse_endpoint
from gcs_cli.settings import LinkOptions, link_options, settings_of


def open_signing(key: Path | None) -> LinkSigning | None:
    """Return signing with the key in the file ``key``, or None without one; raise ConfigError."""
    return None if key is None else open_shared_signing(key, "gcs")


def open_link(context: typer.Context, options: LinkOptions) -> Connection:
    """Open the link to the vehicle; raise CliError.

    If another ground station listens on the default port, connect to the vehicle's own port.
    """
    link = link_options(context, options)
    signing = open_signing(settings_of(context).signing_key)
    try:
        return Connection(link.endpoint, signing=signing, system_id=link.system_id)
    except PortInUseError as error:
        if link.connect is not None:
            raise
        vehicle = parse_endpoint(VEHICLE_CONNECTION)
        complain(f"gcs: {error.port} is in use: connecting to the vehicle at {vehicle}")
        return Connection(vehicle, signing=signing)


def connect_vehicle(context: typer.Context, options: LinkOptions) -> Connection:
    """Open the link and wait for the vehicle; raise CliError."""
    connection = open_link(context, options)
    try:
        connection.wait_for_vehicle(link_options(context, options).timeout_s)
    except BaseException:
        connection.close()
        raise
    return connection
