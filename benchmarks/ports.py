"""An instance number whose ports nobody uses, so that a benchmark disturbs no flight."""

from __future__ import annotations

import socket

from flightstack.core.port_numbers import (
    ground_station_port,
    simulator_port,
    tcp_port,
    vehicle_api_port,
    vehicle_ground_port,
)

_FIRST, _LAST = 60, 99


def is_free(kind: socket.SocketKind, port: int) -> bool:
    """Return True if a port of this machine can be bound."""
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def free_instance() -> int:
    """Return the first instance, from 60 on, all of whose ports are free."""
    for instance in range(_FIRST, _LAST + 1):
        udp = (ground_station_port(instance), vehicle_ground_port(instance), vehicle_api_port(instance))
        tcp = (simulator_port(instance), tcp_port(instance))
        if all(is_free(socket.SOCK_STREAM, port) for port in tcp) and all(
            is_free(socket.SOCK_DGRAM, port) for port in udp
        ):
            return instance
    raise RuntimeError(f"instances {_FIRST} to {_LAST} are all in use")
