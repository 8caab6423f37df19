"""Services are polled when they are due, and the vehicle sends what it would send if all were polled each time."""

from __future__ import annotations

import math
import random
import select
import socket
import time

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.ftp_messages import Opcode, Packet, ftp_message
from flightstack.mavlink.link import SILENT_AFTER_S, Address
from flightstack.process.connections import MOST_NS, PAUSE_NS, SimulatorPace, serve_while_idle
from flightstack.process.process_config import Ended, ProcessConfig
from flightstack.services.routing.router import Schedule
from flightstack.transports.tcp import TcpClient
from flightstack.transports.vehicle_ports import PortsConfig
from tests.support.hub_net import ALICE, BOB, Net, Station

VEHICLE = Address(7, 1)


class Bell:
    """A service that counts its polls."""

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, due_s: float | None) -> None:
        self.due_s = due_s
        self.polled_s: list[float] = []

    def receive(self, message: object, peer: object, now_s: float) -> None:
        raise AssertionError

    def poll(self, now_s: float) -> list[tuple[None, str]]:
        self.polled_s.append(now_s)
        return [(None, f"{now_s:g}")]

    def next_deadline(self) -> float | None:
        return self.due_s


def test_service_is_polled_at_its_deadline_and_after_a_wake() -> None:
    never, at_2, always = Bell(None), Bell(2.0), Bell(-math.inf)
    schedule = Schedule([never, at_2, always])
    for now_s in (0.0, 1.0, 2.0):
        schedule.poll(now_s)
    at_2.due_s = 5.0
    schedule.wake()
    for now_s in (3.0, 4.0, 5.0):
        schedule.poll(now_s)
    assert never.polled_s == [0.0, 3.0]
    assert at_2.polled_s == [0.0, 2.0, 3.0, 5.0]
    assert always.polled_s == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert schedule.poll(6.0) == [(None, "6"), (None, "6")]


@pytest.mark.parametrize("kind", ["HEARTBEAT", "MISSION_ITEM_INT"])
def test_heartbeat_or_mission_item_wakes_only_its_service(kind: str) -> None:
    own, other = Bell(None), Bell(None)
    own.handles, other.handles = frozenset({kind}), frozenset({"COMMAND_LONG"})
    schedule = Schedule([own, other])
    schedule.poll(0.0)
    schedule.wake(kind)
    schedule.poll(1.0)
    schedule.wake("COMMAND_LONG")
    schedule.poll(2.0)
    assert (own.polled_s, other.polled_s) == ([0.0, 1.0, 2.0], [0.0, 2.0])


def begin_burst(net: Net) -> Station:
    """Return a client in the middle of a burst."""
    client = net.join(ALICE)
    path = b"etc/extras/parameters.json"
    client.send(ftp_message(VEHICLE, Packet(0, 0, Opcode.OPEN_FILE_RO, len(path), data=path)))
    net.poll()
    assert not net.hub.sends_files
    client.send(ftp_message(VEHICLE, Packet(2, 0, Opcode.BURST_READ_FILE, 239)))
    net.poll()
    return client


def test_hub_sends_files_until_the_end_of_a_burst() -> None:
    net = Net()
    begin_burst(net)
    assert net.hub.sends_files
    net.run(1.0)
    assert not net.hub.sends_files


def test_hub_sends_no_files_to_a_client_that_vanished_in_a_burst() -> None:
    net = Net()
    begin_burst(net)
    net.now_s += SILENT_AFTER_S + 0.1
    net.poll()
    assert not net.hub.sends_files


def paces(intervals_us: list[int]) -> list[bool]:
    """Return, for each tick, if a pause of the simulator is expected after it; ``intervals_us`` are between ticks."""
    pace, time_ns, expected = SimulatorPace(), 10**12, []
    pace.note_tick(time_ns)
    for interval_us in intervals_us:
        pace.begin_wait(time_ns)
        time_ns += 1000 * interval_us
        pace.note_tick(time_ns)
        expected.append(pace.may_pause())
    return expected


def test_pause_is_expected_after_each_state_and_after_bursts() -> None:
    assert paces([2000] * 50) == [True] * 50
    burst = [200, 200, 200, 200, 9200]
    assert paces(burst * 10)[4:] == [True] * 46


def test_no_pause_is_expected_at_full_speed() -> None:
    at_full_speed = paces([3000] + [50] * 1100)  # a slow tick: the processor was taken
    assert at_full_speed.index(False) == 150  # 7.5 ms later
    assert not any(at_full_speed[150:])
    assert not any(paces(([1000] + [50] * 400) * 10))  # the simulator draws random numbers


def test_own_work_between_two_states_is_no_pause() -> None:
    pace, time_ns = SimulatorPace(), 10**12
    pace.note_tick(time_ns)
    for _ in range(20):
        time_ns += 5_000_000
        pace.begin_wait(time_ns)
        pace.note_tick(time_ns + 20_000)
        assert not pace.may_pause()
        pace.note_tick(time_ns + 4_000_000)  # bytes that were received with the last answer: without a wait
        assert not pace.may_pause()


def test_pause_is_silence_from_the_start_of_a_tick() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        simulator = TcpClient.connect(*server.getsockname(), 10.0, lambda: None)
        world, _ = server.accept()
        with world:
            pace = SimulatorPace()
            began_ns = time.monotonic_ns()
            pace.begin_wait(began_ns - MOST_NS)
            pace.note_tick(began_ns)
            assert pace.pauses(simulator)
            assert time.monotonic_ns() - began_ns >= PAUSE_NS  # a state of a burst would have come first
            world.send(b"state")
            select.select([simulator.fileno()], [], [])
            assert not pace.pauses(simulator)
        simulator.close()


