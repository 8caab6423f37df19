"""The vehicle's channels, and the numbers of instance N: ports that no other instance uses, and the system id.

The vehicle's own ports are PX4's (18570 + N, 14580 + N), the simulator's too (4560 + N), and the TCP port is
ArduPilot's (5760 + 10·N). Those of clients, which the vehicle calls unasked, are PX4's for the first ten instances:
14540 + N, and 14550 + N for ground stations, where PX4 calls 14550 from all. Further up these ranges meet each
other and the vehicles' own, so that each further ten instances begin 1000 ports higher.
"""

from __future__ import annotations

import ipaddress

GROUND, API, TCP = "ground", "api", "tcp"
"""The channels of ground stations, of companions, and of TCP clients, which get the rates of a ground station."""

INSTANCES = 250
"""Instances are numbered from 0; the last one has the highest system id of a vehicle."""

_BLOCK, _BLOCK_STEP = 10, 1000


def system_id(instance: int) -> int:
    """Return the MAVLink system id, unless MAV_SYS_ID says another."""
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
    """Return the UDP port of the vehicle for companions."""
    return 14580 + instance


def ground_station_port(instance: int) -> int:
    """Return the UDP port of the ground station that the vehicle calls unasked."""
    return _in_blocks(14550, instance)


def api_client_port(instance: int) -> int:
    """Return the UDP port of the API client that the vehicle calls unasked."""
    return _in_blocks(14540, instance)


def _in_blocks(first: int, instance: int) -> int:
    block, place = divmod(instance, _BLOCK)
    return first + _BLOCK_STEP * block + place


def is_loopback(host: str) -> bool:
    """Return True if an IPv4 address reaches this machine only."""
    return ipaddress.IPv4Address(host).is_loopback
