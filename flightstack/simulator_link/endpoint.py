"""Endpoint of the simulator link in the flight stack, without I/O.

It requests FS_PLANT_STATE (full precision, one frame each way per step), or PX4's HIL_STATE_QUATERNION from simulators
that do not support it, and answers with FS_ACTUATORS or HIL_ACTUATOR_CONTROLS accordingly.

A vehicle that flies on its sensors requests HIL_SENSOR as well, and takes its time from it, as PX4 does. It needs no
state: a simulator that speaks PX4's contract alone is answered with HIL_ACTUATOR_CONTROLS.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import MAX_ROTORS, STATE_SIZE, FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER_V2, MAGIC_V2, FrameFinder
from flightstack.mavlink.link import Link, Message
from flightstack.params.vehicle import Vehicle, system_type
from flightstack.simulator_link.battery_frame import BatteryReport, decode_battery, report_of
from flightstack.simulator_link.battery_kernels import UNUSED_CELL
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG, ActuatorsFrame, PlantStateFrame
from flightstack.simulator_link.sensor_frames import HIL_SENSOR_ID, HilMeasurement
from flightstack.simulator_link.sensor_inbox import SensorInbox
from flightstack.simulator_link.state_steps import StateSteps

HIL_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
HIL_DISARMED = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
HIL_LOCKSTEP = 1
LONGEST_STEP_US = 2_000_000
"""Longest step between states that the vehicle's clock follows: twice that of the slowest loops."""


class Battery(NamedTuple):
    """Last battery report of the simulator; unknown values are NaN."""

    voltage_v: float = math.nan
    current_a: float = math.nan
    remaining: float = math.nan  # state of charge, 0 to 1
    time_us: int = 0  # vehicle time of the state received with it
    valid: bool = False  # a state of charge was reported


NO_BATTERY = Battery()


class Freshness(NamedTuple):
    """Age of the newest state in vehicle time."""

    age_us: int  # since it arrived
    frozen_us: int  # since any of its values changed; normal while the vehicle stands


NEW_STATE = Freshness(0, 0)


