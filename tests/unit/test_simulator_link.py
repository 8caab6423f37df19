"""The simulator link without I/O: requests, lockstep, stale answers, third-party messages, junk."""

from __future__ import annotations

import math
import struct
from random import Random

import pytest
from fastcrc import crc16
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, FsActuators, mavlink
from flightstack.mavlink.link import Link
from flightstack.mavlink.signing import LinkSigning, Signing
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG, ActuatorsFrame
from sim_bridge.errors import PlantDivergedError
from sim_bridge.server.endpoint import HIL_STATE_QUATERNION_ID, FlightStackEndpoint
from sim_bridge.simulator import Simulator

PAPER = load_vehicle("paper_quad")
HOME = GeoPoint(47.397742, 8.545594, 488.0)


class Client:
    """A flight stack's end of the link, by pymavlink's codec."""

    def __init__(self) -> None:
        self.sim = FlightStackEndpoint(Simulator(PAPER), PAPER, HOME)
        self.codec = Link(1, 1)

    def send(self, *messages) -> None:
        self.sim.receive(memoryview(b"".join(self.codec.encode(message) for message in messages)))

    def request(self, message_id: float, interval_us: float) -> int:
        self.send(mavlink.MAVLink_command_long_message(0, 0, 511, 0, message_id, interval_us, 0, 0, 0, 0, 0))
        (reply,) = self.sim.replies()
        (ack,) = self.codec.decode(reply)
        assert (ack.get_type(), ack.command, ack.target_system) == ("COMMAND_ACK", 511, 1)
        return ack.result

    def state(self):
        """The state; a due battery report precedes it, and sensors may follow."""
        sent = {one.get_type(): one for one in self.codec.decode(bytes(self.sim.state()))}
        (name,) = {"FS_PLANT_STATE", "HIL_STATE_QUATERNION"} & set(sent)
        return sent[name]


def actuators(
    time_us: int, speed: float = 200.0, flags: int = ARMED_FLAG | LOCKSTEP_FLAG, count: int = 4
) -> bytes:
    frame = ActuatorsFrame()
    frame.rotor_speed_rad_s[:4] = speed
    frame.set_rotor_count(count)
    return bytes(frame.seal(time_us, flags))


@pytest.fixture
def client() -> Client:
    return Client()


def test_nothing_moves_before_a_request(client: Client) -> None:
    client.sim.receive(memoryview(actuators(0)))
    assert not client.sim.ready
    assert not client.sim.answered


@pytest.mark.parametrize(
    ("message_id", "interval_us", "result"),
    [
        (53000, 2000, 0), (53000, 50, 0), (53000, 1e6, 0), (53000, 3333.3, 0), (53000, 0, 0), (115, 5000, 0),
        (53000, 49, 2), (53000, 1.1e6, 2), (53000, math.nan, 2), (53000, -7, 2), (53000, math.inf, 2),
        (30, 2000, 2), (math.nan, 2000, 2),
    ],
)  # fmt: skip
def test_requests_are_answered(client: Client, message_id: float, interval_us: float, result: int) -> None:
    assert client.request(message_id, interval_us) == result
    assert client.sim.ready == (result == 0)
    if result == 0 and interval_us:
        assert client.sim.simulator.interval_us == round(interval_us)


def test_plant_state_has_priority_over_hil_state(client: Client) -> None:
    assert client.request(HIL_STATE_QUATERNION_ID, 4000) == 0
    assert client.request(FS_PLANT_STATE_ID, 2000) == 0
    assert client.request(HIL_STATE_QUATERNION_ID, 4000) == mavlink.MAV_RESULT_DENIED
    assert client.state().get_type() == "FS_PLANT_STATE"
    assert client.sim.simulator.interval_us == 2000


