"""Seeded inputs on the vehicle's ground links, 10,000 by day: plain, signed and as a stream over TCP.

A guard stands behind every single one: see ``tests.fuzz.guard``. The vehicle has logs to be asked for.
"""

from __future__ import annotations

import random
from functools import partial

import pytest

from flightstack.core.port_numbers import GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import LARGEST_FRAME
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import MAX_STREAMS, LinkSigning, Signing
from flightstack.services.routing.hub import MAX_PEERS, MAX_TO_FORWARD
from flightstack.services.routing.peer import PeerAddress
from flightstack.testing.engine import Engine
from tests.fuzz.guard import Guard
from tests.fuzz.inputs import KINDS, Inputs
from tests.fuzz.measure import held
from tests.fuzz.memory_logs import MemoryLogs
from tests.fuzz.script import KEY
from tests.fuzz.targets import answers, check_vehicle
from tests.support.plan_items import item
from tests.support.tools import NIGHTLY
from tests.support.truth import World

INPUTS = (
    {"plain": 80_000, "signed": 60_000, "stream": 60_000}
    if NIGHTLY
    else dict.fromkeys(("plain", "signed", "stream"), 10_000)
)
A_WORLD = 10_000 if NIGHTLY else 5_000
"""Inputs until the vehicle is a new one: it may have been told to erase its logs, or to end its flight."""
A_TICK = 100
PEERS = [PeerAddress(GROUND, "192.0.2.7", number) for number in range(12)]
MOST_HELD = 1_000_000
"""Objects and octets that a hub may keep; its queue of 4096 frames to forward is most of it."""
MOST_OF_A_POLL = 20_000


class Signatures:
    """Signs some inputs with the right key and some with a wrong one, and leaves the others."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._right = Signing(KEY, lambda: 1.75e9)
        self._wrong = Signing(bytes(range(32)), lambda: 1.75e9)

    def signed(self, data: bytes) -> tuple[bytes, bool]:
        """Return what to send, and whether the vehicle may take it."""
        kind = mavlink.mavlink_map.get(int.from_bytes(data[7:10], "little")) if len(data) > 11 else None
        style = self._random.random()
        if kind is None or data[0] != 0xFD or data[1] + 12 != len(data) or style < 0.2:
            return data, False
        signing = self._right if style < 0.7 else self._wrong
        return signing.sign(data, kind.crc_extra, int(style * 100) % 4), signing is self._right

    def right(self, data: bytes) -> bytes:
        """Return a frame with the right signature."""
        return self._right.sign(data, mavlink.mavlink_map[int.from_bytes(data[7:10], "little")].crc_extra, 8)


def sane(link: Link, number: int) -> list[bytes]:
    """Return what a proper client may send between the mad ones: a parameter, and a mission of one item."""
    place = item(16, 10.0 + number % 50, 5.0, 8.0)
    return [
        link.encode(message)
        for message in (
            mavlink.MAVLink_param_set_message(1, 1, b"MPC_XY_CRUISE", 3.0 + number % 7, 9),
            mavlink.MAVLink_mission_count_message(1, 1, 1, 0),
            mavlink.MAVLink_mission_item_int_message(
                1, 1, 0, place.frame, place.command, 0, 1, 0, 0, 0, float("nan"), place.x, place.y, place.z, 0
            ),
        )
    ]


def make_world(name: str, number: int) -> tuple[World, Link]:
    """Return a vehicle, flying in every second turn, and the link of somebody who may speak to it."""
    world = World(make_engine=partial(Engine, flight_logs=MemoryLogs(0, 300, 5_000)))
    if number % 2:
        world.arm()
        world.takeoff(5.0)
        world.run_for(0.5)
    world.link.cut()
    if name == "stream":
        for peer in PEERS:
            world.engine.stack.ground.add_peer(peer)  # as the process does when a TCP client connects
    if name != "signed":
        return world, Link(250, 190)
    world.engine.stack.ground.use_signing(Signing(KEY, lambda: 1.75e9), lambda _key: None)
    return world, Link(250, 190, signing=LinkSigning(Signing(KEY, lambda: 1.75e9), 9))


def throw(name: str, world: World, inputs: Inputs, signatures: Signatures) -> tuple[int, Guard]:
    """Let a world's inputs arrive, with a look behind each; return how many there were, and the guard."""
    hub, guard, draw = world.engine.stack.ground, Guard(world), inputs.random
    last = dict.fromkeys(PEERS, b"")
    proper = Link(250, 191)
    for count in range(0, A_WORLD, A_TICK):
        waiting = sane(proper, count // A_TICK)
        for number in range(A_TICK):
            peer = PEERS[draw.randrange(len(PEERS) - 1)]
            data, may_change = inputs.datagram(), True
            if waiting and number % 10 == 0:
                peer, data = PEERS[-1], waiting.pop(0)
                data = signatures.right(data) if name == "signed" else data
            elif name == "signed":
                data, may_change = signatures.signed(data)
            cuts = sorted(draw.randrange(len(data) + 1) for _ in range(3)) if name == "stream" else []
            for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
                hub.receive(peer, data[start:end], world.time_s)
            guard.after(last[peer] + data, peer, may_change)
            last[peer] = (last[peer] + data)[
                -LARGEST_FRAME:
            ]  # a beginning is held until it is whole, or too long
        world.run_for(0.02)
        assert sum(1 for _ in hub.poll(world.time_s)) < MOST_OF_A_POLL
        guard.after_tick()
    return A_WORLD, guard


@pytest.mark.parametrize("name", INPUTS)
def test_inputs_leave_the_vehicle_sound(name: str) -> None:
    seed = 1_000 + list(INPUTS).index(name)
    inputs, signatures = Inputs(seed, sources=(1, 7, 255)), Signatures(seed)
    tried = plans = parameters = 0
    most_held = 0
    for number in range(INPUTS[name] // A_WORLD):
        world, client = make_world(name, number)
        count, guard = throw(name, world, inputs, signatures)
        hub = world.engine.stack.ground
        tried += count
        plans += guard.plan_changes
        parameters += guard.parameter_changes
        most_held = max(most_held, held(hub))
        assert hub.forward_backlog <= MAX_TO_FORWARD
        assert sum(not permanent for _, permanent in hub.addresses()) <= MAX_PEERS
        if hub.signing is not None:
            assert hub.signing.stream_count <= MAX_STREAMS
            counts = hub.signing.counts
            assert min(counts.good, counts.unsigned_refused, counts.bad_signature) > 100
        check_vehicle(world)
        assert "AUTOPILOT_VERSION" in answers(world, client, world.time_s)
    print(f"{name}: {tried} inputs, {plans} plans and {parameters} parameters changed, {most_held} held")
    assert tried == INPUTS[name]
    assert len(inputs.drawn) == len(KINDS)
    assert most_held < MOST_HELD
    # the guard has seen changes; without NIGHTLY 28 of plans at the fewest
    assert min(plans, parameters) > (100 if NIGHTLY else 15)
