"""Scripts to begin with: what real clients and a real vehicle say, and one of every message."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.hot_frames import ActuatorsFrame
from flightstack.testing.engine import Engine
from gcs_cli.link.session import Service, Session
from tests.fuzz.clients import SERVICES
from tests.fuzz.inputs import KINDS
from tests.fuzz.memory_logs import MemoryLogs
from tests.fuzz.script import Style, of_frames, restyled, written
from tests.support.tools import NIGHTLY
from tests.support.truth import World

_HERE = ("192.0.2.1", 18570)


def conversation(make: Callable[[], Service]) -> tuple[list[bytes], list[bytes]]:
    """Let a client do its work with a vehicle; return the frames of the client and of the vehicle."""
    world, session = World(make_engine=partial(Engine, flight_logs=MemoryLogs(0, 300, 5_000))), Session()
    session.receive(Link(1, 1).encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)), _HERE, 0.0)
    service = make()
    session.use(service)
    said: list[bytes] = []
    answered: list[bytes] = []
    for moment in range(400):
        now_s = moment * 0.01
        for frame in session.poll(now_s):
            said.append(frame)
            world.engine.stack.ground.receive(world.gcs.address, frame, now_s)
        for _, frame in world.engine.stack.ground.poll(now_s):
            answered.append(frame)
            session.receive(frame, _HERE, now_s)
        if getattr(service, "result", None) is not None:
            break
    return said, answered


def every_message() -> list[bytes]:
    """Return scripts of all messages, each with zeros for everyone, then with ones.

    Eight messages share a script, for which a vehicle is made; with NIGHTLY=1 each has its own.
    """
    messages = [
        bytes((Style.FRAME, number, 1, 0, Style.FRAME, number, 255)) + b"\1" * 255
        for number in range(len(KINDS))
    ]
    together = 1 if NIGHTLY else 8
    return [b"".join(messages[at : at + together]) for at in range(0, len(messages), together)]


def commands() -> list[bytes]:
    """Return scripts of the commands that fly."""
    scripts = []
    for number in (
        400,
        22,
        21,
        20,
        176,
        192,
        193,
        300,
        178,
        179,
        185,
        511,
        512,
        246,
        245,
        420,
        2510,
        2511,
        241,
    ):
        long = mavlink.MAVLink_command_long_message(1, 1, number, 0, 1, 4, 3, 0, 0, 0, 10)
        whole = mavlink.MAVLink_command_int_message(
            1, 1, 6, number, 0, 0, 1, 4, 3, 0, 473977418, 85455938, 10
        )
        scripts.append(written([long, whole]))
    return scripts


def hub_scripts() -> list[bytes]:
    """Return scripts for the vehicle's ground links: as they are, signed, and while it flies."""
    plain = [of_frames(conversation(make)[0][:64]) for make in SERVICES] + commands() + every_message()
    signed = [b"\1" + restyled(script, Style.SIGNED) for script in plain[: len(SERVICES) + 3]]
    return [b"\0" + script for script in plain] + signed + [b"\2" + script for script in plain[:30]]


def session_scripts() -> list[bytes]:
    """Return scripts for the ground station: for each client, what the vehicle answers it."""
    scripts = []
    for index, make in enumerate(SERVICES):
        scripts.append(bytes((index,)) + of_frames(conversation(make)[1][:64]))
    return scripts + [b"\0" + script for script in every_message()]


def simulator_scripts() -> list[bytes]:
    """Return scripts for the vehicle's end of the simulator link."""
    world = World()
    frames = []
    for _ in range(20):
        frames.append(bytes(world.engine.simulator.outgoing()))
        world.tick()
    return [of_frames(_cut(frames)), *every_message()]


def bridge_scripts() -> list[bytes]:
    """Return scripts for the simulator's end."""
    stack = SimulatorEndpoint(load_vehicle("x_quad"), World().engine.config.home, lockstep=True)
    actuators = ActuatorsFrame()
    actuators.set_rotor_count(4)
    actuators.rotor_speed_rad_s[:4] = 200.0
    frames = [stack.initial_requests(4_000), *(bytes(actuators.seal(4_000 * n, 4)) for n in range(20))]
    slow = [stack.fallback_request(4_000), stack.failure_request(0, 1, 1)]
    return [of_frames(_cut(frames)), of_frames(_cut(slow)), *every_message()]


def _cut(data: list[bytes]) -> list[bytes]:
    """Return the frames of pieces that may hold several."""
    link = Link(0, 0)
    return [bytes(message.get_msgbuf()) for piece in data for message in link.decode(piece)]


SCRIPTS: dict[str, Callable[[], list[bytes]]] = {
    "hub": hub_scripts, "simulator": simulator_scripts, "bridge": bridge_scripts, "session": session_scripts,
}  # fmt: skip