def test_tick_longer_than_a_pause_has_no_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    waits_s: list[float] = []

    def silent(_read: object, _write: object, _other: object, timeout_s: float) -> tuple[list[int], ...]:
        waits_s.append(timeout_s)
        return [], [], []

    with socket.create_server(("127.0.0.1", 0)) as server:
        simulator = TcpClient.connect(*server.getsockname(), 10.0, lambda: None)
        monkeypatch.setattr(select, "select", silent)
        pace = SimulatorPace()
        began_ns = time.monotonic_ns() - 2 * PAUSE_NS
        pace.begin_wait(began_ns - MOST_NS)
        pace.note_tick(began_ns)
        assert pace.pauses(simulator)
        assert waits_s == [0.0]
        simulator.close()


def test_hung_simulator_is_detected_while_files_are_sent() -> None:
    net = Net()
    begin_burst(net)
    ports = PortsConfig(0, (), ("127.0.0.1", 1), "127.0.0.1", 0)
    process = ProcessConfig("127.0.0.1", 1, 0.01, ports, None, False, None)
    with socket.create_server(("127.0.0.1", 0)) as server:
        simulator = TcpClient.connect(*server.getsockname(), 10.0, lambda: None)
        poller = select.poll()
        poller.register(simulator, select.POLLIN)
        with pytest.raises(Ended, match=r"simulator lost at t=0.000 s: no state for 0.01 s"):
            serve_while_idle(simulator, poller, net.stack, process, lambda: None)
        simulator.close()


def test_parameter_changed_without_a_message_is_announced() -> None:
    net = Net()
    alice = net.join(ALICE)
    net.run(0.1)
    net.stack.params.set("MIS_TAKEOFF_ALT", 4.5)
    net.run(0.1)
    assert [m.param_value for m in alice.take("PARAM_VALUE")] == [4.5]


def traffic(seed: int) -> list[tuple[int, int, object]]:
    """Return (poll, station, message): transfers that are begun and left, and single requests."""
    m, chance = mavlink, random.Random(seed)
    path = b"general.json"
    opening = Packet(1, 0, Opcode.OPEN_FILE_RO, len(path), data=path)
    messages = [
        m.MAVLink_param_request_list_message(7, 1),
        m.MAVLink_param_set_message(7, 1, b"SYS_FAILURE_EN", 1.0, m.MAV_PARAM_TYPE_REAL32),
        m.MAVLink_param_set_message(7, 1, b"MIS_TAKEOFF_ALT", 3.0, m.MAV_PARAM_TYPE_REAL32),
        m.MAVLink_mission_count_message(7, 1, 3),
        m.MAVLink_mission_request_list_message(7, 1),
        m.MAVLink_mission_item_int_message(7, 1, 0, 6, 16, 2, 1, 0, 0, 0, 0, 473977420, 85455940, 5.0),
        m.MAVLink_log_request_list_message(7, 1, 0, 0xFFFF),
        m.MAVLink_timesync_message(0, 5),
        m.MAVLink_command_long_message(7, 1, m.MAV_CMD_LOGGING_START, 0, *[0.0] * 7),
        m.MAVLink_command_long_message(7, 1, m.MAV_CMD_INJECT_FAILURE, 0, 101.0, 1.0, 2.0, *[0.0] * 4),
        m.MAVLink_command_long_message(7, 1, m.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *[0.0] * 6),
        m.MAVLink_manual_control_message(7, 0, 0, 500, 0, 0),
        m.MAVLink_set_position_target_local_ned_message(0, 7, 1, 1, 0xDF8, 1.0, 0.0, -3.0, *[0.0] * 8),
        ftp_message(VEHICLE, opening),
        ftp_message(VEHICLE, Packet(2, 0, Opcode.BURST_READ_FILE, 200)),
        ftp_message(VEHICLE, Packet(3, 0, Opcode.CALC_FILE_CRC32, len(path), data=path)),
    ]
    events = [(chance.randrange(1000), chance.randrange(2), message) for message in messages * 3]
    return sorted(events, key=lambda event: event[0])


def dialogue(seed: int) -> list[bytes]:
    """Return all frames of 20 s with two stations, of which one is silent at the end."""
    net, events = Net(), traffic(seed)
    stations: list[Station] = [net.join(ALICE), net.join(BOB)]
    for poll in range(2000):
        while events and events[0][0] == poll:
            _, station, message = events.pop(0)
            stations[station].send(message)
        if poll % 100 == 0 and poll < 1500:
            stations[0].heartbeat()
        if poll == 1200:
            net.stack.simulator.take_requests()
        net.run(0.01)
    return [frame for station in stations for frame in station.frames]


@pytest.mark.parametrize("seed", range(3))
def test_due_services_send_what_services_polled_each_time_send(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scheduled = dialogue(seed)
    poll = Schedule.poll

    def poll_all(schedule: Schedule, now_s: float) -> list:
        schedule.wake()
        return poll(schedule, now_s)

    monkeypatch.setattr(Schedule, "poll", poll_all)
    assert scheduled == dialogue(seed)
    assert len({frame[7:10] for frame in scheduled}) > 20  # kinds of messages
