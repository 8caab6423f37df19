"""Exchanges of the flight stack without Python: those of the codecs, and all else is left to Python as it came.

Both ends are sockets that keep messages apart, so that the test can write several of them ahead.
"""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest

from flightstack.core.compiled import IS_DISABLED
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER_V2, FrameFinder
from flightstack.mavlink.link import Link
from flightstack.process.connections import PAUSE_NS
from flightstack.process.exchange_kernel import exchange
from flightstack.process.quiet_exchange import ExchangedSteps, Span
from flightstack.simulator_link.battery_frame import BatteryReport, decode_battery, encode_battery
from flightstack.simulator_link.hot_frames import ActuatorsFrame
from flightstack.simulator_link.sensor_frames import BARO, HIL_GPS_ID, HIL_SENSOR_ID, MAG
from flightstack.testing import World
from flightstack.transports.compiled_socket import IS_AVAILABLE
from flightstack.transports.tcp import wait_in_kernel
from tests.support.bytes_engine import BytesEngine
from tests.support.inertial_sensors import x_quad_with_imus
from tests.support.message_sockets import fill, messages, socket_pair

pytestmark = pytest.mark.skipif(IS_DISABLED or not IS_AVAILABLE, reason="needs compiled code on Linux")

ARMED_IN_LOCKSTEP = 7
LATER_NS = 1 << 62


@pytest.fixture
def sockets() -> Iterator[tuple[socket.socket, socket.socket]]:
    """The end of the kernel, and that of the test."""
    with socket_pair() as pair:
        yield pair


class Vehicle:
    """A vehicle in a world, whose simulator's bytes the test sends."""

    def __init__(self, world: World, end: socket.socket) -> None:
        self.engine, self.stack = world.engine, world.engine.stack
        self.simulator = world.engine.simulator
        self.steps = ExchangedSteps(self.stack, end.fileno())
        self.steps.commands[:4] = 400.0
        self.steps.begin(Span(time.monotonic_ns(), LATER_NS))

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
        vehicle.steps.begin(Span(time.monotonic_ns(), time.monotonic_ns()))
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.sent == -1
        assert messages(others) == []
        vehicle.steps.begin(Span(time.monotonic_ns(), LATER_NS))
        others.shutdown(socket.SHUT_WR)
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.received == b""


@pytest.mark.parametrize("state", ["truth", "estimated"])
def test_reports_of_the_battery_are_taken(state: Any, sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state=state) as world:
        world.run_for(1.6)
        vehicle, expected = Vehicle(world, ours), []
        for _ in range(600):
            data = vehicle.next_state()
            others.send(data)
            assert vehicle.exchange() == 0
            messages(others)
            if data[7] == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS:
                report = decode_battery(data[: HEADER_V2 + data[1] + CHECKSUM_SIZE])
                expected.append((vehicle.simulator.time_us, report))
        assert len(expected) > 1
        assert vehicle.steps.take_reports() == expected
        assert vehicle.steps.take_reports() == []


REPORT = BatteryReport(0, (3900,) * 3 + (0xFFFF,) * 7 + (0,) * 4, 1250, 100, 4, 64)
LEFT_REPORTS = {
    "low": REPORT._replace(remaining_percent=31),
    "unknown": REPORT._replace(remaining_percent=-1),
    "another battery": REPORT._replace(number=1),
}


@pytest.mark.parametrize("how", LEFT_REPORTS)
def test_reports_that_the_vehicle_may_act_on_are_left_to_python(how: str, sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        world.run_for(0.11)
        vehicle = Vehicle(world, ours)
        vehicle.steps.record["least_charge"] = 0.31
        before = vehicle.taken()
        data = encode_battery(LEFT_REPORTS[how], 0, 1, 200) + vehicle.next_state()
        others.send(data)
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.received == data
        assert vehicle.taken() == before
        assert vehicle.steps.take_reports() == []


def test_more_reports_than_a_call_keeps_are_left_to_python(sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        world.run_for(0.11)
        vehicle, results = Vehicle(world, ours), []
        for _ in range(10):
            others.send(encode_battery(REPORT, 0, 1, 200) + vehicle.next_state())
            results.append(vehicle.exchange())
        assert results == [0] * 8 + [-1] * 2
        assert [report for _, report in vehicle.steps.take_reports()] == [REPORT] * 8


def test_silence_in_an_expected_pause_is_left_to_python(sockets: Any) -> None:
    ours, others = sockets
    ours.settimeout(None)  # a wait in ``recv`` would not end
    with World(make_engine=BytesEngine, state="truth") as world:
        vehicle = Vehicle(world, ours)
        vehicle.steps.begin(Span(time.monotonic_ns(), LATER_NS, ends_in_pause=True))
        others.send(vehicle.next_state())
        assert vehicle.exchange() == 0
        vehicle.next_state()
        assert vehicle.exchange() == -1
        assert vehicle.steps.socket.received is None
        assert vehicle.steps.socket.sent == len(messages(others)[1])
        assert vehicle.steps.record["waited_ns"][0] >= PAUSE_NS


def test_the_pauses_of_a_call_are_summed(sockets: Any) -> None:
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        vehicle, sums_ns = Vehicle(world, ours), [0]
        for pause_ns in (0, 0, PAUSE_NS << 20):
            vehicle.steps.record["pause_ns"] = pause_ns
            others.send(vehicle.next_state())
            assert vehicle.exchange() == 0
            sums_ns.append(int(vehicle.steps.record["waited_ns"][0]))
        assert 0 < sums_ns[1] < sums_ns[2] == sums_ns[3]


def test_a_deadline_ends_no_outer_period(sockets: Any) -> None:
    """A call that goes on begins with an outer tick, which needs no tick in Python before it."""
    ours, others = sockets
    with World(make_engine=BytesEngine, state="truth") as world:
        vehicle = Vehicle(world, ours)  # before the first tick, an outer one; each fifth is
        vehicle.steps.begin(Span(time.monotonic_ns(), 0))
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