def test_other_commands_are_unsupported(client: Client) -> None:
    client.send(mavlink.MAVLink_command_long_message(0, 0, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    (ack,) = client.codec.decode(client.sim.replies()[0])
    assert ack.result == mavlink.MAV_RESULT_UNSUPPORTED


def test_request_can_be_withdrawn(client: Client) -> None:
    assert client.request(53000, 2000) == 0
    assert client.request(53000, -1) == 0
    assert not client.sim.ready


def test_lockstep_takes_only_the_answer_of_the_same_time(client: Client) -> None:
    client.request(FS_PLANT_STATE_ID, 2000)
    sim = client.sim
    assert client.state().time_us == 0
    sim.receive(memoryview(actuators(0)))
    sim.step()
    assert client.state().time_us == 2000
    for stale in (0, 4000):
        sim.receive(memoryview(actuators(stale, 100.0)))
    assert (sim.answered, sim.stale) == (False, 2)
    sim.receive(memoryview(actuators(2000, 300.0) + actuators(2000, 100.0) + actuators(0, 100.0)))
    assert (sim.answered, sim.stale) == (True, 4)
    assert sim.actuators.rotor_speed_rad_s[0] == 300.0


@pytest.mark.parametrize("cut", range(1, 92, 9))
def test_frames_may_be_cut_anywhere(client: Client, cut: int) -> None:
    client.request(FS_PLANT_STATE_ID, 2000)
    client.sim.state()
    heartbeat = client.codec.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
    data = heartbeat + actuators(0)
    client.sim.receive(memoryview(data[:cut]))
    assert not client.sim.answered
    client.sim.receive(memoryview(data[cut:]))
    assert client.sim.answered
    assert client.sim.bad == 0


def test_truncated_and_general_frames_are_understood(client: Client) -> None:
    client.request(FS_PLANT_STATE_ID, 2000)
    client.sim.state()
    client.codec = Link(1, 1, signing=LinkSigning(Signing(b"k" * 32, lambda: 1.8e9), 0))
    client.send(FsActuators(0, [250.0] * 4 + [0.0] * 4, 4, ARMED_FLAG | LOCKSTEP_FLAG | 1))
    assert client.sim.answered
    assert client.sim.actuators.rotor_speed_rad_s[3] == 250.0


def test_client_on_its_own_clock_is_never_waited_for(client: Client) -> None:
    client.request(FS_PLANT_STATE_ID, 2000)
    client.sim.state()
    client.sim.receive(memoryview(actuators(123, flags=ARMED_FLAG)))
    assert client.sim.free_running
    assert client.sim.stale == 0
    client.sim.receive(
        memoryview(actuators(124, 300.0, flags=ARMED_FLAG) + actuators(125, 310.0, ARMED_FLAG))
    )
    assert client.sim.actuators.rotor_speed_rad_s[0] == 310.0


def test_wrong_rotor_count_is_a_fault(client: Client) -> None:
    client.request(FS_PLANT_STATE_ID, 2000)
    client.sim.receive(memoryview(actuators(0, count=6)))
    assert "commands 6 rotors" in (client.sim.error or "")


def test_poweroff_heartbeat_ends_the_link_in_both_directions(client: Client) -> None:
    client.send(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, mavlink.MAV_STATE_ACTIVE, 3))
    assert not client.sim.peer_ended
    client.send(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, mavlink.MAV_STATE_POWEROFF, 3))
    assert client.sim.peer_ended
    (goodbye,) = client.codec.decode(client.sim.poweroff())
    assert goodbye.system_status == mavlink.MAV_STATE_POWEROFF


def test_hil_state_has_the_specified_units(client: Client) -> None:
    client.request(HIL_STATE_QUATERNION_ID, 4000)
    message = client.state()
    assert (message.get_type(), message.time_usec) == ("HIL_STATE_QUATERNION", 0)
    assert (message.lat, message.lon, message.alt) == (473977420, 85455940, 488000)
    assert (message.xacc, message.yacc, message.zacc) == (0, 0, -1000)  # at rest, thousandths of gravity
    assert list(message.attitude_quaternion) == [1.0, 0.0, 0.0, 0.0]


def test_hil_controls_are_shares_of_thrust(client: Client) -> None:
    client.request(HIL_STATE_QUATERNION_ID, 4000)
    client.state()
    client.send(mavlink.MAVLink_hil_actuator_controls_message(0, [0.25, 1.0, 7.0, -1.0] + [0.0] * 12, 129, 1))
    full = PAPER.rotors[0].max_speed_rad_s
    assert client.sim.answered
    assert client.sim.actuators.flags & ARMED_FLAG
    assert client.sim.actuators.rotor_speed_rad_s[:4].tolist() == [0.5 * full, full, full, 0.0]
    client.sim.step()
    client.state()
    client.send(mavlink.MAVLink_hil_actuator_controls_message(4000, [math.nan] * 16, 1, 1))
    assert client.sim.answered
    assert not client.sim.actuators.flags & ARMED_FLAG
    client.sim.step()
    client.state()
    client.send(mavlink.MAVLink_hil_actuator_controls_message(1, [0.5] * 16, 129, 0))
    assert client.sim.free_running


@settings(max_examples=150)
@given(
    st.lists(st.one_of(st.binary(max_size=60), st.sampled_from([actuators(0), actuators(9)])), max_size=12)
)
def test_junk_never_raises(chunks: list[bytes]) -> None:
    client = Client()
    client.request(FS_PLANT_STATE_ID, 2000)
    for chunk in chunks:
        client.sim.receive(memoryview(chunk))
    client.sim.replies()
    client.sim.step()
    assert math.isfinite(client.sim.simulator.frame.state.sum())


