"""Telemetry: each message once per poll, of one status, and the frames of streamed messages. No I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import groupby

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.frame_packer import FramePacker
from flightstack.mavlink.link import Link, Message
from flightstack.services.telemetry import modes, motion, vehicle
from flightstack.services.telemetry.fields import wrapped
from flightstack.services.telemetry.motion_values import Motion, Places
from flightstack.services.telemetry.sensors import SENSED
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.status import VehicleInfo, VehicleStatus, VehicleSummary

M = mavlink

MAKERS: dict[int, Callable[[VehicleStatus], Message]] = {
    M.MAVLINK_MSG_ID_SYS_STATUS: vehicle.sys_status,
    M.MAVLINK_MSG_ID_SYSTEM_TIME: vehicle.system_time,
    M.MAVLINK_MSG_ID_GPS_RAW_INT: motion.gps_raw,
    M.MAVLINK_MSG_ID_MISSION_CURRENT: vehicle.mission_current,
    M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: vehicle.origin,
    M.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: motion.position_target_global,
    M.MAVLINK_MSG_ID_BATTERY_STATUS: vehicle.battery_status,
    M.MAVLINK_MSG_ID_AUTOPILOT_VERSION: vehicle.autopilot_version,
    M.MAVLINK_MSG_ID_FENCE_STATUS: vehicle.fence_status,
    M.MAVLINK_MSG_ID_ESTIMATOR_STATUS: vehicle.estimator_status,
    M.MAVLINK_MSG_ID_HOME_POSITION: vehicle.home_position,
    M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: vehicle.extended_state,
    M.MAVLINK_MSG_ID_FLIGHT_INFORMATION: vehicle.flight_information,
    EscStatus.id: motion.esc_status,
    M.MAVLINK_MSG_ID_PROTOCOL_VERSION: vehicle.protocol_version,
    M.MAVLINK_MSG_ID_ODOMETRY: motion.odometry,
    M.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: motion.actuator_output,
    M.MAVLINK_MSG_ID_CURRENT_MODE: modes.current_mode,
    M.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: modes.available_modes_monitor,
}
"""Constructors of the other messages that depend on the status alone, by message id."""

MOTION = frozenset(getattr(M, f"MAVLINK_MSG_ID_{name}") for name in motion.CONTENTS)
"""Messages of the values of motion."""
STREAMED = MOTION | {*MAKERS, M.MAVLINK_MSG_ID_HEARTBEAT, FS_LOOP_TIMING_ID}
"""Messages that can be sent at a rate."""
SENSOR_STREAMED = STREAMED | SENSED.keys()
"""The same for a vehicle that flies on its sensors."""
_GLOBAL = frozenset(
    {
        M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        M.MAVLINK_MSG_ID_HOME_POSITION,
    }
)
"""Messages of places on earth, which a vehicle on its sensors does not know before its first fix."""
_NONE: frozenset[int] = frozenset()
_REQUESTED = frozenset({M.MAVLINK_MSG_ID_AVAILABLE_MODES, M.MAVLINK_MSG_ID_MISSION_ITEM_REACHED})
"""Further messages on request."""


class Telemetry:
    """Builds each message once per poll and tick, for all links."""

    def __init__(
        self,
        status: Callable[[], VehicleStatus],
        summary: Callable[[], VehicleSummary],
        now: FlightState,
        places: Places,
        info: VehicleInfo,
        loop_timing: Callable[[], Message],
        has_sensors: bool = False,
    ) -> None:
        """``has_sensors`` is true if the vehicle flies on its sensors: the status then has ``sensed``."""
        self.has_sensors = has_sensors
        self.streamed = SENSOR_STREAMED if has_sensors else STREAMED
        """Messages that can be sent at a rate."""
        self._status_of_now, self._summary_of_now = status, summary
        self._now = now
        self._loop_timing = loop_timing
        self._status: VehicleStatus | None = None
        self._made: dict[int, tuple[Message, ...]] = {}
        self._motion = Motion(now, places, info)
        self._packer = FramePacker(self._motion.values, motion.CONTENTS)
        self._is_read = False
        self._tick_us = now.time_us

    def is_available(self, message_id: int) -> bool:
        """Return True if the message can be requested."""
        return message_id in self.streamed or message_id in _REQUESTED

    def begin_poll(self) -> None:
        """Discard the status and the messages of the last poll."""
        self._status, self._is_read, self._tick_us = None, False, self._now.time_us
        self._made.clear()

    @property
    def status(self) -> VehicleStatus:
        """The status in this poll."""
        if self._status is None:
            self._status = self._status_of_now()
        return self._status

    @property
    def time_us(self) -> int:
        """Vehicle time of the newest tick."""
        return self._now.time_us

    @property
    def boot_ms(self) -> int:
        """Vehicle time for the field ``time_boot_ms``."""
        return wrapped(self.time_us // 1000)

    def messages(self, message_id: int) -> tuple[Message, ...]:
        """Return a message of ``streamed``, as of this tick: ticks may come between two parts of a poll."""
        if self._tick_us != self._now.time_us:
            self.begin_poll()
        made = self._made.get(message_id)
        if made is None:
            made = self._made[message_id] = self._make(message_id)
        return made

    def frames(self, message_ids: Iterable[int], link: Link) -> list[bytes]:
        """Return the frames on ``link`` of messages of ``streamed``, as of this tick."""
        frames: list[bytes] = []
        for is_motion, run in groupby(message_ids, MOTION.__contains__):
            if is_motion:
                frames += link.encode_numbered(self._read(), self._numbers(run))
            else:
                frames += [link.encode(made) for number in run for made in self.messages(number)]
        return frames

    def _read(self) -> FramePacker:
        """Return the packer with the values of this tick."""
        if self._tick_us != self._now.time_us:
            self.begin_poll()
        if not self._is_read:
            self._is_read = True
            self._motion.read()
        return self._packer

    def _numbers(self, message_ids: Iterable[int]) -> list[int]:
        """Return the packer's numbers of the messages that can be sent now."""
        index, hidden = self._packer.index, self._hidden
        return [index[message_id] for message_id in message_ids if message_id not in hidden]

    @property
    def _hidden(self) -> frozenset[int]:
        """Messages that are not sent now."""
        return _GLOBAL if self.has_sensors and not self._now.has_state else _NONE

    def requested(self, message_id: int, argument: float = 0.0) -> tuple[Message, ...]:
        """Return an available message as of now; ``argument`` is the second parameter of REQUEST_MESSAGE.

        Before the first reached item there is no MISSION_ITEM_REACHED.
        """
        if message_id == M.MAVLINK_MSG_ID_AVAILABLE_MODES:
            return tuple(modes.available_modes(argument))
        self.begin_poll()
        if message_id == M.MAVLINK_MSG_ID_MISSION_ITEM_REACHED:
            return vehicle.item_reached(self.status)
        return self.messages(message_id)

    def farewell(self) -> Message:
        """Return the final HEARTBEAT with MAV_STATE_POWEROFF."""
        return vehicle.heartbeat(self._summary_of_now(), leaving=True)

    def _make(self, message_id: int) -> tuple[Message, ...]:
        if message_id in self._hidden:
            return ()
        if message_id in MOTION:
            return (self._read().message(self._packer.index[message_id]),)
        if message_id == FS_LOOP_TIMING_ID:
            return (self._loop_timing(),)
        if message_id == M.MAVLINK_MSG_ID_HEARTBEAT:
            return (vehicle.heartbeat(self._summary_of_now()),)
        return _of_status(self.status, message_id)


def _of_status(f: VehicleStatus, message_id: int) -> tuple[Message, ...]:
    """Return a message that depends on the status alone."""
    if f.sensed is not None and message_id in SENSED:
        return SENSED[message_id](f, f.sensed)
    if message_id == EscStatus.id and f.info.rotors > 4:  # one message holds four rotors
        return (motion.esc_status(f), motion.esc_status(f, 4))
    return (MAKERS[message_id](f),)
