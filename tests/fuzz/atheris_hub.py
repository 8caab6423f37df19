"""Coverage-guided fuzz of the vehicle's ground links: ``python -m tests.fuzz.atheris_hub -max_total_time=120``.

Needs atheris (pip install atheris), which is no dependency of the project. An input is a series of datagrams, each
behind one octet: its size for noise, or the number of a message whose payload follows with a right checksum.
Only the link and what it imports guide the search: compiled kernels cannot be instrumented, so the rest is not.
"""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(
    include=["flightstack.ground", "flightstack.commands", "flightstack.mavlink"]
):
    from flightstack.ground.peer import GROUND, PeerAddress
    from flightstack.mavlink.dialect import mavlink
    from flightstack.mavlink.link import Link
from tests.fuzz.inputs import KINDS, sealed
from tests.support.world import World

PEERS = [PeerAddress(GROUND, "192.0.2.1", port) for port in (1, 2)]
WORLD = World()
HEARTBEAT = Link(255, 190).encode(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))


def one_input(data: bytes) -> None:
    """Let the vehicle take one input, answer, and live on for a tick."""
    provider = atheris.FuzzedDataProvider(data)
    hub = WORLD.stack.ground
    hub.receive(PEERS[0], HEARTBEAT, WORLD._link_now_s())
    for _ in range(12):
        if not provider.remaining_bytes():
            break
        choice = provider.ConsumeIntInRange(0, len(KINDS))
        if choice == len(KINDS):
            datagram = provider.ConsumeBytes(300)
        else:
            kind = KINDS[choice]
            datagram = sealed(kind, provider.ConsumeBytes(kind.size) or b"\0", (0, 255, 190))
        hub.receive(PEERS[provider.ConsumeBool()], datagram, WORLD._link_now_s())
        WORLD._held_s += 0.05
        for _answer in hub.poll(WORLD._link_now_s()):
            pass
    WORLD.tick()


if __name__ == "__main__":
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