def test_link_recovers_after_junk(client: Client) -> None:
    client.request(FS_PLANT_STATE_ID, 2000)
    client.sim.receive(memoryview(b"\x00\x01junk" * 50))
    client.sim.receive(memoryview(actuators(0)))
    assert client.sim.answered
    assert client.sim.bad > 0


# ---------------------------------------------------------------------- whatever arrives


@pytest.mark.parametrize("junk", [b"\xfd\xff\x00", b"\xfe\xff", b"\xfd\xff\x00" * 90, b"\xfd" * 500, b"junk"])
@pytest.mark.parametrize("pieces", [1, 2, 7])
def test_actuators_after_junk_are_handled(client: Client, junk: bytes, pieces: int) -> None:
    """In lockstep nothing follows them: actuators held back as part of junk would stop the exchange."""
    client.request(FS_PLANT_STATE_ID, 2000)
    for step in range(20):
        client.state()
        data = junk + actuators(2000 * step, 100.0 + step)
        size = -(-len(data) // pieces)
        for begin in range(0, len(data), size):
            client.sim.receive(memoryview(data[begin : begin + size]))
        assert client.sim.answered
        assert client.sim.actuators.rotor_speed_rad_s[0] == 100.0 + step
        client.sim.step()


MESSAGES = sorted(number for number in mavlink.mavlink_map if number >= 0)
FLOATS = [math.nan, math.inf, -math.inf, 3.4e38, -0.0, 1e-45]


def random_message(random: Random) -> bytes:
    """A frame with a right checksum and any payload: random bytes, or NaN and infinities in every float."""
    kind = mavlink.mavlink_map[random.choice([*MESSAGES, 76, 75, 93, FsActuators.id, 0])]
    size = struct.calcsize(kind.unpacker.format)
    payload = bytearray(random.randbytes(size))
    if random.random() < 0.5:
        at = 0
        for code, count in zip(kind.native_format.decode()[1:], (kind.lengths), strict=True):
            for _ in range(count):
                width = struct.calcsize("<" + code)
                if code in "fd":
                    struct.pack_into("<" + code, payload, at, random.choice(FLOATS))
                at += width
    if kind.id in (75, 76) and random.random() < 0.8:  # a supported command
        struct.pack_into("<H", payload, 28, random.choice([420, 511]))
    cut = bytes(payload).rstrip(b"\0") or b"\0"
    body = bytes([len(cut), 0, 0, random.randrange(256), 1, 1]) + kind.id.to_bytes(3, "little") + cut
    return b"\xfd" + body + crc16.mcrf4xx(body + bytes([kind.crc_extra])).to_bytes(2, "little")


def mangled(random: Random, frame: bytes) -> bytes:
    way = random.randrange(8)
    if way == 0:
        return frame[: random.randrange(len(frame))]
    if way == 1:
        return random.randbytes(random.randrange(400))
    if way == 2:
        at = random.randrange(len(frame))
        return frame[:at] + bytes([frame[at] ^ 1 << random.randrange(8)]) + frame[at + 1 :]
    return frame


@pytest.mark.parametrize("seed", range(4))
def test_random_input_neither_raises_nor_accumulates(seed: int) -> None:
    """10 000 inputs; after each batch the link still answers a request and accepts a lockstep answer."""
    random, raised_by = Random(seed), 0
    client = Client()
    for _ in range(50):
        for _ in range(50):
            client.sim.receive(memoryview(mangled(random, random_message(random))))
            client.sim.replies()
            client.sim.state()
            try:
                client.sim.step()
            except PlantDivergedError:  # absurd commands may end the flight with this error
                raised_by += 1
                client = Client()
        assert len(client.sim.simulator.faults) <= 4
        assert client.sim.finder.partial_size < 280
        client.codec = Link(1, 1)
        assert client.request(FS_PLANT_STATE_ID, 2000) == 0
        time_us = client.state().time_us
        client.sim.receive(memoryview(actuators(time_us)))
        assert client.sim.answered
        assert not client.sim.free_running
    assert raised_by < 10


def test_large_input_is_searched_completely(client: Client) -> None:
    client.request(FS_PLANT_STATE_ID, 2000)
    client.state()
    data = Random(5).randbytes(30_000) + b"\xfd\x22\x00" * 10_000 + actuators(0, 123.0)
    client.sim.receive(memoryview(data))
    assert client.sim.answered
    assert client.sim.actuators.rotor_speed_rad_s[0] == 123.0
