"""ArduCopter as recorded (90700977), scripted: its answers, its frames, and silence until streams are requested.

Written with pymavlink's codec alone, so that both sides cannot share a defect.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as apm

STABILIZE, AUTO, GUIDED, LOITER, RTL, LAND, BRAKE = 0, 3, 4, 5, 6, 9, 17
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
HOME_M, CLIMB_M_S, SPEED_M_S = 488.1, 2.5, 5.0
RELATIVE = apm.MAV_FRAME_GLOBAL_RELATIVE_ALT
ITEMS = 4
METRES_PER_DEGREE = 111_195.0
_NEEDS_POSITION = (AUTO, GUIDED, LOITER, RTL, BRAKE)
_NOT_ARMABLE = {AUTO: "AUTO", RTL: "RTL", LAND: "LAND", BRAKE: "BRAKE"}


@dataclass
class FakeArduCopter:
    """Flies to its target at constant speeds while it is armed."""

    has_position: bool = True
    mode: int = STABILIZE
    armed: bool = False
    altitude_m: float = 0.0
    north_m: float = 0.0
    east_m: float = 0.0
    heading_deg: float = 356.0
    ignores_takeoff: bool = False
    """Acknowledges a takeoff and stays on the ground."""
    unanswered: set[int] = field(default_factory=set)
    """Commands that are executed without an answer."""
    unsupported: set[int] = field(default_factory=set)
    """Commands that are answered with MAV_RESULT_UNSUPPORTED, as another autopilot does."""
    has_streams: bool = True
    """False for a vehicle that sends heartbeats and answers alone."""
    current_item: int = 0
    velocity_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Reported velocity."""
    rise_of_ground_m: float = 0.0
    """Height of the ground above home."""
    commands: list[tuple[int, int | None]] = field(default_factory=list)
    """Commands without requests of streams, and the frame of those that came as COMMAND_INT."""

    def __post_init__(self) -> None:
        self._codec = apm.MAVLink(None, 1, 1)
        self._codec.robust_parsing = True
        self._out: list[Any] = []
        self._target = (0.0, 0.0, 0.0)
        self._time_s = self._booted_s = 0.0
        self.streams_after_boot = False
        """True to send streams 1.2 s after a reboot without a request, as PX4 and our vehicle."""
        self._heartbeat_due_s = 0.0
        self._streams_due_s = math.inf
        self.home_m = HOME_M
        self.target_heading_deg = self.heading_deg

    # -- time

    def advance(self, to_s: float) -> list[bytes]:
        """Fly until ``to_s``, and return the datagrams to send."""
        self._fly(to_s - self._time_s)
        self._time_s = to_s
        if to_s >= self._heartbeat_due_s:
            self._heartbeat_due_s = to_s + 1.0
            self._out.append(self._heartbeat())
        if self.has_streams and to_s >= self._streams_due_s:
            self._streams_due_s = to_s + 0.25
            self._out += self._telemetry()
        messages, self._out = self._out, []
        return [self._encode(message) for message in messages]

    def _fly(self, dt_s: float) -> None:
        if not self.armed:
            return
        north, east, up = self._target
        if self.mode in (RTL, LAND):
            up = 0.0
        self.altitude_m += max(-CLIMB_M_S * dt_s, min(CLIMB_M_S * dt_s, up - self.altitude_m))
        away_m = math.hypot(north - self.north_m, east - self.east_m)
        if self.mode in (GUIDED, RTL) and away_m > 0.0:
            share = min(1.0, SPEED_M_S * dt_s / away_m)
            self.north_m += share * (north - self.north_m)
            self.east_m += share * (east - self.east_m)
        turn_deg = (self.target_heading_deg - self.heading_deg + 180.0) % 360.0 - 180.0
        self.heading_deg = (self.heading_deg + max(-30.0 * dt_s, min(30.0 * dt_s, turn_deg))) % 360.0
        if self.mode in (RTL, LAND) and self.altitude_m <= 0.0:
            self.armed = False

    def _encode(self, message: Any) -> bytes:
        frame = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        return frame

    # -- receiving

    def receive(self, data: bytes) -> None:
        """Take a datagram."""
        for message in self._codec.parse_buffer(bytearray(data)) or ():
            kind = message.get_type()
            if kind == "REQUEST_DATA_STREAM":
                self._streams_due_s = min(self._streams_due_s, self._time_s)
            elif kind == "MISSION_SET_CURRENT":
                self._set_current([float(message.seq)], RELATIVE)
            elif kind == "COMMAND_LONG":
                params = [getattr(message, f"param{number}") for number in range(1, 8)]
                if message.command != apm.MAV_CMD_SET_MESSAGE_INTERVAL:
                    self.commands.append((message.command, None))
                self._answer(message.command, params, RELATIVE, is_long=True)
            elif kind == "COMMAND_INT":
                params = [message.param1, message.param2, message.param3, message.param4]
                params += [message.x / 1e7, message.y / 1e7, message.z]
                self.commands.append((message.command, message.frame))
                self._answer(message.command, params, message.frame, is_long=False)

    def _answer(self, command: int, params: list[float], frame: int, *, is_long: bool) -> None:
        handlers = {
            apm.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            apm.MAV_CMD_DO_SET_MODE: lambda params, _frame: self._set_mode(int(params[1])),
            apm.MAV_CMD_NAV_TAKEOFF: self._take_off,
            apm.MAV_CMD_NAV_LAND: lambda _params, _frame: self._set_mode(LAND),
            apm.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _params, _frame: self._set_mode(RTL),
            apm.MAV_CMD_MISSION_START: lambda _params, _frame: self._set_mode(AUTO),
            apm.MAV_CMD_DO_REPOSITION: self._reposition,
            apm.MAV_CMD_DO_CHANGE_SPEED: self._speed,
            apm.MAV_CMD_CONDITION_YAW: self._yaw,
            apm.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            apm.MAV_CMD_DO_SET_HOME: self._set_home,
            apm.MAV_CMD_DO_SET_MISSION_CURRENT: self._set_current,
            apm.MAV_CMD_REQUEST_MESSAGE: self._request,
            apm.MAV_CMD_SET_MESSAGE_INTERVAL: lambda _params, _frame: ACCEPTED,
            apm.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
        }
        handler = None if command in self.unsupported else handlers.get(command)
        result, texts = UNSUPPORTED, len(self._out)
        if handler is not None and not (is_long and command == apm.MAV_CMD_DO_REPOSITION):
            result = handler(params, frame)
        said = self._out[texts:]  # texts follow the answer
        del self._out[texts:]
        if command not in self.unanswered:
            self._out.append(apm.MAVLink_command_ack_message(command, result, 0, 0, 255, 190))
        self._out += said

    def _say(self, text: str, severity: int = 2) -> None:
        self._out.append(apm.MAVLink_statustext_message(severity, text.encode()))

    def _set_mode(self, mode: int) -> int:
        if mode in _NEEDS_POSITION and not self.has_position:
            self._say(f"Mode change to {mode} failed: requires position")
            return FAILED
        self.mode = mode
        if mode == BRAKE:
            self._target = (self.north_m, self.east_m, self.altitude_m)
        elif mode == RTL:
            self._target = (0.0, 0.0, 0.0)
        return ACCEPTED

    def _arm(self, params: list[float], _frame: int) -> int:
        if params[0] == 0.0:
            if self.armed and self.altitude_m > 0.0 and params[1] != 21196.0:
                return FAILED
            self.armed = False
        elif self.mode in _NOT_ARMABLE:
            self._say(f"Arm: {_NOT_ARMABLE[self.mode]} mode not armable")
            return FAILED
        elif not self.has_position:
            self._say("Arm: Need Position Estimate")
            return FAILED
        else:
            self.armed = True
        return ACCEPTED

    def _take_off(self, params: list[float], frame: int) -> int:
        if frame != RELATIVE:
            return DENIED
        if not (self.armed and self.mode == GUIDED and self.altitude_m < 0.5):
            return FAILED
        if not self.ignores_takeoff:
            self._target = (self.north_m, self.east_m, params[6])
        return ACCEPTED

    def _reposition(self, params: list[float], frame: int) -> int:
        if math.isnan(params[6]) or frame not in (RELATIVE, apm.MAV_FRAME_GLOBAL):
            return DENIED
        self.mode = GUIDED
        above_m = params[6] - (0.0 if frame == RELATIVE else self.home_m)
        north = (params[4] - 47.397742) * METRES_PER_DEGREE
        east = (params[5] - 8.545594) * METRES_PER_DEGREE * math.cos(math.radians(47.397742))
        self._target = (north, east, above_m)
        return ACCEPTED

    def _speed(self, params: list[float], _frame: int) -> int:
        if not params[1] > 0.0:
            return DENIED
        return ACCEPTED if self.mode in (GUIDED, AUTO) else FAILED

    def _yaw(self, params: list[float], _frame: int) -> int:
        if self.mode in (GUIDED, AUTO):  # accepted elsewhere too, without an effect
            self.target_heading_deg = params[0]
        return ACCEPTED

    def _terminate(self, params: list[float], _frame: int) -> int:
        self.armed = self.armed and not params[0] > 0.5
        return ACCEPTED

    def _set_home(self, params: list[float], _frame: int) -> int:
        self.home_m = HOME_M + self.altitude_m if params[0] == 1.0 else params[6]
        return ACCEPTED

    def _set_current(self, params: list[float], _frame: int) -> int:
        if params[0] >= ITEMS:
            self._say("item is not in the list")
            return DENIED
        self.current_item = int(params[0])
        return ACCEPTED

    def _request(self, params: list[float], _frame: int) -> int:
        if params[0] != apm.MAVLINK_MSG_ID_HOME_POSITION:
            return UNSUPPORTED
        self._out.append(
            apm.MAVLink_home_position_message(
                473977420, 85455940, round(self.home_m * 1e3), 0, 0, 0, [math.nan] * 4, 0, 0, 0, 0
            )
        )
        return ACCEPTED

    def _reboot(self, _params: list[float], _frame: int) -> int:
        self._booted_s, self.mode = self._time_s, STABILIZE
        self._streams_due_s = self._time_s + 1.2 if self.streams_after_boot else math.inf
        return ACCEPTED

    # -- sending

    def _heartbeat(self) -> Any:
        base = 81 + 128 * self.armed
        state = 4 if self.altitude_m > 0.1 else 3
        return apm.MAVLink_heartbeat_message(2, apm.MAV_AUTOPILOT_ARDUPILOTMEGA, base, self.mode, state, 3)

    def _telemetry(self) -> list[Any]:
        ms = round((self._time_s - self._booted_s) * 1e3)
        latitude = 47.397742 + self.north_m / METRES_PER_DEGREE
        longitude = 8.545594 + self.east_m / METRES_PER_DEGREE / math.cos(math.radians(47.397742))
        above_mm = round((self.altitude_m + self.rise_of_ground_m) * 1e3)
        check = apm.MAV_SYS_STATUS_PREARM_CHECK
        health = check if self.has_position else 0
        yaw_rad = math.radians(self.heading_deg)
        return [
            apm.MAVLink_attitude_message(ms, 0.0, 0.0, yaw_rad, 0.0, 0.0, 0.0),
            apm.MAVLink_global_position_int_message(
                ms, round(latitude * 1e7), round(longitude * 1e7), round(self.home_m * 1e3) + above_mm,
                above_mm, *(round(speed * 1e2) for speed in self.velocity_ned_m_s), round(self.heading_deg * 100),
            ),
            apm.MAVLink_sys_status_message(check, check, health, 0, 12600, 0, 100, 0, 0, 0, 0, 0, 0),
            apm.MAVLink_mission_current_message(self.current_item, ITEMS, 3 if self.mode == AUTO else 2, 0),
            apm.MAVLink_ekf_status_report_message(831 if self.has_position else 167, 0, 0, 0, 0, 0),
            apm.MAVLink_extended_sys_state_message(0, 2 if self.altitude_m > 0.1 else 1),
        ]  # fmt: skip
