"""Connection strings as MAVLink tools write them: ``udp:PORT``, ``udpin:HOST:PORT``, ``udpout:HOST:PORT``."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.port_numbers import ground_station_port, vehicle_ground_port
from gcs_cli.errors import USAGE, CliError

LOOPBACK = "127.0.0.1"
"""Default local address; ``udp:0.0.0.0:14550`` listens on all interfaces."""

DEFAULT_CONNECTION = f"udp:{LOOPBACK}:{ground_station_port(0)}"


def vehicle_connection(instance: int) -> str:
    """Return the connection string of a vehicle on this machine at its own port."""
    return f"udpout:{LOOPBACK}:{vehicle_ground_port(instance)}"


VEHICLE_CONNECTION = vehicle_connection(0)
_FORMS = "udp:PORT, udpin:HOST:PORT or udpout:HOST:PORT"


class VehicleEndpoint(NamedTuple):
    """Address of the vehicle: a local address on which we listen, or a remote one to which we send first."""

    host: str
    port: int
    listens: bool

    def __str__(self) -> str:
        return f"UDP {self.host}:{self.port}"


def parse_endpoint(text: str) -> VehicleEndpoint:
    """Read a connection string; raise CliError (usage)."""
    scheme, _, rest = text.partition(":")
    host, _, port_text = rest.rpartition(":")
    listens = scheme in ("udp", "udpin")
    if scheme not in ("udp", "udpin", "udpout") or (scheme == "udpout" and not host):
        raise CliError(f"--connect {text}: expected {_FORMS}", USAGE)
    if not (port_text.isascii() and port_text.isdigit() and 0 < int(port_text) < 65536):
        raise CliError(f"--connect {text}: {port_text or 'nothing'} is not a port (1 to 65535)", USAGE)
    return VehicleEndpoint(host or LOOPBACK, int(port_text), listens)
