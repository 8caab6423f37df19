"""Print the files that run while the vehicle takes one SET_POSITION_TARGET_LOCAL_NED: ``python -m tools.hops``.

From the datagram at the vehicle's socket to the setpoint that guidance flies. Instance 250 must be free.
"""

from __future__ import annotations

import socket
import sys
from pathlib import Path
from types import FrameType

from flightstack.core.port_numbers import vehicle_api_port
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.params.config import StackConfig
from flightstack.process.assembly import build
from flightstack.process.connections import GroundConnection
from flightstack.transports.vehicle_ports import LOOPBACK, PortsConfig

STACK = str(Path(__file__).parents[1] / "flightstack") + "/"
INSTANCE = 250
POSITION_ONLY = 0xDF8
"""type_mask that ignores all but the position."""


def files_of_a_setpoint() -> list[str]:
    """Return the files, in the order in which they run first; those that send telemetry are not among them."""
    stack = build(StackConfig(), lambda: None)
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.bind((LOOPBACK, 0))
    ports = PortsConfig(INSTANCE, (), client.getsockname(), LOOPBACK)
    connection, link, files = GroundConnection(ports, stack.ground), Link(255, 190), dict[str, None]()
    setpoint = mavlink.MAVLink_set_position_target_local_ned_message(
        0, StackConfig().system_id, 1, mavlink.MAV_FRAME_LOCAL_NED, POSITION_ONLY, 1.0, 2.0, -3.0, *[0.0] * 8
    )

    def note(frame: FrameType, event: str, argument: object) -> None:
        path = frame.f_code.co_filename
        if frame.f_code.co_name == "poll":  # telemetry begins
            sys.setprofile(None)
        elif event == "call" and path.startswith(STACK):
            files.setdefault(path.removeprefix(STACK))

    for profile in (None, note):  # the second message of a stream: the first one admits the sender
        client.sendto(link.encode(setpoint), (LOOPBACK, vehicle_api_port(INSTANCE)))
        sys.setprofile(profile)
        connection.serve(1.0)
        sys.setprofile(None)
    return list(files)


if __name__ == "__main__":
    found = files_of_a_setpoint()
    print(*found, f"{len(found)} files", sep="\n")
