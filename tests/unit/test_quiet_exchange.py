"""Exchanges without Python: those of the codecs, and all else is left to Python as it came.

Both ends are sockets that keep messages apart, so that the test can write several of them ahead.
"""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest

from flightstack.core.compiled import IS_DISABLED
from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER_V2, FrameFinder
from flightstack.mavlink.link import Link
from flightstack.params.vehicle import load_vehicle
from flightstack.process.exchange_kernel import exchange
from flightstack.process.quiet_exchange import ExchangedSteps
from flightstack.simulator_link.hot_frames import LOCKSTEP_FLAG, ActuatorsFrame
from flightstack.simulator_link.sensor_frames import BARO, HIL_GPS_ID, HIL_SENSOR_ID, MAG
from flightstack.testing import World
from flightstack.transports.compiled_socket import IS_AVAILABLE
from flightstack.transports.tcp import wait_in_kernel
from sim_bridge.errors import PlantDivergedError
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.server.quiet_exchanges import QuietExchanges
from sim_bridge.simulator import Simulator
from tests.support.bytes_engine import BytesEngine
from tests.support.inertial_sensors import x_quad_with_imus
from tests.support.message_sockets import messages, socket_pair

pytestmark = pytest.mark.skipif(IS_DISABLED or not IS_AVAILABLE, reason="needs compiled code on Linux")

HOME = GeoPoint(47.397742, 8.545594, 488.0)
ARMED_IN_LOCKSTEP = 7
LATER_NS = 1 << 62


@pytest.fixture
def sockets() -> Iterator[tuple[socket.socket, socket.socket]]:
    """The end of the kernel, and that of the test."""
    with socket_pair() as pair:
        yield pair


def fill(end: socket.socket) -> None:
    """Send until nothing more is accepted."""
    with contextlib.suppress(BlockingIOError):
        while True:
            end.send(bytes(100_000), socket.MSG_DONTWAIT)


# ---------------------------------------------------------------------- the flight stack


class Vehicle:
    """A vehicle in a world, whose simulator's bytes the test sends."""

    def __init__(self, world: World, end: socket.socket) -> None:
        self.engine, self.stack = world.engine, world.engine.stack
        self.simulator = world.engine.simulator
        self.steps = ExchangedSteps(self.stack, end.fileno())
        self.steps.commands[:4] = 400.0
        self.steps.begin(time.monotonic_ns(), LATER_NS)

    def next_state(self) -> bytes:
        """Advance the simulator; return its bytes."""
        self.simulator.apply(self.engine.actuators)
        return bytes(self.simulator.outgoing())

    def exchange(self) -> int:
        return exchange(self.steps.world, self.simulator.time_us, ARMED_IN_LOCKSTEP)

    def taken(self) -> list[bytes]:
        """What a step writes."""
        steps, plant = self.steps, self.stack.simulator.plant
        return [bytes(plant.frame), *(array.tobytes() for array in (steps.wires, steps.values, steps.news))]


def worlds(tmp_path: Any) -> dict[str, dict[str, Any]]:
    return {
        "truth": {"state": "truth"},
        "sensors": {"state": "estimated"},
        "two sensors": {"state": "estimated", "vehicle": x_quad_with_imus(tmp_path)},
    }


@pytest.mark.parametrize("kind", ["truth", "sensors", "two sensors"])
def test_quiet_states_are_taken_and_answered(kind: str, tmp_path: Any, sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, **worlds(tmp_path)[kind]) as world:
        world.run_for(1.5)  # to an origin: fixes are taken
        vehicle, quiet, news = Vehicle(world, ours), 0, set()
        for _ in range(120):
            data = vehicle.next_state()
            others.send(data)
            is_plain = ids_of(data) <= {FS_PLANT_STATE_ID, HIL_SENSOR_ID, HIL_GPS_ID}
            assert vehicle.exchange() == (0 if is_plain else -1)
            (answer,) = messages(others)
            expected = ActuatorsFrame()
            assert expected.open(answer)
            assert expected.time_us == vehicle.simulator.time_us - 2000
            assert expected.flags == ARMED_IN_LOCKSTEP
            assert expected.rotor_speed_rad_s.tolist() == vehicle.steps.commands.tolist()
            if not is_plain:
                assert vehicle.steps.socket.received == data
                vehicle.steps.socket.clear()
                continue
            quiet += 1
            assert bytes(vehicle.stack.simulator.plant.frame) == bytes(vehicle.simulator.frame.frame)
            news.add(vehicle.steps.news[0].item())
            if (sensors := vehicle.simulator.sensors) is not None:
                assert vehicle.steps.wires.tobytes() == b"".join(wire.tobytes() for wire in sensors.imu_wires)
                assert vehicle.steps.values.tobytes() == sensors.values.tobytes()
                fields = sensors.measurements[0].fields
                has_mag, has_baro, has_gnss = vehicle.steps.news[0].item()
                assert (has_mag, has_baro) == (fields & MAG == MAG, fields & BARO == BARO)
                assert has_gnss == (HIL_GPS_ID in ids_of(data))
                if has_gnss:
                    assert vehicle.steps.gps.tobytes().rstrip(b"\x00") == gps_payload(data)
        assert quiet > 100
        assert len(news) == (1 if kind == "truth" else 4)
        assert len(vehicle.steps.took_ns) == 120


def ids_of(data: bytes) -> set[int]:
    """The ids of the messages in ``data``."""
    return {message.get_msgId() for message in Link(1, 200).decode(data)}


