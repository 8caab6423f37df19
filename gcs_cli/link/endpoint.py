"""Connection strings as MAVLink tools write them: ``udpin:HOST:PORT``, ``tcp:HOST:PORT``, ``serial:DEVICE:BAUD``."""

from __future__ import annotations

from typing import Final, NamedTuple

from flightstack.core.port_numbers import ground_station_port, vehicle_ground_port
from gcs_cli.errors import USAGE, CliError

LOOPBACK = "127.0.0.1"
"""Default local address; ``udp:0.0.0.0:14550`` listens on all interfaces."""

UDP_IN: Final = "udpin"
UDP_OUT: Final = "udpout"
TCP: Final = "tcp"
TCP_IN: Final = "tcpin"
SERIAL: Final = "serial"
RECORDING: Final = "recording"

DEFAULT_CONNECTION = f"udp:{LOOPBACK}:{ground_station_port(0)}"
DEFAULT_BAUD = 57600
"""Rate of telemetry radios and of TELEM ports; USB devices ignore it."""

FORMS = "udp:PORT, udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT, serial:DEVICE[:BAUD] or FILE.tlog"
_SCHEMES = {"udp": UDP_IN, UDP_IN: UDP_IN, UDP_OUT: UDP_OUT, TCP: TCP, "tcpout": TCP, TCP_IN: TCP_IN}
_TLOG_SUFFIX = ".tlog"


def vehicle_connection(instance: int) -> str:
    """Return the connection string of a vehicle on this machine at its own port."""
    return f"udpout:{LOOPBACK}:{vehicle_ground_port(instance)}"


VEHICLE_CONNECTION = vehicle_connection(0)


class VehicleEndpoint(NamedTuple):
    """Address of the vehicle: a local address that we listen on, a remote one, a serial port, or a recording."""

    kind: str
    host: str
    """Host, serial device, or file."""
    port: int = 0
    """Port, or baud rate of a serial device."""

    @property
    def listens(self) -> bool:
        """True if the vehicle connects to this address."""
        return self.kind in (UDP_IN, TCP_IN)

    def __str__(self) -> str:
        if self.kind == RECORDING:
            return self.host
        if self.kind == SERIAL:
            return f"{self.host} at {self.port} baud"
        return f"{'UDP' if self.kind in (UDP_IN, UDP_OUT) else 'TCP'} {self.host}:{self.port}"


def parse_endpoint(text: str) -> VehicleEndpoint:
    """Read a connection string; raise CliError (usage)."""
    if text.lower().endswith(_TLOG_SUFFIX):
        return VehicleEndpoint(RECORDING, text)
    scheme, _, rest = text.partition(":")
    rest = rest.removeprefix("//")  # as MAVSDK writes it
    if scheme == SERIAL and rest:
        return _serial(text, rest)
    kind = _SCHEMES.get(scheme)
    host, _, port_text = rest.rpartition(":")
    if kind is None or (kind in (UDP_OUT, TCP) and not host):
        raise CliError(f"--connect {text}: expected {FORMS}", USAGE)
    if not (port_text.isascii() and port_text.isdigit() and 0 < int(port_text) < 65536):
        raise CliError(f"--connect {text}: {port_text or 'nothing'} is not a port (1 to 65535)", USAGE)
    return VehicleEndpoint(kind, host or LOOPBACK, int(port_text))


def _serial(text: str, rest: str) -> VehicleEndpoint:
    device, colon, baud = rest.rpartition(":")
    if not colon:
        return VehicleEndpoint(SERIAL, rest, DEFAULT_BAUD)
    if not (baud.isascii() and baud.isdigit() and device):
        raise CliError(f"--connect {text}: {baud or 'nothing'} is not a baud rate", USAGE)
    return VehicleEndpoint(SERIAL, device, int(baud))
