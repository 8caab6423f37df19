"""The status texts that a vehicle has sent before, over a connection."""

from __future__ import annotations

from flightstack.mavlink import text_file
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.link.calls import vehicle_address
from gcs_cli.link.connection import Connection

WAIT_S = 1.5
"""Timeout of the file; many vehicles have no MAVLink FTP and never answer."""


def fetch_past_texts(connection: Connection) -> tuple[text_file.PastText, ...]:
    """Return the past status texts of the vehicle, the oldest first; none if it does not keep them."""
    client = FtpClient(vehicle_address(connection.session), connection.session.own)
    client.start_download(text_file.PATH)
    connection.run(client, "past texts", timeout_s=WAIT_S)
    return text_file.read_texts(client.result.content) if isinstance(client.result, FtpDone) else ()