def test_a_fix_before_the_origin_is_left_to_python(sockets: Any) -> None:
    """Which decides whether it is good enough to start from."""
    ours, others = sockets
    with World(make_engine=BytesEngine) as world:
        world.run_for(0.5)
        vehicle = Vehicle(world, ours)
        taken = {}
        for _ in range(60):
            data = vehicle.next_state()
            others.send(data)
            has_fix = HIL_GPS_ID in ids_of(data)
            taken.setdefault(has_fix, set()).add(vehicle.exchange() == 0)
            vehicle.steps.socket.clear()
            messages(others)
        assert taken == {True: {False}, False: {True}}


def gps_payload(data: bytes) -> bytes:
    """The payload of HIL_GPS in ``data``."""
    (frame,) = (bytes(one) for one in FrameFinder().find(memoryview(data)) if one[7] == HIL_GPS_ID)
    return frame[HEADER_V2:-CHECKSUM_SIZE]


def altered(data: bytes, how: str) -> bytes:
    """The bytes of a state and its sensors, not quite as they are expected."""
    state, sensor = data[:158], data[158:]
    heartbeat = Link(1, 1).encode(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3))
    return {
        "a message before": heartbeat + data,
        "a message after": data + heartbeat,
        "a byte more": data + b"\xfd",
        "a byte less": data[:-1],
        "without sensors": state,
        "sensors alone": sensor,
        "in another order": sensor + state,
        "twice": data + data,
        "a changed byte": data[:40] + bytes([data[40] ^ 1]) + data[41:],
        "a changed byte of the sensor": data[:-20] + bytes([data[-20] ^ 1]) + data[-19:],
        "junk": bytes(range(256)),
    }[how]


HOWS = (
    "a message before", "a message after", "a byte more", "a byte less", "without sensors", "sensors alone",
    "in another order", "twice", "a changed byte", "a changed byte of the sensor", "junk",
)  # fmt: skip


@pytest.mark.parametrize("how", HOWS)
def test_other_bytes_are_left_to_python_as_they_came(how: str, sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="estimated") as world:
        world.run_for(0.11)
        vehicle = Vehicle(world, ours)
        data = altered(vehicle.next_state(), how)
        before = vehicle.taken()
        others.send(data)
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.received == data
        assert vehicle.taken() == before
        assert len(messages(others)) == 1  # the answer was sent


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_measurement_that_is_not_finite_is_left_to_python(value: float, sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="estimated") as world:
        world.run_for(0.11)
        vehicle = Vehicle(world, ours)
        vehicle.simulator.apply(vehicle.engine.actuators)
        vehicle.simulator.sensors.imu_wires[0][4] = value
        data = bytes(vehicle.simulator.outgoing())
        before = vehicle.taken()
        others.send(data)
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.received == data
        assert vehicle.taken() == before


def test_a_state_of_another_time_is_left_to_python(sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        world.run_for(0.11)
        vehicle = Vehicle(world, ours)
        vehicle.next_state()
        data = vehicle.next_state()
        others.send(data)
        assert exchange(vehicle.steps.world, vehicle.simulator.time_us - 2000, ARMED_IN_LOCKSTEP) == -1
        assert vehicle.steps.socket.received == data


def test_silence_a_closed_connection_and_a_deadline_are_left_to_python(sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        vehicle = Vehicle(world, ours)
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.received is None
        assert vehicle.steps.socket.sent == len(messages(others)[0])
        vehicle.steps.begin(time.monotonic_ns(), time.monotonic_ns())
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.sent == -1
        assert messages(others) == []
        vehicle.steps.begin(time.monotonic_ns(), LATER_NS)
        others.shutdown(socket.SHUT_WR)
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.received == b""


def test_a_deadline_ends_no_outer_period(sockets: Any) -> None:
    """A call that goes on begins with an outer tick, which needs no tick in Python before it."""
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        vehicle = Vehicle(world, ours)  # before the first tick, an outer one; each fifth is
        vehicle.steps.begin(time.monotonic_ns(), 0)
        for _ in range(4):
            others.send(vehicle.next_state())
            assert vehicle.exchange() == 0
        vehicle.next_state()
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.sent == -1
        assert len(messages(others)) == 4


def test_the_rest_of_an_answer_that_is_not_accepted_is_left_to_python() -> None:
    ours, others = socket.socketpair()
    wait_in_kernel(ours)
    with World(make_engine=BytesEngine, state="truth") as world, ours, others:
        vehicle = Vehicle(world, ours)
        fill(ours)
        assert vehicle.exchange() == -1
        assert (vehicle.steps.socket.sent, vehicle.steps.socket.received) == (0, None)


# ---------------------------------------------------------------------- the simulator


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
    vehicle = load_vehicle(worlds(tmp_path)[kind].get("vehicle", "x_quad"))
    requests = (FS_PLANT_STATE_ID,) if kind == "truth" else (FS_PLANT_STATE_ID, HIL_SENSOR_ID)
    quiet, codec = Served(vehicle, requests, ours), Served(vehicle, requests, None)
    steps = 0
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
        assert messages(others) == [codec.exchange(answer(time_us)) for time_us in times_us]
        assert not quiet.quiet.unsent
        assert quiet.quiet.received is None
        assert quiet.simulator.time_us == codec.simulator.time_us
        steps += count
    assert steps > 200


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
    count = served.quiet.room()
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
