"""The status texts that a vehicle has sent before, over a connection."""

from __future__ import annotations

from collections.abc import Sequence

from flightstack.mavlink import text_file
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.link.calls import vehicle_address
from gcs_cli.link.connection import Connection
from gcs_cli.vehicle.view_types import StatusText

WAIT_S = 1.5
"""Timeout of the file; many vehicles have no MAVLink FTP and never answer."""
_SAME_S = 10.0
"""Largest difference of vehicle time between a text of the file and the same text as received.

The latter is that of the telemetry before it: a simulation may be 100 times faster than the link's 0.1 s.
"""


def fetch_past_texts(connection: Connection) -> tuple[text_file.PastText, ...]:
    """Return the past status texts of the vehicle, the oldest first; none if it does not keep them."""
    client = FtpClient(vehicle_address(connection.session), connection.session.own)
    client.start_download(text_file.PATH)
    connection.run(client, "past texts", timeout_s=WAIT_S)
    return text_file.read_texts(client.result.content) if isinstance(client.result, FtpDone) else ()


def texts_before(past: Sequence[text_file.PastText], live: Sequence[StatusText]) -> list[text_file.PastText]:
    """Return the past texts without those that are also among ``live``, each of which stands for one."""
    left = list(live)
    before = []
    for entry in reversed(past):
        same = next((text for text in reversed(left) if _is_same(entry, text)), None)
        if same is None:
            before.append(entry)
        else:
            left.remove(same)
    return before[::-1]


def _is_same(past: text_file.PastText, live: StatusText) -> bool:
    time_s = live.vehicle_time_s
    is_near = time_s is None or abs(time_s - past.time_s) <= _SAME_S
    return is_near and (past.severity, past.text) == (live.severity, live.text)
