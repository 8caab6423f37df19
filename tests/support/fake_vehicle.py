"""A vehicle with scripted behaviour for tests of the ground station. No I/O, except for ``serve``.

It uses pymavlink's codec and none of flightstack's services, so that both sides cannot share a defect.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from flightstack.mavlink.dialect import EscStatus, FsLoopTiming, mavlink
from flightstack.transports.udp import UdpSocket

ARM, START, SHUT_DOWN, REQUEST, RETURN, SET_INTERVAL = 400, 300, 246, 512, 20, 511
SET_CURRENT = 224
LAND_NOW, TAKE_OFF, SET_MODE = 21, 22, 176
TAKEOFF, HOLD, MISSION, RTL, LAND = (4 << 16 | sub << 24 for sub in (2, 3, 4, 5, 6))
HOME_M = 488.0
ACCEPTED, REJECTED, UNSUPPORTED = 0, 1, 3
STEP_S = 0.05
EVERY_TYPE = 255
DENIED = 14


@dataclass
class FakeVehicle:
    """Completes one mission item per poll while the mission runs."""

    system_id: int = 1
    refusals: dict[int, str] = field(default_factory=dict)
    """Reason of the refusal, by command."""
    ignored: set[Any] = field(default_factory=set)
    """Names of messages and numbers of commands to ignore."""
    unsent: set[str] = field(default_factory=set)
    """Names of messages that are not sent."""
    mission_result: int = ACCEPTED
    mission_refusal: str = ""
    refused_type: int | None = None
    """MAV_MISSION_TYPE whose uploads are refused."""
    unknown_types: tuple[int, ...] = ()
    """Unsupported MAV_MISSION_TYPEs."""
    healthy_after_s: float = 0.0
    stop_at_item: int | None = None
    """Item at which ``at_stop`` happens: "disarm", "silence", "power off" or "hover"."""
    at_stop: str = "disarm"
    ends_in_air: bool = False
    simulated_s_per_item: float = 5.0
    autopilot: int = mavlink.MAV_AUTOPILOT_PX4

    def __post_init__(self) -> None:
        self.codec = mavlink.MAVLink(None, self.system_id, 1)
        self.codec.robust_parsing = True
        self.plans: dict[int, list[Any]] = {0: [], 1: [], 2: []}
        self.uploaded: list[int] = []
        self.plan_type = 0
        self.commands: list[tuple[int, tuple[float, ...]]] = []
        self.heard: list[str] = []
        self.asked: set[int] = set()
        self.armed = self.silent = self.powered_off = self.complete = False
        self.mode, self.current, self.time_s = HOLD, 0, 0.0
        self.altitude_m = 3.0
        self.takeoff_m = self.altitude_m
        self._uploading: list[Any] = []
        self._expected = 0
        self._out: list[Any] = []
        self._heartbeat_due_s = self._began_s = -1.0
        self._now_s = 0.0

    def make_heartbeat_due(self) -> None:
        """Send a heartbeat in the next poll, for a new peer."""
        self._heartbeat_due_s = -1.0

    # -- receiving

    def receive(self, data: bytes, now_s: float = 0.0) -> None:
        """Take a datagram."""
        self._now_s = max(self._now_s, now_s)
        for message in self.codec.parse_buffer(data) or ():
            name = message.get_type()
            self.heard.append(name)
            handler = getattr(self, f"_on_{name.lower()}", None)
            if handler is not None and name not in self.ignored:
                handler(message)

    def _on_command_long(self, message: Any) -> None:
        command = message.command
        if command in self.ignored:
            return
        params = tuple(getattr(message, f"param{i}") for i in range(1, 8))
        self.commands.append((command, params))
        if command in self.refusals:
            self._ack(command, REJECTED)
            self.say(self.refusals[command])
        elif command == REQUEST:
            self._answer_request(int(params[0]))
        else:
            self._ack(command, self.execute(command, params))

    def execute(self, command: int, params: tuple[float, ...]) -> int:
        if command == ARM:
            self._become(armed=params[0] == 1.0)
        elif command == START:
            self._become(armed=True, mode=MISSION)
        elif command == SET_CURRENT:
            self.current = int(params[0])
            self._out.append(self._mission_current())
        elif command == RETURN:
            self._become(mode=RTL)
        elif command == SHUT_DOWN:
            self.powered_off = True
        elif command == SET_INTERVAL:
            if params[0] not in self._on_request():
                return UNSUPPORTED
            self.asked.add(int(params[0]))
            self._out.append(self._on_request()[int(params[0])])
        elif command == LAND_NOW:
            self._become(mode=LAND)
        elif command == TAKE_OFF:
            self._become(mode=TAKEOFF)
            self.takeoff_m = params[6] - HOME_M
        elif command == SET_MODE:
            self._become(mode=int(params[1]) << 16 | int(params[2]) << 24)
        else:
            return UNSUPPORTED
        return ACCEPTED

    def _answer_request(self, number: int) -> None:
        available = {
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status(),
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current(),
            **self._on_request(),
        }
        if number in available:
            self._out.append(available[number])
        self._ack(REQUEST, ACCEPTED if number in available else UNSUPPORTED)

    def _on_file_transfer_protocol(self, message: Any) -> None:
        """Refuse: the vehicle has no files."""
        request = bytes(message.payload)
        sequence = int.from_bytes(request[:2], "little") + 1
        nak = sequence.to_bytes(2, "little") + bytes([0, 129, 1, request[3], 0, 0, 0, 0, 0, 0, 10])
        sender = message.get_srcSystem(), message.get_srcComponent()
        self._out.append(mavlink.MAVLink_file_transfer_protocol_message(0, *sender, nak.ljust(251, b"\0")))

    def _on_mission_count(self, message: Any) -> None:
        self.plan_type = message.mission_type
        self._uploading, self._expected = [], message.count
        self.ask_next_item()

    def _on_mission_item_int(self, message: Any) -> None:
        if message.seq == len(self._uploading):
            self._uploading.append(message)
            self.ask_next_item()

    def ask_next_item(self) -> None:
        seq = len(self._uploading)
        if seq < self._expected:
            self._out.append(mavlink.MAVLink_mission_request_int_message(255, 190, seq, self.plan_type))
            return
        result = DENIED if self.plan_type == self.refused_type else self.mission_result
        self._out.append(mavlink.MAVLink_mission_ack_message(255, 190, result, self.plan_type))
        if result == ACCEPTED:
            self.plans[self.plan_type] = self._uploading
            self.uploaded.append(self.plan_type)
        elif self.mission_refusal:
            self.say(self.mission_refusal)

    def _on_mission_request_list(self, message: Any) -> None:
        kind = message.mission_type
        if kind in self.unknown_types:
            self._out.append(mavlink.MAVLink_mission_ack_message(255, 190, UNSUPPORTED, kind))
            return
        self._out.append(mavlink.MAVLink_mission_count_message(255, 190, len(self.plans[kind]), kind))

    def _on_mission_request_int(self, message: Any) -> None:
        item = self.plans[message.mission_type][message.seq]
        item.target_system, item.target_component = 255, 190
        self._out.append(item)

    def _on_mission_clear_all(self, message: Any) -> None:
        for kind in (0, 1, 2) if message.mission_type == EVERY_TYPE else (message.mission_type,):
            self.plans[kind] = []
        self._out.append(mavlink.MAVLink_mission_ack_message(255, 190, ACCEPTED, message.mission_type))

    @property
    def items(self) -> list[Any]:
        """The mission."""
        return self.plans[0]

    # -- sending

    def poll(self, now_s: float) -> list[bytes]:
        """Return the datagrams to send."""
        self._now_s = max(self._now_s, now_s)
        if self._began_s < 0.0:
            self._began_s = now_s
        self._fly()
        if now_s >= self._heartbeat_due_s:
            self._heartbeat_due_s = now_s + 1.0
            self._out += [self._heartbeat(), self._sys_status(), *self._telemetry()]
        if self.powered_off and not self.silent:
            self._out.append(self._heartbeat())
        messages, self._out = self._out, []
        if self.silent:
            return []
        self.silent = self.powered_off
        return [self._encode(message) for message in messages if message.get_type() not in self.unsent]

    def _encode(self, message: Any) -> bytes:
        frame = bytes(message.pack(self.codec))
        self.codec.seq = (self.codec.seq + 1) % 256
        return frame

    def _fly(self) -> None:
        if self.armed and self.mode == TAKEOFF:
            self.altitude_m = self.takeoff_m
            self._become(mode=HOLD)
            self._out += self._telemetry()
        if not (self.armed and self.mode in (MISSION, RTL, LAND)):
            return
        self.time_s += self.simulated_s_per_item
        if self.current == self.stop_at_item:
            self._stop()
        elif self.mode in (RTL, LAND):
            self._become(armed=False, mode=HOLD)
        elif self.current == len(self.items) - 1:
            self.complete = True
            self._out.append(mavlink.MAVLink_mission_item_reached_message(self.current))
            self._become(armed=self.ends_in_air, mode=HOLD)
        else:
            self._out.append(mavlink.MAVLink_mission_item_reached_message(self.current))
            self.current += 1
        self._out += [self._mission_current(), *self._telemetry()]

    def _stop(self) -> None:
        if self.at_stop == "disarm":
            self.say("Rotor 3 is gone", severity=2)
            self._become(armed=False)
        elif self.at_stop == "silence":
            self.silent = True
        elif self.at_stop == "power off":
            self.powered_off = True

    def _become(self, armed: bool | None = None, mode: int | None = None) -> None:
        self.armed = self.armed if armed is None else armed
        self.mode = self.mode if mode is None else mode
        self._out.append(self._heartbeat())

    def _ack(self, command: int, result: int) -> None:
        self._out.append(mavlink.MAVLink_command_ack_message(command, result, 0, 0, 255, 190))

    def say(self, text: str, severity: int = 4) -> None:
        data = text.encode()
        for index in range(0, len(data), 50):
            number = len(data) if len(data) > 50 else 0
            chunk = data[index : index + 50]
            self._out.append(mavlink.MAVLink_statustext_message(severity, chunk, number, index // 50))

    def _heartbeat(self) -> Any:
        base = 128 * self.armed + mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        state = mavlink.MAV_STATE_POWEROFF if self.powered_off else mavlink.MAV_STATE_ACTIVE
        return mavlink.MAVLink_heartbeat_message(2, self.autopilot, base, self.mode, state, 3)

    def _sys_status(self) -> Any:
        sensors = mavlink.MAV_SYS_STATUS_AHRS
        health = sensors if self._now_s - self._began_s >= self.healthy_after_s else 0
        return mavlink.MAVLink_sys_status_message(
            sensors, sensors, health, 0, 65535, -1, -1, 0, 0, 0, 0, 0, 0
        )

    def _mission_current(self) -> Any:
        state = mavlink.MISSION_STATE_COMPLETE if self.complete else mavlink.MISSION_STATE_ACTIVE
        return mavlink.MAVLink_mission_current_message(self.current, len(self.items), state, 1)

    def _telemetry(self) -> list[Any]:
        ms, above_mm = int(self.time_s * 1e3), round(self.altitude_m * 1e3)
        return [
            mavlink.MAVLink_attitude_message(ms, 0.1, -0.05, 1.5, 0.0, 0.0, 0.0),
            mavlink.MAVLink_local_position_ned_message(ms, 1.0, 2.0, -self.altitude_m, 0.4, 0.0, 0.0),
            mavlink.MAVLink_global_position_int_message(
                ms, 473977420, 85455940, round((HOME_M + self.altitude_m) * 1e3), above_mm, 50, 0, 0, 9000
            ),
            mavlink.MAVLink_home_position_message(
                473977420, 85455940, 488000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0
            ),
            mavlink.MAVLink_extended_sys_state_message(0, 2 if self.armed else 1),
            self._mission_current(),
            *(message for number, message in self._on_request().items() if number in self.asked),
        ]

    def _on_request(self) -> dict[int, Any]:
        """Return the messages that are streamed on request only, by message id."""
        ms = int(self.time_s * 1e3)
        timing = FsLoopTiming(
            ms * 1000, ms // 2, 3, 0, 500.0, 100.0, 52.5, 12.0, 20.0, 90.0, 0.0, 0.0, 0.0, 0
        )
        esc = EscStatus(0, ms * 1000, [2310, 2290, 2305, 2400], [0.0] * 4, [0.0] * 4)
        return {timing.id: timing, esc.id: esc}


@contextmanager
def serve(vehicle: FakeVehicle, to_port: int | None = None) -> Iterator[UdpSocket]:
    """Run ``vehicle`` on a free UDP port in a thread; it sends to all that it has heard, and to ``to_port``."""
    socket = UdpSocket("127.0.0.1")
    vehicle.make_heartbeat_due()
    stopped = threading.Event()

    def run() -> None:
        peers = set() if to_port is None else {("127.0.0.1", to_port)}
        while not stopped.is_set():
            socket.wait(STEP_S)
            for data, sender in socket.receive():
                peers.add(sender)
                vehicle.receive(data, time.monotonic())
            for frame in vehicle.poll(time.monotonic()) if peers else ():
                for peer in peers:
                    socket.send(frame, peer)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield socket
    finally:
        stopped.set()
        thread.join()
        socket.close()
