"""Exchanges of the simulator without Python: those of the codecs, and all else is left to Python as it came.

Both ends are sockets that keep messages apart, so that the test can write several of them ahead.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import pytest

from flightstack.core.compiled import IS_DISABLED
from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.link import Link
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import LOCKSTEP_FLAG, ActuatorsFrame
from flightstack.simulator_link.sensor_frames import HIL_SENSOR_ID
from flightstack.transports.compiled_socket import IS_AVAILABLE
from flightstack.transports.tcp import wait_in_kernel
from sim_bridge.errors import PlantDivergedError
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.server.quiet_exchanges import QuietExchanges
from sim_bridge.simulator import Simulator
from tests.support.inertial_sensors import x_quad_with_imus
from tests.support.message_sockets import fill, messages, socket_pair

pytestmark = pytest.mark.skipif(IS_DISABLED or not IS_AVAILABLE, reason="needs compiled code on Linux")

HOME = GeoPoint(47.397742, 8.545594, 488.0)


@pytest.fixture
def sockets() -> Iterator[tuple[socket.socket, socket.socket]]:
    """The end of the kernel, and that of the test."""
    with socket_pair() as pair:
        yield pair


class Served:
    """A simulator's end of the link. ``end`` is the socket of its kernel, None to use the codecs alone."""

    def __init__(self, vehicle: Any, requests: tuple[int, ...], end: socket.socket | None) -> None:
        self.simulator = Simulator(vehicle)
        self.link = FlightStackEndpoint(self.simulator, vehicle, HOME)
        codec = Link(1, 1)
        for message_id in requests:
            request = mavlink.MAVLink_command_long_message(0, 0, 511, 0, message_id, 2000, 0, 0, 0, 0, 0)
            self.link.receive(memoryview(codec.encode(request)))
        self.link.replies()
        self.quiet = None if end is None else QuietExchanges(self.link, end.fileno())
        self.exchange(answer(0))

    def exchange(self, data: bytes) -> bytes:
        """Exchange by the codecs; return the bytes of the next state."""
        if not self.link.is_sent:
            self.link.state()
        self.link.receive(memoryview(data))
        self.link.step()
        return bytes(self.link.state())


def answer(time_us: int, flags: int = LOCKSTEP_FLAG, rotors: int = 4) -> bytes:
    frame = ActuatorsFrame()
    frame.set_rotor_count(rotors)
    frame.rotor_speed_rad_s[:rotors] = 300.0
    return bytes(frame.seal(time_us, flags))


@pytest.mark.parametrize("kind", ["truth", "sensors", "two sensors"])
def test_a_simulator_sends_the_bytes_of_the_codecs(kind: str, tmp_path: Any, sockets: Any) -> None:
    ours, others = sockets
    vehicle = load_vehicle(x_quad_with_imus(tmp_path) if kind == "two sensors" else "x_quad")
    requests = (FS_PLANT_STATE_ID,) if kind == "truth" else (FS_PLANT_STATE_ID, HIL_SENSOR_ID)
    quiet, codec = Served(vehicle, requests, ours), Served(vehicle, requests, None)
    steps = reports = 0
    for _ in range(40):
        count = min(quiet.quiet.room(), 50)  # messages that fit into the socket's buffer
        if count == 0:
            assert quiet.exchange(answer(quiet.simulator.time_us)) == codec.exchange(
                answer(codec.simulator.time_us)
            )
            continue
        times_us = [quiet.simulator.time_us + 2000 * k for k in range(count)]
        for time_us in times_us:
            others.send(answer(time_us))
        before = quiet.quiet.count
        quiet.quiet.run(count)
        assert quiet.quiet.count - before == count
        sent = messages(others)
        assert sent == [codec.exchange(answer(time_us)) for time_us in times_us]
        reports += sum(data[7] == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS for data in sent)
        assert not quiet.quiet.unsent
        assert quiet.quiet.received is None
        assert quiet.simulator.time_us == codec.simulator.time_us
        steps += count
    assert steps > 200
    assert reports > 1


ANSWERS = {
    "another time": answer(0),
    "its own clock": answer(2000, 0),
    "six rotors": answer(2000, rotors=6),
    "a byte more": answer(2000) + b"\xfd",
    "twice": answer(2000) * 2,
    "a byte less": answer(2000)[:-1],
    "a changed byte": answer(2000)[:30] + b"\xaa" + answer(2000)[31:],
    "a heartbeat": Link(1, 1).encode(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3)),
}


@pytest.mark.parametrize("how", ANSWERS)
def test_other_answers_are_left_to_python_as_they_came(how: str, sockets: Any) -> None:
    ours, others = sockets
    served = Served(load_vehicle("x_quad"), (FS_PLANT_STATE_ID,), ours)
    assert served.simulator.time_us == 2000
    count = served.quiet.room()
    before = bytes(served.link.actuators.frame)
    others.send(ANSWERS[how])
    served.quiet.run(count)
    assert served.quiet.count == 0
    assert served.quiet.received == ANSWERS[how]
    assert bytes(served.link.actuators.frame) == before
    assert messages(others) == []


def test_exchanges_wait_for_replies_and_for_the_next_state(sockets: Any) -> None:
    ours, _ = sockets
    served = Served(load_vehicle("x_quad"), (FS_PLANT_STATE_ID,), ours)
    assert served.quiet.room() > 40
    inject = mavlink.MAVLink_command_long_message(0, 0, 420, 0, 100, 1, 1, 0, 0, 0, 0)  # a motor off
    served.link.receive(memoryview(Link(1, 1).encode(inject)))
    assert served.quiet.room() == 0  # its reply waits
    served.link.replies()
    served.link.receive(memoryview(answer(2000)))
    assert served.quiet.room() == 0  # the state is answered


def test_a_plant_that_diverges_ends_the_exchanges(sockets: Any) -> None:
    ours, others = sockets
    served = Served(load_vehicle("x_quad"), (FS_PLANT_STATE_ID,), ours)
    count = 50
    assert served.quiet.room() > count
    served.simulator.plant.memory[0]["body"][10] = 1e9
    for k in range(count):
        others.send(answer(2000 + 2000 * k))
    with pytest.raises(PlantDivergedError, match=r"the plant diverged at t=0\.00"):
        served.quiet.run(count)


def test_the_rest_of_a_state_that_is_not_accepted_is_left_to_python() -> None:
    ours, others = socket.socketpair()
    wait_in_kernel(ours)
    with ours, others:
        served = Served(load_vehicle("x_quad"), (FS_PLANT_STATE_ID,), ours)
        fill(ours)
        others.send(answer(2000))
        served.quiet.run(served.quiet.room())
        assert served.quiet.count == 1
        assert served.quiet.unsent == bytes(served.simulator.frame.frame)
