"""``gcs replay``: telemetry of a log on a clock of the test, and answers to clients."""

from __future__ import annotations

import math
import random
import re
import struct
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import pack_frame
from flightstack.mavlink.link import Link, Message
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.session import Session
from gcs_cli.link.tlog import decode_records, encode_record
from gcs_cli.logs.recording import ULOG, Recording, Topic
from gcs_cli.logs.tlog_reader import read_tlog
from gcs_cli.logs.ulog_reader import read_ulog
from gcs_cli.replay.keys import names_of
from gcs_cli.replay.playback import Playback, TlogPlayback
from gcs_cli.replay.replay_run import apply_keys
from gcs_cli.replay.replay_vehicle import ANSWERS, ReplayVehicle
from gcs_cli.replay.throttle import throttle_of
from gcs_cli.replay.ulog_playback import UlogPlayback
from tests.support.sample_logs import small_tlog, small_ulog

STATION = ("ground", ("127.0.0.1", 14550))
OTHER = ("ground", ("127.0.0.1", 50000))


@pytest.fixture(scope="module")
def tlog() -> Playback:
    return TlogPlayback(small_tlog(), (7, 1))


@pytest.fixture(scope="module")
def ulog() -> Playback:
    return UlogPlayback(read_ulog(small_ulog(), "flight.ulg"))


class Client:
    """A peer that decodes what the vehicle sends to it."""

    def __init__(self, vehicle: ReplayVehicle, place: tuple[str, tuple[str, int]] = STATION) -> None:
        self.vehicle, self.place = vehicle, place
        self.link = Link(255, 190)
        self.got: list[Message] = []

    def run(self, until_s: float, begin_s: float = 0.0, step_s: float = 0.02) -> None:
        for tick in range(round((until_s - begin_s) / step_s) + 1):
            for place, frame in self.vehicle.poll(begin_s + tick * step_s):
                if place == self.place:
                    self.got += self.link.decode(frame)

    def ask(self, message: Message, now_s: float = 0.0) -> list[Message]:
        """Send a message; return the answers."""
        self.vehicle.receive(self.link.encode(message), self.place, now_s)
        return [
            decoded
            for place, frame in self.vehicle.poll(now_s)
            if place == self.place
            for decoded in self.link.decode(frame)
        ]


def test_tlog_is_replayed_once_at_its_own_pace(tlog: Playback) -> None:
    client = Client(ReplayVehicle(tlog, [STATION], 0.0))
    client.run(2.0)
    counts = Counter(message.get_type() for message in client.got)
    assert counts["ATTITUDE"] == 20  # from 8 µs to 1.900008 s at 10 Hz
    assert counts["HEARTBEAT"] == 3
    assert {message.get_srcSystem() for message in client.got} == {7}
    client.run(tlog.duration_s + 0.1, begin_s=2.0)
    times = [message.time_boot_ms for message in client.got if message.get_type() == "ATTITUDE"]
    assert sorted(set(times)) == list(range(0, 4000, 100))
    assert client.vehicle.has_ended


def test_sequence_numbers_have_no_gaps(tlog: Playback) -> None:
    client = Client(ReplayVehicle(tlog, [STATION], 0.0))
    client.run(3.0)
    numbers = [message.get_seq() for message in client.got]
    assert numbers == [number % 256 for number in range(len(numbers))]


@pytest.mark.parametrize("speed", [0.5, 4.0])
def test_speed_changes_telemetry_and_not_heartbeats(tlog: Playback, speed: float) -> None:
    client = Client(ReplayVehicle(tlog, [STATION], 0.0, speed=speed))
    client.run(0.9)
    counts = Counter(message.get_type() for message in client.got)
    assert counts["LOCAL_POSITION_NED"] == pytest.approx(0.9 * speed * 10, abs=1)
    assert counts["HEARTBEAT"] == 1


def test_pause_keeps_heartbeats_and_state(tlog: Playback) -> None:
    vehicle = ReplayVehicle(tlog, [STATION], 0.0)
    client = Client(vehicle)
    client.run(1.0)
    apply_keys(vehicle, [" "])
    client.got.clear()
    client.run(6.0, begin_s=1.0)
    counts = Counter(message.get_type() for message in client.got)
    assert counts["HEARTBEAT"] == 5
    assert counts["ATTITUDE"] == 5
    assert vehicle.at_s == pytest.approx(1.0)
    apply_keys(vehicle, [" "])
    client.run(6.5, begin_s=6.0)
    assert vehicle.at_s == pytest.approx(1.5)


