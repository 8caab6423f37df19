"""The simulator's end of the simulator link, sans-IO: bytes in, bytes out.

The flight stack requests a message and an interval with SET_MESSAGE_INTERVAL: FS_PLANT_STATE, answered by
FS_ACTUATORS, or the standard HIL_STATE_QUATERNION, answered by HIL_ACTUATOR_CONTROLS. HIL_SENSOR requests the messages
of the sensors beside it. PX4 requests HIL_STATE_QUATERNION alone and needs both: it gets the sensors as well, and its
answers begin after some steps, until which the simulator does not wait for them.

In lockstep each state is answered by actuators with the same timestamp. Actuators without the lockstep flag mean that
the flight stack runs on its own clock: the simulator then runs in real time with the newest commands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import FS_ACTUATORS_ID, FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.frames import FrameFinder
from flightstack.mavlink.link import Link, Message
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.hot_frames import LOCKSTEP_FLAG, ActuatorsFrame
from flightstack.simulator_link.sensor_frames import HIL_SENSOR_ID
from sim_bridge.plant.faults.checks import Client, client_refusal
from sim_bridge.server.failure_command import inject_failure
from sim_bridge.server.hil import HilControls, hil_state
from sim_bridge.simulator import (
    DEFAULT_INTERVAL_US,
    LONGEST_INTERVAL_US,
    SHORTEST_INTERVAL_US,
    SIMULATOR_COMPONENT,
    Simulator,
)

Bytes: TypeAlias = bytes | bytearray | memoryview

HIL_STATE_QUATERNION_ID = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
HIL_ACTUATOR_CONTROLS_ID = mavlink.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS
_ACCEPTED, _DENIED = int(mavlink.MAV_RESULT_ACCEPTED), int(mavlink.MAV_RESULT_DENIED)
_INJECT_FAILURE = mavlink.MAV_CMD_INJECT_FAILURE
_SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


class FlightStackEndpoint:
    """The link to one client. ``vehicle`` has its rotor limits, which scale the HIL controls."""

    def __init__(self, simulator: Simulator, vehicle: Vehicle, home: GeoPoint, system_id: int = 1) -> None:
        self.simulator = simulator
        self.actuators = ActuatorsFrame()
        self._spare = ActuatorsFrame()
        self.answered = False  # in lockstep: actuators for the present state were received
        self.free_running = False  # the flight stack runs on its own clock
        self.ready = False  # the flight stack has requested a state message
        self.is_sent = False  # the present state
        self.freewheels = False  # do not wait for answers, which have not begun
        self.peer_ended = False  # the flight stack sent a POWEROFF heartbeat
        self.error: str | None = None
        self.stale = 0
        self._link = Link(system_id, SIMULATOR_COMPONENT)
        self._frame = LocalFrame(home)
        self._controls = HilControls(vehicle)
        self._rotor_count = len(vehicle.rotors)
        self._requested = 0  # id of the requested state
        self._wants_sensors = self._sends_sensors = False
        self._home = home
        self.finder = FrameFinder()
        """Splits the received bytes into frames."""
        self._replies: list[bytes] = []
        self._faults_checked = False  # against lockstep

    @property
    def bad(self) -> int:
        """Number of frames without a valid message and of byte sequences without a frame."""
        return self._link.bad + self.finder.junk

    @property
    def is_quiet(self) -> bool:
        """True if nothing is expected but actuators for the present state, which are FS_ACTUATORS."""
        is_plain = self._requested == FS_PLANT_STATE_ID and self._faults_checked and self.error is None
        has_sensors = self.simulator.sensors is not None
        waits = self.is_sent and not (self.answered or self.free_running or self.freewheels)
        nothing_pends = not (self._replies or self.finder.partial_size)
        return is_plain and waits and nothing_pends and has_sensors is self._sends_sensors

    def receive(self, data: memoryview) -> None:
        """Handle received bytes, split anywhere.

        An intact actuator frame is handled whatever precedes it: in lockstep a lost one would stop the exchange.
        """
        if self.actuators.open(data):
            self._on_actuators()
            return
        for frame in self.finder.find(data):
            if self._is_answered():
                if self._spare.open(frame):
                    self.stale += 1
                    continue
            elif self.actuators.open(frame):
                self._on_actuators()
                continue
            for message in self._link.decode(frame):
                self._handle(message)

    def _is_answered(self) -> bool:
        """Return True if further actuators would replace an answer that is not applied yet."""
        return self.answered and not self.free_running

    def replies(self) -> Sequence[bytes]:
        """Return the pending replies, once."""
        if not self._replies:
            return ()
        replies, self._replies = self._replies, []
        return replies

    def state(self) -> Bytes:
        """Return the bytes to send for the present state, whose answer is pending from now on.

        During the fault ``state:drop`` no state, only a due BATTERY_STATUS and the sensors.
        """
        self.answered, self.is_sent = False, True
        simulator = self.simulator
        if self._requested == FS_PLANT_STATE_ID:
            return simulator.outgoing()
        data = simulator.battery_frame()
        if self._sends_sensors and simulator.sensors is not None:
            data += simulator.sensors.frames(simulator.stamp_us, clock_first=True)
        if self._requested and not simulator.drops_state:
            data += self._link.encode(hil_state(simulator, self._frame))
        return data

    def step(self) -> None:
        """Advance the plant with the newest commands; raise PlantDivergedError."""
        self.simulator.apply(self.actuators)
        self.is_sent = False

    def poweroff(self) -> bytes:
        """Return the POWEROFF heartbeat, which announces an orderly end."""
        heartbeat = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GENERIC,
            mavlink.MAV_AUTOPILOT_INVALID,
            0,
            0,
            mavlink.MAV_STATE_POWEROFF,
            3,
        )
        return self._link.encode(heartbeat)

    def _on_actuators(self) -> None:
        actuators = self.actuators
        if actuators.rotor_count != self._rotor_count:
            self.error = (
                f"the flight stack commands {actuators.rotor_count} rotors, the simulated vehicle has "
                f"{self._rotor_count}; start both with the same --vehicle"
            )
        self.free_running = not actuators.flags & LOCKSTEP_FLAG
        self.freewheels = False
        if not self._faults_checked:
            self._check_faults()
        if self.ready and actuators.time_us == self.simulator.stamp_us:
            self.answered = True
        elif not self.free_running:
            self.stale += 1

    def _check_faults(self) -> None:
        """Set an error for a fault that cannot act on this flight stack; checked once."""
        self._faults_checked = True
        client = Client(self._wants_sensors, self._sends_sensors, not self.free_running)
        self.error = client_refusal(self.simulator.faults, client) or self.error

    def _handle(self, message: Message) -> None:
        kind, by = message.get_msgId(), message.get_srcSystem()
        is_actuators = kind in (FS_ACTUATORS_ID, HIL_ACTUATOR_CONTROLS_ID)
        if is_actuators and self._is_answered():
            self.stale += 1
        elif kind == FS_ACTUATORS_ID:  # signed or truncated
            self.actuators.rotor_speed_rad_s[:] = message.rotor_speed_rad_s
            self.actuators.set_rotor_count(message.rotor_count)
            self.actuators.seal(message.time_us, message.flags)
            self._on_actuators()
        elif kind == HIL_ACTUATOR_CONTROLS_ID:
            self._controls.write(message, self.actuators)
            self._on_actuators()
        elif kind == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self.peer_ended = message.system_status == mavlink.MAV_STATE_POWEROFF
        elif kind in (mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_COMMAND_INT):
            result = self._handle_command(message)
            self._replies.append(
                self._link.encode(
                    mavlink.MAVLink_command_ack_message(
                        message.command, result, 0, 0, by, message.get_srcComponent()
                    )
                )
            )

    def _handle_command(self, message: Any) -> int:
        """Execute SET_MESSAGE_INTERVAL or INJECT_FAILURE; return the MAV_RESULT of any command."""
        if message.command == _INJECT_FAILURE:
            return inject_failure(self.simulator, message.param1, message.param2, message.param3)
        if message.command != _SET_INTERVAL:
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return self._set_interval(message.param1, message.param2)

    def _set_interval(self, kind: float, interval: float) -> int:
        if kind not in (FS_PLANT_STATE_ID, HIL_STATE_QUATERNION_ID, HIL_SENSOR_ID):
            return _DENIED
        if kind == HIL_STATE_QUATERNION_ID and self._requested == FS_PLANT_STATE_ID:
            return _DENIED  # one state message at a time: the precise one has priority
        if interval == -1.0:  # MAVLink: stop
            self._stop(int(kind))
            return _ACCEPTED
        if interval == 0.0:  # MAVLink: the default rate
            interval = DEFAULT_INTERVAL_US
        if not math.isfinite(interval) or not SHORTEST_INTERVAL_US <= round(interval) <= LONGEST_INTERVAL_US:
            return _DENIED
        if kind == HIL_SENSOR_ID and not self.simulator.vehicle.sensors.numbers:
            return _DENIED
        self.simulator.set_interval_us(round(interval))
        if kind == HIL_SENSOR_ID:
            self._wants_sensors = True
        else:
            self._requested = int(kind)
        self._start_sensors()
        if kind == HIL_STATE_QUATERNION_ID and self._sends_sensors and not self.ready:
            self.freewheels = True
        self.ready = True
        return _ACCEPTED

    def _start_sensors(self) -> None:
        """Begin or end to send the sensors, as requested."""
        needs_sensors = self._wants_sensors or self._requested == HIL_STATE_QUATERNION_ID
        self._sends_sensors = needs_sensors and self.simulator.start_sensors(self._home)
        if not needs_sensors:
            self.simulator.stop_sensors()

    def _stop(self, kind: int) -> None:
        """Stop sending a message."""
        if kind == HIL_SENSOR_ID:
            self._wants_sensors = False
        else:
            self._requested = 0
        self._start_sensors()
        self.ready = bool(self._requested) or self._sends_sensors
