"""The four ends of links that bytes arrive at, each as a function of a script (``tests.fuzz.script``).

A target begins anew for every script, so that a script that fails does so again. It raises for whatever must not be,
and returns how many datagrams and pieces of streams arrived.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from flightstack.core.port_numbers import API, GROUND
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import LARGEST_FRAME
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import LinkSigning, Signing
from flightstack.params.config import DEFAULT_HOME
from flightstack.params.vehicle import load_vehicle
from flightstack.services.routing.hub import MAX_TO_FORWARD
from flightstack.services.routing.peer import PeerAddress
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.testing.engine import Engine
from gcs_cli.link.session import Session
from sim_bridge.errors import PlantDivergedError
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.simulator import Simulator
from tests.fuzz.clients import SERVICES
from tests.fuzz.memory_logs import MemoryLogs
from tests.fuzz.script import KEY, MOST_STEPS, steps
from tests.support.truth import World

SIGNED, FLYING = 1, 2
"""Bits of a hub script's first octet."""
MOST_SENT = 20_000
"""Frames that a hub may send in reply to one script: a file in bursts is most of it."""
VEHICLE = load_vehicle("x_quad")
PEERS = (
    PeerAddress(GROUND, "192.0.2.1", 1),
    PeerAddress(API, "192.0.2.2", 2),
    PeerAddress(GROUND, "127.0.0.1", 3),  # it may set signing keys
    PeerAddress("tcp", "192.0.2.4", 4),
)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)


def hub(script: bytes) -> int:
    """The vehicle's ground links and all services; the first octet says which vehicle it is."""
    options = script[0] if script else 0
    world = World(make_engine=partial(Engine, flight_logs=MemoryLogs(0, 300, 5_000)))
    ground = world.engine.stack.ground
    link = Link(250, 190)
    keys = [KEY]
    if options & FLYING:
        world.arm()
        world.takeoff(5.0)
    if options & SIGNED:
        ground.use_signing(Signing(KEY, lambda: 1.75e9), keys.append)
        link = Link(250, 190, signing=LinkSigning(Signing(KEY, lambda: 1.75e9), 9))
    now_s, sent, arrivals = world.time_s, 0, 0
    for step in steps(script[1:]):
        now_s += step.pause_s
        for piece in step.pieces:
            ground.receive(PEERS[step.peer], piece, now_s)
            arrivals += 1
        sent += sum(1 for _ in ground.poll(now_s))
    assert sent < MOST_SENT
    world.engine.tick()
    world.engine.advance()
    check_vehicle(world)
    # whoever is left in charge of the key, a client that has it gets its answer
    if keys[-1] != KEY:
        return arrivals
    assert "AUTOPILOT_VERSION" in answers(world, link, now_s)
    return arrivals


def check_vehicle(world: World) -> None:
    """What holds of a vehicle, whatever it was told."""
    stack, params = world.engine.stack, world.engine.stack.params
    assert np.isfinite(world.engine.simulator.frame.state).all()
    assert np.isfinite(stack.now.setpoint).all()
    for name, value in params.values().items():
        assert params.specs[name].accepted(value) == value
    assert world.engine.stack.ground.forward_backlog <= MAX_TO_FORWARD
    places = stack.places
    assert all(math.isfinite(number) for number in places.home_point)
    assert stack.now.progress.current <= len(stack.parts.mission.items)


def answers(world: World, link: Link, now_s: float) -> set[str]:
    """Return the types of messages that a client receives which requests AUTOPILOT_VERSION."""
    request = mavlink.MAVLink_command_long_message(
        world.engine.config.system_id, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0
    )
    address = PeerAddress(GROUND, "192.0.2.99", 99)
    now_s += 100.0  # transactions of others have timed out
    kinds: set[str] = set()
    for _ in range(20):
        for message in (mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), request):
            world.engine.stack.ground.receive(address, link.encode(message), now_s)
        for peer, frame in world.engine.stack.ground.poll(now_s):
            if peer == address:
                kinds.update(message.get_type() for message in link.decode(frame))
        if "AUTOPILOT_VERSION" in kinds:
            break
        now_s += 0.1
    return kinds


def simulator(script: bytes) -> int:
    """The vehicle's end of the simulator link."""
    stack = SimulatorEndpoint(VEHICLE, DEFAULT_HOME, lockstep=True)
    commands, arrivals = np.full(8, 100.0), 0
    for step in steps(script):
        for piece in step.pieces:
            stack.receive(memoryview(piece))
            arrivals += 1
            assert stack.finder.partial_size <= LARGEST_FRAME
            assert stack.freshness(stack.time_us).age_us >= 0
            if stack.has_state:
                assert len(bytes(stack.answer(commands, armed=True))) <= LARGEST_FRAME
    return arrivals


def bridge(script: bytes) -> int:
    """The simulator's end of the simulator link; the plant flies on what it is told."""
    end = FlightStackEndpoint(Simulator(VEHICLE, "rigid", PlantOptions()), VEHICLE, DEFAULT_HOME)
    arrivals = 0
    for step in steps(script):
        for piece in step.pieces:
            end.receive(memoryview(piece))
            arrivals += 1
            assert end.finder.partial_size <= LARGEST_FRAME
            assert len(end.replies()) <= MOST_STEPS
        end.state()
        try:
            end.step()
        except PlantDivergedError:  # its right, with impossible commands
            break
    return arrivals


def session(script: bytes) -> int:
    """The ground station's session, with the client that the first octet names, until that one ends."""
    station = Session(record=lambda _frame: None)
    here = ("192.0.2.1", 18570)
    station.receive(Link(1, 1).encode(HEARTBEAT), here, 0.0)
    service = SERVICES[(script[0] if script else 0) % len(SERVICES)]()
    station.use(service)
    now_s, arrivals = 0.0, 0
    station.poll(now_s)
    for step in steps(script[1:], ((1, 1), (1, 1), (1, 1), (1, 2))):
        now_s += step.pause_s
        for piece in step.pieces:
            station.receive(piece, here, now_s)
            arrivals += 1
        assert len(station.poll(now_s)) < 500
    while getattr(service, "result", None) is None and now_s < 1_000.0:
        now_s += 0.5
        station.poll(now_s)
    assert getattr(service, "result", None) is not None
    return arrivals


TARGETS: dict[str, Callable[[bytes], int]] = {
    "hub": hub, "simulator": simulator, "bridge": bridge, "session": session,
}  # fmt: skip