def test_seek_sends_the_state_at_once(tlog: Playback) -> None:
    vehicle = ReplayVehicle(tlog, [STATION], 0.0, begin_s=3.0)
    client = Client(vehicle)
    client.run(0.0)
    positions = [message for message in client.got if message.get_type() == "LOCAL_POSITION_NED"]
    assert [message.time_boot_ms for message in positions] == [2900]
    assert apply_keys(vehicle, ["left", "up", "up", "down"])
    assert (vehicle.at_s, vehicle.speed) == (0.0, 2.0)
    assert not apply_keys(vehicle, ["q"])


def test_keys_of_a_terminal_have_names() -> None:
    assert names_of(b" \x1b[C\x1b[Dq\x1bOA\x1b[H") == [" ", "right", "left", "q", "up", "home"]


@pytest.mark.parametrize("log", ["tlog", "ulog"])
def test_commands_and_changes_are_refused(log: str, request: pytest.FixtureRequest) -> None:
    playback: Playback = request.getfixturevalue(log)
    target = playback.vehicle
    client = Client(ReplayVehicle(playback, [STATION], 0.0))
    arm = mavlink.MAVLink_command_long_message(
        *target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0
    )
    answers = {message.get_type(): message for message in client.ask(arm)}
    assert answers["COMMAND_ACK"].result == mavlink.MAV_RESULT_DENIED
    assert answers["STATUSTEXT"].text == "Command refused: this is the replay of a log"
    count = mavlink.MAVLink_mission_count_message(*target, 3, mavlink.MAV_MISSION_TYPE_MISSION)
    answers = {message.get_type(): message for message in client.ask(count)}
    assert answers["MISSION_ACK"].type == mavlink.MAV_MISSION_DENIED
    listed = {m.get_type(): m for m in client.ask(mavlink.MAVLink_mission_request_list_message(*target, 0))}
    assert listed["MISSION_COUNT"].count == 0
    assert client.vehicle.refused == 2


def test_requests_that_clients_repeat_have_no_text(ulog: Playback) -> None:
    client = Client(ReplayVehicle(ulog, [STATION], 0.0))
    for command, param in (
        (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 30),
        (mavlink.MAV_CMD_REQUEST_MESSAGE, 9999),
    ):
        ask = mavlink.MAVLink_command_long_message(*ulog.vehicle, command, 0, param, 0, 0, 0, 0, 0, 0)
        kinds = [message.get_type() for message in client.ask(ask)]
        assert "COMMAND_ACK" in kinds
        assert "STATUSTEXT" not in kinds
    version = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
    ask = mavlink.MAVLink_command_long_message(
        *ulog.vehicle, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, version, 0, 0, 0, 0, 0, 0
    )
    answers = {message.get_type(): message for message in client.ask(ask)}
    assert answers["COMMAND_ACK"].result == mavlink.MAV_RESULT_ACCEPTED
    assert "AUTOPILOT_VERSION" in answers


@pytest.mark.parametrize("log", ["tlog", "ulog"])
def test_parameters_of_the_log_are_served(log: str, request: pytest.FixtureRequest) -> None:
    playback: Playback = request.getfixturevalue(log)
    client = Client(ReplayVehicle(playback, [STATION], 0.0))
    values = [
        message
        for message in client.ask(mavlink.MAVLink_param_request_list_message(*playback.vehicle))
        if message.get_type() == "PARAM_VALUE"
    ]
    assert len(values) == len(playback.parameters) == values[0].param_count
    read = mavlink.MAVLink_param_request_read_message(*playback.vehicle, b"MPC_XY_CRUISE", -1)
    (value,) = (message for message in client.ask(read) if message.get_type() == "PARAM_VALUE")
    assert value.param_value == {"tlog": 5.0, "ulog": 3.0}[log]


@pytest.mark.parametrize("log", ["tlog", "ulog"])
def test_any_content_of_a_message_is_answered_or_ignored(log: str, request: pytest.FixtureRequest) -> None:
    playback: Playback = request.getfixturevalue(log)
    client = Client(ReplayVehicle(playback, [STATION], 0.0))
    rng = random.Random(1)
    kinds = [kind for kind in mavlink.mavlink_map.values() if kind.msgname in ANSWERS]
    assert len(kinds) == len(ANSWERS)
    for number in range(600):
        kind = kinds[number % len(kinds)]
        payload = bytearray(rng.choice((rng.randbytes(kind.unpacker.size), b"\xff" * kind.unpacker.size)))
        for name, value in (("target_system", playback.vehicle.system), ("target_component", 1)):
            if name in kind.ordered_fieldnames:  # each is one byte, behind the longer fields
                payload[offset_of(kind, name)] = value
        if kind.msgname == "COMMAND_LONG":
            payload[28:30] = mavlink.MAV_CMD_REQUEST_MESSAGE.to_bytes(2, "little")
        frame = pack_frame(
            kind.id, bytes(payload).rstrip(b"\0") or b"\0", kind.crc_extra, number % 256, 255, 190
        )
        client.vehicle.receive(frame, STATION, 0.0)
        client.vehicle.poll(0.0)


