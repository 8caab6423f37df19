"""The vehicle's ground links with all services, against whatever arrives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.port_numbers import API, GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import Signing
from flightstack.services.routing.hub import MAX_PEERS, MAX_TO_FORWARD
from flightstack.services.routing.peer import PeerAddress
from tests.fuzz.inputs import KINDS, Inputs
from tests.fuzz.measure import calls, held
from tests.support.plan_items import item
from tests.support.tools import NIGHTLY
from tests.support.truth import World

MESSAGES = 8_000
TICK_EVERY = 40
MOST_HELD = 1_000_000
"""Objects and octets that a hub may keep after any number of messages: its queue of 4096 frames is most of it."""
CALLS_PER_OCTET = 40


def address(number: int) -> PeerAddress:
    return PeerAddress(API if number % 5 == 0 else GROUND, f"192.0.2.{number % 200}", 14550 + number)


def throw(world: World, inputs: Inputs, messages: int, peers: int = 80) -> None:
    """Let ``messages`` datagrams arrive while the vehicle lives on."""
    hub = world.engine.stack.ground
    for number in range(messages):
        peer = address(inputs.random.randrange(peers))
        for piece in inputs.pieces(inputs.datagram()):
            hub.receive(peer, piece, world.time_s)
        if number % TICK_EVERY == 0:
            world.run_for(0.01)
            for _ in hub.poll(world.time_s):
                pass


def flight_content(world: World) -> tuple[object, ...]:
    """All that a stranger must not change."""
    stack, state = world.engine.stack, world.state
    return (
        world.engine.simulator.frame.state.tobytes(), stack.simulator.rotor_speed_rad_s.tobytes(),
        state.armed, state.mode, stack.places.ids, dict(stack.params.values()), stack.area.home,
    )  # fmt: skip


@pytest.mark.parametrize("flying", [False, True])
def test_nothing_raises_memory_stays_bounded_and_the_vehicle_still_answers(flying: bool) -> None:
    world = World()
    if flying:
        world.arm()
        world.takeoff(5.0)
        world.run_for(1.0)
    inputs = Inputs(seed=11 + flying)
    throw(world, inputs, MESSAGES)
    assert len(inputs.drawn) == len(KINDS)
    hub = world.engine.stack.ground
    assert sum(not permanent for _, permanent in hub.addresses()) <= MAX_PEERS
    assert hub.forward_backlog <= MAX_TO_FORWARD
    assert np.isfinite(world.engine.simulator.frame.state).all()
    world.run_for(0.5)
    assert held(hub) < MOST_HELD
    world.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    world.download()


def test_memory_does_not_grow_with_the_number_of_messages() -> None:
    world = World()
    inputs = Inputs(seed=21)
    throw(world, inputs, 4_000)
    first = held(world.engine.stack.ground)
    throw(world, inputs, 8_000)
    assert held(world.engine.stack.ground) < 1.5 * first


def noise_for_others(inputs: Inputs) -> bytes:
    """Return what must not concern the vehicle: noise, wrong checksums, messages for another system."""
    style = inputs.random.random()
    if style < 0.2:
        return inputs.noise()
    if style < 0.5:
        return inputs.spoiled()
    while True:
        kind = inputs.random.choice(KINDS)
        if any(field.name == "target_system" for field in kind.fields):
            return inputs.frame(kind, cuts=False)


@pytest.mark.parametrize("signed", [False, True])
def test_what_is_not_for_the_vehicle_or_not_signed_changes_no_bit_of_its_flight(signed: bool) -> None:
    """A mission flown with strangers on the link is the mission flown without them, bit by bit.

    On a signed link the strangers say what they like to the vehicle itself; on another they speak to system 7.
    """
    worlds = [World(seed=3), World(seed=3)]
    for world in worlds:
        world.upload([item(22, z=8.0), item(16, 10.0, 5.0, 8.0), item(21, 10.0, 5.0)])
        world.arm()
        world.start_mission()
        if signed:
            world.engine.stack.ground.use_signing(
                Signing(bytes(range(32)), lambda: 1.75e9), lambda _key: None
            )
    inputs = Inputs(seed=31 + signed, targets=(0, 1, 1) if signed else (7,), sources=(7, 255))
    quiet, noisy = worlds
    for _ in range(60):
        for world in worlds:
            world.run_for(0.05)
        for _ in range(100):
            data = inputs.datagram() if signed else noise_for_others(inputs)
            noisy.engine.stack.ground.receive(address(inputs.random.randrange(9)), data, noisy.time_s)
    assert quiet.state.altitude_m > 1.0
    if signed:
        assert noisy.engine.stack.ground.addresses() == quiet.engine.stack.ground.addresses()
    assert flight_content(noisy) == flight_content(quiet)


def test_mutated_sessions_of_a_real_client() -> None:
    """Uploads, commands and parameters with frames lost, repeated, swapped, cut, and bits turned."""
    world = World()
    link = Link(255, 190)
    plan = [item(22, z=8.0), item(16, 10.0, 5.0, 8.0), item(21, 10.0, 5.0)]
    messages = [
        mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
        mavlink.MAVLink_param_request_list_message(1, 1),
        mavlink.MAVLink_mission_count_message(1, 1, len(plan), 0),
        *(
            mavlink.MAVLink_mission_item_int_message(
                1,
                1,
                seq,
                i.frame,
                i.command,
                seq == 0,
                1,
                i.param1,
                i.param2,
                i.param3,
                i.param4,
                i.x,
                i.y,
                i.z,
            )
            for seq, i in enumerate(plan)
        ),
        mavlink.MAVLink_mission_request_list_message(1, 1, 0),
        *(mavlink.MAVLink_mission_request_int_message(1, 1, seq, 0) for seq in range(4)),
        mavlink.MAVLink_mission_ack_message(1, 1, 0, 0),
        mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_command_long_message(1, 1, 300, 0, 0, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_log_request_list_message(1, 1, 0, 65535),
    ]
    inputs = Inputs(seed=41)
    for story in range(300 if NIGHTLY else 100):
        frames = [link.encode(message) for message in messages]
        for frame in inputs.mutated(frames):
            world.engine.stack.ground.receive(address(story % 3), frame, world.time_s)
        world.run_for(0.3)
    world.download()
    assert held(world.engine.stack.ground) < MOST_HELD


@pytest.mark.parametrize(
    "data",
    [b"\xfd" * 65_000, b"\xfe" * 65_000, b"\xfe\x00" * 30_000, b"\xfd\xff\x00" * 20_000, bytes(65_000)],
    ids=["v2", "v1", "short v1", "long v2", "zeros"],
)
def test_the_work_is_bounded_by_the_size_of_what_arrives(data: bytes) -> None:
    world = World()
    hub = world.engine.stack.ground
    hub.receive(address(1), Link(255, 190).encode(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)), 0.0)
    assert calls(lambda: hub.receive(address(1), data, 0.0)) < CALLS_PER_OCTET * len(data)
    assert calls(lambda: hub.receive(address(2), data, 0.0)) < CALLS_PER_OCTET * len(data)
    assert hub.heard_s(address(1)) == 0.0
    assert hub.heard_s(address(2)) == -math.inf


def test_one_message_asks_for_a_bounded_answer() -> None:
    """Any single message, received and answered at once, is a bounded number of calls."""
    world = World()
    hub, inputs = world.engine.stack.ground, Inputs(seed=51)
    hub.receive(address(1), Link(255, 190).encode(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)), 0.0)

    def exchange() -> None:
        hub.receive(address(1), frame, 0.0)
        for _ in hub.poll(0.0):
            pass

    worst = 0
    for kind in KINDS:
        for _ in range(3):
            frame = inputs.frame(kind)
            worst = max(worst, calls(exchange))
    assert worst < 200_000
