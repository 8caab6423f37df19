"""Ports and system id of vehicle instance N, unique to each instance.

The vehicle's local ports (18570 + N, 14580 + N) and the simulator's port (4560 + N) are PX4's; the TCP port
(5760 + 10·N) is ArduPilot's. The vehicle sends first to API clients at 14540 + N, as PX4 does, and to ground stations
at 14550 + N, where every PX4 instance uses 14550. To avoid overlaps, each further ten instances use client ports 1000
higher.
"""

from __future__ import annotations

import ipaddress

GROUND, API, TCP = "ground", "api", "tcp"
"""Channels for ground stations, companion computers, and TCP clients; the latter get the rates of ground stations."""

INSTANCES = 250
"""Number of instances, counted from 0; the last one has the highest system id of a vehicle."""

_BLOCK, _BLOCK_STEP = 10, 1000


def system_id(instance: int) -> int:
    """Return the default MAVLink system id, which MAV_SYS_ID overrides."""
    return instance + 1


def simulator_port(instance: int) -> int:
    """Return the TCP port on which the simulator listens."""
    return 4560 + instance


def tcp_port(instance: int) -> int:
    """Return the TCP port on which the vehicle listens."""
    return 5760 + 10 * instance


def vehicle_ground_port(instance: int) -> int:
    """Return the UDP port of the vehicle for ground stations."""
    return 18570 + instance


def vehicle_api_port(instance: int) -> int:
    """Return the UDP port of the vehicle for companion computers."""
    return 14580 + instance


def ground_station_port(instance: int) -> int:
    """Return the UDP port of the ground station that the vehicle sends to first."""
    return _in_blocks(14550, instance)


def api_client_port(instance: int) -> int:
    """Return the UDP port of the API client that the vehicle sends to first."""
    return _in_blocks(14540, instance)


def _in_blocks(first: int, instance: int) -> int:
    block, place = divmod(instance, _BLOCK)
    return first + _BLOCK_STEP * block + place


def is_loopback(host: str) -> bool:
    """Return True for an IPv4 address that is local to this machine."""
    return ipaddress.IPv4Address(host).is_loopback