def offset_of(kind: Any, name: str) -> int:
    """Return the place of a field in the payload."""
    place = kind.ordered_fieldnames.index(name)
    codes = re.findall(r"\d*[a-zA-Z]", kind.unpacker.format)
    return struct.calcsize("<" + "".join(codes[:place]))


def test_a_new_peer_gets_telemetry_until_it_is_silent(tlog: Playback) -> None:
    vehicle = ReplayVehicle(tlog, [STATION], 0.0)
    client = Client(vehicle, OTHER)
    client.run(0.5)
    assert client.got == []
    gcs = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
    answers = client.ask(mavlink.MAVLink_heartbeat_message(*gcs, 0, 0, 4, 3), 0.5)
    assert answers[0].get_type() == "HEARTBEAT"
    vehicle.poll(16.0)
    assert vehicle.peers == (STATION,)


def test_a_ulog_flies_in_the_view_of_a_ground_station(ulog: Playback) -> None:
    vehicle, session = ReplayVehicle(ulog, [STATION], 0.0), Session()
    modes, highest_m = [], 0.0
    for tick in range(round(ulog.duration_s / 0.1) + 1):
        now_s = 0.1 * tick
        for _, frame in vehicle.poll(now_s):
            session.receive(frame, ("127.0.0.1", 18570), now_s)
        view = session.view
        if view.mode and (not modes or modes[-1] != view.mode):
            modes.append(view.mode)
        if view.position_ned_m is not None:
            highest_m = max(highest_m, -view.position_ned_m.z)
    assert modes == ["HOLD", "TAKEOFF", "MISSION", "LAND"]
    assert highest_m == pytest.approx(5.0, abs=0.2)
    assert not session.view.armed
    assert "Landed, disarming" in [entry.text for entry in session.view.texts]


def test_ulog_positions_are_those_of_the_log(ulog: Playback) -> None:
    recording = read_ulog(small_ulog(), "flight.ulg")
    topic = recording.topic("vehicle_local_position")
    assert topic is not None
    sent = [m for m in ulog.messages(9.95, 10.05) if m.get_type() == "LOCAL_POSITION_NED"]
    (message,) = sent
    index = int(topic.time_us.searchsorted(recording.start_us + 10_000_000, side="right")) - 1
    assert (message.x, message.y, message.z) == tuple(float(topic.fields[name][index]) for name in "xyz")


def test_ulog_has_the_progress_of_the_mission(ulog: Playback) -> None:
    reached, states = [], []
    for message in ulog.messages(-1.0, ulog.duration_s):
        kind = message.get_type()
        if kind == "MISSION_ITEM_REACHED":
            reached.append(message.seq)
        elif kind == "MISSION_CURRENT" and (not states or states[-1] != message.mission_state):
            states.append(message.mission_state)
    assert reached == list(range(len(reached)))
    assert len(reached) > 1
    assert states == [
        mavlink.MISSION_STATE_NOT_STARTED,
        mavlink.MISSION_STATE_ACTIVE,
        mavlink.MISSION_STATE_PAUSED,  # lands in another mode
        mavlink.MISSION_STATE_COMPLETE,
    ]
    assert [m.seq for m in ulog.state(ulog.duration_s) if m.get_type() == "MISSION_ITEM_REACHED"] == reached[
        -1:
    ]


@pytest.mark.parametrize(
    ("topic", "info", "throttle"),
    [
        (("vehicle_thrust_setpoint", {"xyz[0]": 0.0, "xyz[1]": 0.3, "xyz[2]": -0.4}), {}, 0.5),
        (
            ("rotor_speeds", {f"command_rad_s[{index}]": 200.0 + 100.0 * (index % 2) for index in range(6)}),
            {"rotor_max_speed_rad_s": 400.0, "rotor_count": 6},
            0.5 * (0.25 + 0.5625),
        ),
        (("wrench", {"thrust_achieved_n": 9.81}), {"mass_kg": 1.0}, 0.5),
    ],
)
def test_throttle_of_any_ulog(
    topic: tuple[str, dict[str, float]], info: dict[str, float], throttle: float
) -> None:
    name, fields = topic
    values = {key: np.array([value]) for key, value in fields.items()}
    log = Recording("log", ULOG, 0, 1, None, (Topic(name, np.array([0]), values),), info=info)
    assert throttle_of(log).values.tolist() == [[pytest.approx(throttle)]]
    position = Topic(
        "vehicle_local_position",
        np.array([0]),
        {name: np.array([0.0]) for name in ("x", "y", "z", "vx", "vy", "vz")},
    )
    playback = UlogPlayback(replace(log, topics=(*log.topics, position)))
    (hud,) = (message for message in playback.state(0.0) if message.get_type() == "VFR_HUD")
    assert hud.throttle == round(100.0 * throttle)