class SimulatorEndpoint:
    """Decodes states from the simulator and encodes the answers.

    ``state`` (13,) and ``rotor_speed_rad_s`` (8,) are updated in place. With ``uses_sensors`` the estimator writes
    ``state``, and ``truth`` is the simulator's.

    ``time_us`` is the simulated time since boot: 0 at the first state, then advanced by the steps between states. A
    step back, or one longer than ``LONGEST_STEP_US`` (such as after a simulator restart), is counted in ``time_jumps``:
    the state is used, but the time does not advance. ``steps`` monitors steps that differ from ``interval_us``.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        home: GeoPoint,
        lockstep: bool,
        system_id: int = 1,
        interval_us: int = 2000,
        uses_sensors: bool = False,
    ) -> None:
        self._link = Link(system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self.plant = PlantStateFrame()
        """The newest FS_PLANT_STATE."""
        self.actuators = ActuatorsFrame(system_id)
        """The newest answer, and the commands of the next one."""
        self.actuators.set_rotor_count(len(vehicle.rotors))
        self._system_type = system_type(len(vehicle.rotors))
        self._frame = LocalFrame(home)
        self._max_speed_rad_s = np.array([min(r.max_speed_rad_s, 1e6) for r in vehicle.rotors])
        self._lockstep = LOCKSTEP_FLAG if lockstep else 0
        self.sensors = SensorInbox() if uses_sensors else None
        """Messages of the sensors, of a vehicle that flies on them."""
        self._uses_hil = uses_sensors  # until the simulator sends FS_PLANT_STATE
        self._has_hil_state = False  # a HIL_STATE_QUATERNION arrived
        self.truth: FloatArray = self.plant.state
        """True state, shape (13,)."""
        self.truth[6] = 1.0
        self.state: FloatArray = self.truth.copy() if uses_sensors else self.truth
        self.rotor_speed_rad_s = self.plant.rotor_speed_rad_s
        self.time_us = 0
        self.time_jumps = 0
        self.steps = StateSteps(interval_us)
        self._interval_us = interval_us
        self.battery = NO_BATTERY
        self.finder = FrameFinder()
        """Frame parser of received bytes."""
        self.stamp_us = 0  # time stamp of the newest state
        self.has_arrived = False
        """True if a state with a new time arrived since the last call of ``freshness``."""
        self._arrived_us = 0
        self._changed_us = 0
        self.seen = b""
        """Bytes of the state at the last call of ``freshness``."""
        self.has_state = False
        self.request_refused = False
        self._requests: list[bytes] = []
        self._failure_result: int | None = None
        self.peer_is_shutting_down = False

    def resume(self, other: SimulatorEndpoint) -> None:
        """Continue the connection of another endpoint after a reboot."""
        self.state[:], self.truth[:] = other.state, other.truth
        self.rotor_speed_rad_s[:] = other.rotor_speed_rad_s
        self.stamp_us = other.stamp_us  # the vehicle clock restarts
        self.battery, self.has_state, self._uses_hil = other.battery, other.has_state, other._uses_hil
        self._has_hil_state = other._has_hil_state

    def known_truth(self) -> FloatArray | None:
        """Return the true state of a vehicle on sensors, shape (13,); None if the simulator did not send it yet."""
        return None if self._uses_hil and not self._has_hil_state else self.truth

    def initial_requests(self, interval_us: int) -> bytes:
        """Return the messages to send after connecting: a heartbeat and requests for FS_PLANT_STATE and sensors."""
        sensors = b"" if self.sensors is None else self._request(HIL_SENSOR_ID, interval_us)
        return self.heartbeat(False) + self._request(FS_PLANT_STATE_ID, interval_us) + sensors

    def fallback_request(self, interval_us: int) -> bytes:
        """Return the request for PX4's HIL_STATE_QUATERNION."""
        return self._request(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, interval_us)

    def _request(self, message_id: int, interval_us: int) -> bytes:
        request = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return self._link.encode(
            mavlink.MAVLink_command_long_message(0, 0, request, 0, message_id, interval_us, 0, 0, 0, 0, 0)
        )

    def heartbeat(self, armed: bool, leaving: bool = False) -> bytes:
        """Return a heartbeat; ``leaving`` announces a shutdown."""
        mode = HIL_ARMED if armed else HIL_DISARMED
        state = mavlink.MAV_STATE_POWEROFF if leaving else mavlink.MAV_STATE_ACTIVE
        kind = self._system_type, mavlink.MAV_AUTOPILOT_PX4
        return self._link.encode(mavlink.MAVLink_heartbeat_message(*kind, mode, 0, state, 3))

    def receive(self, data: memoryview) -> bool:
        """Process received bytes; return True if they held a new state.

        A complete state frame is used at once: incomplete bytes before it are discarded.
        """
        if self.sensors is not None:
            return self._receive_sensors(data, self.sensors)
        if self.plant.open(data):
            self._take_time(self.plant.time_us)
            self._uses_hil = False
            return True
        return self._receive_with_battery(data) or self._receive_any(data)

    def is_quiet(self, time_us: int) -> bool:
        """Return True if the newest state is that of ``time_us``, and nothing else of the simulator is pending."""
        is_plain = self.has_state and not (self._uses_hil or self.finder.partial_size)
        return is_plain and self.time_us == time_us

    @property
    def answers_exactly(self) -> bool:
        """True if the answers are FS_ACTUATORS."""
        return not self._uses_hil

    def take(self, time_us: int, frame: PlantStateFrame, sensors: Sequence[HilMeasurement]) -> None:
        """Take what ``receive`` would decode of the bytes of a simulator in this process; ``frame`` is not sealed."""
        self.plant.frame[:] = frame.frame
        if self.sensors is None:
            self._take_time(time_us)
        elif sensors:
            self.sensors.take_measurements(time_us, sensors)
            self._take_clock(self.sensors)

    def pass_by(self, count: int) -> None:
        """Count states, which were written to ``frame`` one interval after another, as taken."""
        self.stamp_us += count * self._interval_us
        self.time_us += count * self._interval_us
        self.has_arrived = True

    def pass_outer(self, time_us: int, seen: bytes, changed_us: int) -> None:
        """Count calls of ``freshness`` up to ``time_us``, of which the last new state had the bytes ``seen``.

        It came at ``changed_us``; 0 if there was none.
        """
        self.has_arrived, self.seen = False, seen
        self._arrived_us, self._changed_us = time_us, changed_us or self._changed_us

    def flags(self, armed: bool) -> int:
        """Return the flags of an answer with FS_ACTUATORS."""
        return self._lockstep | (ARMED_FLAG if armed else 0)

    def _receive_with_battery(self, data: memoryview) -> bool:
        """Process a battery report directly followed by a state; return False and do nothing for anything else."""
        split = len(data) - self.plant.size
        if (
            split <= 0
            or (report := decode_battery(data[:split])) is None
            or not self.plant.open(data[split:])
        ):
            return False
        self._take_time(self.plant.time_us)
        self._uses_hil = False
        self.take_battery(report, self.time_us)
        return True

    def _receive_sensors(self, data: memoryview, sensors: SensorInbox) -> bool:
        """Process the frames of an exchange one after another, and anything else with the general decoder."""
        fresh, at, end, battery = False, 0, len(data), None
        while not self.finder.partial_size and end - at > HEADER_V2 and data[at] == MAGIC_V2:
            size = HEADER_V2 + data[at + 1] + CHECKSUM_SIZE
            frame = data[at : at + size]
            if self.plant.open(frame):
                self._uses_hil = False
            elif (is_clock := sensors.open(frame)) is None:
                if (report := decode_battery(frame)) is None:
                    break
                battery = report
            elif is_clock:
                self._take_clock(sensors)
                fresh = True
            at += size
        if at < end:
            fresh = self._receive_any(data[at:]) or fresh
        if battery is not None:
            self.take_battery(battery, self.time_us)
        return fresh

    def _take_clock(self, sensors: SensorInbox) -> None:
        self._take_time(sensors.clock_us)
        sensors.stamp(self.time_us)

    def _receive_any(self, data: memoryview) -> bool:
        fresh = False
        battery: BatteryReport | None = None
        for frame in self.finder.find(data):
            if self.plant.open(frame):
                self._uses_hil = False
                if self.sensors is None:
                    self._take_time(self.plant.time_us)
                    fresh = True
                continue
            for message in self._link.decode(frame):
                kind = message.get_msgId()
                if kind == FS_PLANT_STATE_ID:
                    self._take_plant_state(message)
                    fresh = fresh or self.sensors is None
                elif kind == mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION:
                    self._take_hil(message)
                    fresh = fresh or self.sensors is None
                elif self.sensors is not None and self.sensors.take_message(message):
                    self._take_clock(self.sensors)
                    fresh = True
                elif kind == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS:
                    battery = report_of(message)
                else:
                    self._take_other(message)
        if battery is not None:
            self.take_battery(battery, self.time_us)  # last: it gets the time of the state received with it
        return fresh

    def _take_other(self, message: Message) -> None:
        kind = message.get_msgId()
        if kind == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
            if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                self.request_refused = message.result != mavlink.MAV_RESULT_ACCEPTED
            elif message.command == mavlink.MAV_CMD_INJECT_FAILURE:
                self._failure_result = int(message.result)
        elif kind == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self.peer_is_shutting_down = message.system_status == mavlink.MAV_STATE_POWEROFF

    def _take_time(self, state_us: int) -> None:
        step_us = state_us - self.stamp_us
        self.stamp_us = state_us
        if step_us == self._interval_us and self.has_state:  # typical
            self.time_us += step_us
            self.has_arrived = True
        elif not self.has_state:  # boot
            self.has_state = self.has_arrived = True
        elif 0 < step_us <= LONGEST_STEP_US:
            self.time_us += step_us
            self.has_arrived = True
            self.steps.differs(step_us, self.time_us)
        elif step_us:
            self.time_jumps += 1
            self.steps.jumps(step_us, self.time_us)

    @property
    def step_refusal(self) -> str:
        """Reason that the simulator's steps prevent arming; empty if they do not."""
        return self.steps.refusal(self.time_us)

    def freshness(self, now_us: int) -> Freshness:
        """Return the age of the newest state at ``now_us``; call in every tick.

        In lockstep a state can be frozen but not old.
        """
        if self.has_arrived:
            self.has_arrived = False
            self._arrived_us = now_us
            content = self.state.tobytes()
            if content != self.seen:
                self.seen = content
                self._changed_us = now_us
                return NEW_STATE
        frozen_us = 0 if self._uses_hil else now_us - self._changed_us  # coarse HIL values may stay the same
        return Freshness(now_us - self._arrived_us, frozen_us)

    def take_battery(self, report: BatteryReport, time_us: int) -> None:
        """Store the report of the first battery at ``time_us``; −1 and unused cells mean unknown."""
        if report.number != 0:
            return
        cells_mv = [cell for cell in report.cells_mv if cell != UNUSED_CELL]
        self.battery = Battery(
            sum(cells_mv) * 1e-3 if any(cells_mv) else math.nan,
            report.current_ca * 0.01 if report.current_ca >= 0 else math.nan,
            min(report.remaining_percent, 100) * 0.01 if report.remaining_percent >= 0 else math.nan,
            time_us,
            report.remaining_percent >= 0,
        )

    def ask_for_failure(self, unit: int, failure: int, instance: int) -> None:
        """Queue a failure injection request for ``take_requests``."""
        self._failure_result = None
        self._requests.append(self.failure_request(unit, failure, instance))

    def take_failure_result(self) -> int | None:
        """Return the simulator's MAV_RESULT of the newest request and clear it; None without one."""
        result, self._failure_result = self._failure_result, None
        return result

    def take_requests(self) -> bytes:
        """Return queued requests to the simulator and clear them."""
        if not self._requests:
            return b""
        requests, self._requests = b"".join(self._requests), []
        return requests

    def failure_request(self, unit: int, failure: int, instance: int) -> bytes:
        """Return the MAV_CMD_INJECT_FAILURE message for the simulator."""
        number = mavlink.MAV_CMD_INJECT_FAILURE
        return self._link.encode(
            mavlink.MAVLink_command_long_message(0, 0, number, 0, unit, failure, instance, 0, 0, 0, 0)
        )

    def _take_plant_state(self, m: Message) -> None:
        """Process a state of the general decoder: its frame may be signed or truncated."""
        self._uses_hil = False
        self.truth[:] = (*m.position_ned_m, *m.velocity_ned_m_s, *m.q, *m.rates_frd_rad_s)
        self.rotor_speed_rad_s[:] = m.rotor_speed_rad_s
        if self.sensors is None:
            self._take_time(m.time_us)

    def _take_hil(self, m: Message) -> None:
        self._uses_hil = True if self.sensors is None else self._uses_hil
        self._has_hil_state = True
        position = self._frame.to_ned(GeoPoint(m.lat / 1e7, m.lon / 1e7, m.alt / 1e3))
        velocity = (m.vx / 100.0, m.vy / 100.0, m.vz / 100.0)
        rates = (m.rollspeed, m.pitchspeed, m.yawspeed)
        self.truth[:STATE_SIZE] = (*position, *velocity, *m.attitude_quaternion, *rates)
        if self.sensors is None:
            self._take_time(m.time_usec)

    def answer(self, rotor_speed_rad_s: FloatArray, armed: bool) -> bytes | memoryview:
        """Return the answer to the newest state with commanded rotor speeds (8,)."""
        if self._uses_hil:
            return self._hil_answer(rotor_speed_rad_s, armed)
        self.actuators.rotor_speed_rad_s[:] = rotor_speed_rad_s
        return self.actuators.seal(self.stamp_us, self.flags(armed))

    def _hil_answer(self, rotor_speed_rad_s: FloatArray, armed: bool) -> bytes:
        count = self._max_speed_rad_s.size
        shares = np.clip(rotor_speed_rad_s[:count] / self._max_speed_rad_s, 0.0, 1.0).tolist()
        controls = [share * share if math.isfinite(share) else 0.0 for share in shares]
        controls += [0.0] * (16 - count)
        if not armed:
            controls = [0.0] * 16
        return self._link.encode(
            mavlink.MAVLink_hil_actuator_controls_message(
                self.stamp_us,
                controls,
                HIL_ARMED if armed else HIL_DISARMED,
                HIL_LOCKSTEP if self._lockstep else 0,
            )
        )


assert MAX_ROTORS <= 16
