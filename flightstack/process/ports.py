"""Port options: validation and description."""

from __future__ import annotations

from collections.abc import Sequence

from flightstack.core.errors import ConfigError
from flightstack.core.port_numbers import api_client_port, ground_station_port, is_loopback, tcp_port
from flightstack.transports.udp import Address, resolve
from flightstack.transports.vehicle_ports import LOOPBACK, PortsConfig

_HIGHEST_PORT = 65535


def ports_config(
    instance: int,
    stations: Sequence[str],
    station_port: int | None,
    api_port: int | None,
    listen: str,
    tcp: int | None,
) -> PortsConfig:
    """Return the configuration of the options; without ``stations`` there is one on this machine. Raise ConfigError."""
    bound = _host("--listen", listen, listen)
    ground = tuple(_address("--gcs", text) for text in stations)
    for text, (host, _) in zip(stations, ground, strict=True):
        if is_loopback(bound) and not is_loopback(host):
            raise ConfigError("--gcs", text, f"cannot be reached from {bound}: add --listen 0.0.0.0")
    if not ground:
        port = ground_station_port(instance) if station_port is None else station_port
        ground = ((LOOPBACK, _port("--gcs-port", port)),)
    api = _port("--api-port", api_client_port(instance) if api_port is None else api_port)
    tcp_number = tcp_port(instance) if tcp is None else tcp
    if tcp_number:
        _port("--tcp-port", tcp_number)
    return PortsConfig(instance, ground, (LOOPBACK, api), bound, tcp_number)


def described(config: PortsConfig) -> str:
    """Return a description of the ports for the line printed at startup."""
    stations = ", ".join(
        f"{'' if is_loopback(host) else host + ':'}{port}" for host, port in config.ground_stations
    )
    tcp = f"TCP {config.tcp_port}" if config.tcp_port else "no TCP"
    return f"ground station UDP {stations}, API UDP {config.api_client[1]}, {tcp}"


def warning(config: PortsConfig, signed: bool = False) -> str | None:
    """Return a warning if the vehicle listens on a network without signing, or None."""
    if signed or is_loopback(config.listen):
        return None
    return (
        f"warning: listening on {config.listen} without signing: any program that can "
        "reach this machine can fly the vehicle"
    )


def _address(option: str, text: str) -> Address:
    host, colon, number = text.rpartition(":")
    if not colon or not host or not number.isascii() or not number.isdigit():
        raise ConfigError(option, text, "must be HOST:PORT")
    return _host(option, text, host), _port(option, int(number))


def _host(option: str, text: str, host: str) -> str:
    try:
        return resolve(host)
    except OSError:
        raise ConfigError(option, text, "is not a host with an IPv4 address") from None


def _port(option: str, port: int) -> int:
    if not 0 < port <= _HIGHEST_PORT:
        raise ConfigError(option, str(port), f"is outside 1 to {_HIGHEST_PORT}")
    return port