def plan_frames(vehicle: Link, station: Link) -> list[bytes]:
    """Return the frames of an upload of two items, a refused one, and a download."""
    mission = mavlink.MAV_MISSION_TYPE_MISSION

    def items(link: Link, target: tuple[int, int], altitudes: tuple[float, ...]) -> list[bytes]:
        return [
            link.encode(
                mavlink.MAVLink_mission_item_int_message(
                    *target, seq, 6, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, 473_977_420, 85_455_940, altitude, mission
                )
            )
            for seq, altitude in enumerate(altitudes)
        ]

    def ack(result: int) -> bytes:
        return vehicle.encode(mavlink.MAVLink_mission_ack_message(255, 190, result, mission))

    count = mavlink.MAVLink_mission_count_message
    frames = [station.encode(count(7, 1, 2, mission)), *items(station, (7, 1), (5.0, 6.0)), ack(0)]
    frames += [station.encode(count(7, 1, 1, mission)), *items(station, (7, 1), (9.0,)), ack(15)]
    return [
        *frames,
        vehicle.encode(count(255, 190, 3, mission)),
        *items(vehicle, (255, 190), (1.0, 2.0, 3.0)),
    ]


def test_plans_in_a_tlog_are_served() -> None:
    frames = [frame for _, frame in zip(range(9), decode_frames(small_tlog()), strict=False)]
    frames += plan_frames(Link(7, 1), Link(255, 190))
    content = b"".join(encode_record(1_000_000 * number, frame) for number, frame in enumerate(frames))
    playback = TlogPlayback(content, (7, 1))
    found = [
        [item.z for item in playback.plan(mavlink.MAV_MISSION_TYPE_MISSION, float(at_s))]
        for at_s in (9, 12, 16, len(frames) - 1)
    ]
    assert found == [[], [5.0, 6.0], [5.0, 6.0], [1.0, 2.0, 3.0]]
    vehicle = ReplayVehicle(playback, [STATION], 0.0, begin_s=12.0)
    client = Client(vehicle)
    listed = client.ask(mavlink.MAVLink_mission_request_list_message(7, 1, 0))
    assert [m.count for m in listed if m.get_type() == "MISSION_COUNT"] == [2]
    item = client.ask(mavlink.MAVLink_mission_request_int_message(7, 1, 1, 0))
    assert [(m.seq, m.z, m.x) for m in item if m.get_type() == "MISSION_ITEM_INT"] == [(1, 6.0, 473_977_420)]
    beyond = client.ask(mavlink.MAVLink_mission_request_int_message(7, 1, 2, 0))
    assert [m.type for m in beyond if m.get_type() == "MISSION_ACK"] == [mavlink.MAV_MISSION_INVALID_SEQUENCE]


def decode_frames(content: bytes) -> list[bytes]:
    return [record.frame for record in decode_records(content)]


def test_battery_with_unknown_current_is_replayed() -> None:
    def topic(name: str, **fields: float) -> Topic:
        return Topic(
            name, np.array([0, 1_000_000]), {key: np.array([value] * 2) for key, value in fields.items()}
        )

    position = topic("vehicle_local_position", x=1.0, y=2.0, z=-3.0)
    battery = topic("battery_status", voltage_v=12.5, current_a=math.nan, remaining=0.5)
    playback = UlogPlayback(Recording("log", ULOG, 0, 1_000_000, None, (position, battery)))
    (status,) = (m for m in playback.state(1.0) if m.get_type() == "BATTERY_STATUS")
    assert (status.voltages[0], status.current_battery, status.battery_remaining) == (12_500, -1, 50)


def test_setpoints_and_rotors_of_a_ulog_are_replayed(ulog: Playback) -> None:
    newest = {message.get_type(): message for message in ulog.state(10.0)}
    target, position = newest["POSITION_TARGET_LOCAL_NED"], newest["LOCAL_POSITION_NED"]
    assert math.dist((target.x, target.y, target.z), (position.x, position.y, position.z)) < 1.0
    assert {"ATTITUDE_TARGET", "ESC_STATUS"} <= set(newest)


def test_logs_without_a_vehicle_are_usage_errors() -> None:
    with pytest.raises(CliError, match="no heartbeat") as error:
        TlogPlayback(small_tlog(), (9, 1))
    assert error.value.exit_code == USAGE


def test_farewell_announces_the_end(tlog: Playback) -> None:
    vehicle = ReplayVehicle(tlog, [STATION], 0.0)
    ((place, frame),) = vehicle.farewell()
    (message,) = Link(0, 0).decode(frame)
    assert (place, message.system_status) == (STATION, mavlink.MAV_STATE_POWEROFF)


def test_vehicle_of_a_tlog_is_the_autopilot() -> None:
    assert read_tlog(small_tlog(), "gcs.tlog").vehicle == (7, 1)
