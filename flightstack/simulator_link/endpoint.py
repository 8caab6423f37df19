"""The flight stack's end of the simulator link, without I/O.

A simulator is asked for FS_PLANT_STATE (exact, one frame each way per step) and, if it does not know that, for
HIL_STATE_QUATERNION, as PX4 asks; whichever arrives is answered in kind.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import MAX_ROTORS, STATE_SIZE, FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.frames import FrameFinder
from flightstack.mavlink.link import Link, Message
from flightstack.params.vehicle import Vehicle, system_type
from flightstack.simulator_link.battery_frame import UNUSED_CELL, BatteryReport, decode_battery, report_of
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG, ActuatorsFrame, PlantStateFrame
from flightstack.simulator_link.state_steps import StateSteps

HIL_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
HIL_DISARMED = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
HIL_LOCKSTEP = 1


LONGEST_STEP_US = 2_000_000
"""Largest step between two states' times that the vehicle's clock follows: twice that of the slowest loops."""


class Battery(NamedTuple):
    """The battery as the simulator last reported it; what it does not know is NaN."""

    voltage_v: float = math.nan
    current_a: float = math.nan
    remaining: float = math.nan  # share of the charge, 0 to 1
    time_us: int = 0  # vehicle time of the state that it came with
    valid: bool = False  # a charge was ever reported


NO_BATTERY = Battery()


class Freshness(NamedTuple):
    """How old the newest state is, in the vehicle's time."""

    age_us: int  # since it arrived
    frozen_us: (
        int  # since any of its numbers changed in any bit; while the vehicle stands that is nothing odd
    )


NEW_STATE = Freshness(0, 0)


class SimulatorEndpoint:
    """Takes the simulator's bytes, keeps the newest state, and makes the answer to it.

    ``state`` (13,) and ``rotor_speed_rad_s`` (8,) are the same arrays for the link's whole life.

    ``time_us`` is the simulated time since the vehicle booted: the first state, whatever its time, is at 0, and
    the steps between the states' times are followed. A step back, or one longer than ``LONGEST_STEP_US`` (a
    simulator that started anew, or nonsense), is counted in ``time_jumps``; the state is taken, and the clock
    stands still for that step. ``steps`` watches those that are not the loops' own, ``interval_us``.
    """

    def __init__(
        self, vehicle: Vehicle, home: GeoPoint, lockstep: bool, system_id: int = 1, interval_us: int = 2000
    ) -> None:
        self._link = Link(system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._plant = PlantStateFrame()
        self._actuators = ActuatorsFrame(system_id)
        self._actuators.set_rotor_count(len(vehicle.rotors))
        self._system_type = system_type(len(vehicle.rotors))
        self._frame = LocalFrame(home)
        self._top_speed = np.array([min(r.max_speed_rad_s, 1e6) for r in vehicle.rotors])
        self._lockstep = LOCKSTEP_FLAG if lockstep else 0
        self._speaks_hil = False
        self.state: FloatArray = self._plant.state
        self.state[6] = 1.0
        self.rotor_speed_rad_s = self._plant.rotor_speed_rad_s
        self.time_us = 0
        self.time_jumps = 0
        self.steps = StateSteps(interval_us)
        self._interval_us = interval_us
        self.battery = NO_BATTERY
        self.finder = FrameFinder()
        """Cuts what is received into frames."""
        self._state_us = 0  # the newest state's own time
        self.has_arrived = False
        """Whether a state of a new time has come since ``freshness`` was last asked for."""
        self._arrived_us = 0
        self._changed_us = 0
        self._seen = b""
        self.has_state = False
        self.request_refused = False
        self._requests: list[bytes] = []
        self._failure_result: int | None = None
        self.peer_is_shutting_down = False

    def resume(self, other: SimulatorEndpoint) -> None:
        """Go on where another link of the same connection was, after a reboot."""
        self.state[:] = other.state
        self.rotor_speed_rad_s[:] = other.rotor_speed_rad_s
        self._state_us = other._state_us  # its clock begins anew
        self.battery, self.has_state, self._speaks_hil = other.battery, other.has_state, other._speaks_hil

    def initial_requests(self, interval_us: int) -> bytes:
        """Return the bytes to send after connecting: who we are, and our own state message every so often."""
        return self.heartbeat(False) + self._request(FS_PLANT_STATE_ID, interval_us)

    def fallback_request(self, interval_us: int) -> bytes:
        """Return the request to a simulator that does not know our message: PX4's."""
        return self._request(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, interval_us)

    def _request(self, message_id: int, interval_us: int) -> bytes:
        request = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return self._link.encode(
            mavlink.MAVLink_command_long_message(0, 0, request, 0, message_id, interval_us, 0, 0, 0, 0, 0)
        )

    def heartbeat(self, armed: bool, leaving: bool = False) -> bytes:
        """Return a heartbeat; ``leaving`` announces an orderly end."""
        return self._link.encode(
            mavlink.MAVLink_heartbeat_message(
                self._system_type,
                mavlink.MAV_AUTOPILOT_PX4,
                HIL_ARMED if armed else HIL_DISARMED,
                0,
                mavlink.MAV_STATE_POWEROFF if leaving else mavlink.MAV_STATE_ACTIVE,
                3,
            )
        )

    def receive(self, data: memoryview) -> bool:
        """Take bytes from the simulator; tell whether a new state arrived.

        A whole state is taken at once, whatever came before it: that can only be junk.
        """
        if self._plant.open(data):
            self._take_time(self._plant.time_us)
            self._speaks_hil = False
            return True
        return self._receive_with_battery(data) or self._receive_any(data)

    def _receive_with_battery(self, data: memoryview) -> bool:
        """Take a battery's report and the state right behind it, as the simulator sends them; else nothing."""
        split = len(data) - self._plant.size
        if (
            split <= 0
            or (report := decode_battery(data[:split])) is None
            or not self._plant.open(data[split:])
        ):
            return False
        self._take_time(self._plant.time_us)
        self._speaks_hil = False
        self._take_battery(report)
        return True

    def _receive_any(self, data: memoryview) -> bool:
        fresh = False
        battery: BatteryReport | None = None
        for frame in self.finder.find(data):
            if self._plant.open(frame):
                self._take_time(self._plant.time_us)
                self._speaks_hil = False
                fresh = True
                continue
            for message in self._link.decode(frame):
                kind = message.get_msgId()
                if kind == FS_PLANT_STATE_ID:
                    self._take_plant_state(message)
                    fresh = True
                elif kind == mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION:
                    self._take_hil(message)
                    fresh = True
                elif kind == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS:
                    battery = report_of(message)
                else:
                    self._take_other(message)
        if battery is not None:
            self._take_battery(battery)  # last: it has the time of the state that came with it
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
        step_us = state_us - self._state_us
        self._state_us = state_us
        if step_us == self._interval_us and self.has_state:  # the usual
            self.time_us += step_us
            self.has_arrived = True
        elif not self.has_state:  # the vehicle boots
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
        """Why the vehicle must not arm with the simulator's steps; empty if it may."""
        return self.steps.refusal(self.time_us)

    def freshness(self, now_us: int) -> Freshness:
        """Tell how old the newest state is at ``now_us``, the time of this tick; to be asked for in regular ticks.

        In lockstep a state can be frozen but never old.
        """
        if self.has_arrived:
            self.has_arrived = False
            self._arrived_us = now_us
            content = self.state.tobytes()
            if content != self._seen:
                self._seen = content
                self._changed_us = now_us
                return NEW_STATE
        frozen_us = (
            0 if self._speaks_hil else now_us - self._changed_us
        )  # its coarse numbers may well stay the same
        return Freshness(now_us - self._arrived_us, frozen_us)

    def _take_battery(self, report: BatteryReport) -> None:
        """Take the report of the first battery; −1 and unused cells mean unknown."""
        if report.number != 0:
            return
        cells_mv = [cell for cell in report.cells_mv if cell != UNUSED_CELL]
        self.battery = Battery(
            sum(cells_mv) * 1e-3 if any(cells_mv) else math.nan,
            report.current_ca * 0.01 if report.current_ca >= 0 else math.nan,
            min(report.remaining_percent, 100) * 0.01 if report.remaining_percent >= 0 else math.nan,
            self.time_us,
            report.remaining_percent >= 0,
        )

    def ask_for_failure(self, unit: int, failure: int, instance: int) -> None:
        """Put a request for a failure among those that ``take_requests`` returns."""
        self._failure_result = None
        self._requests.append(self.failure_request(unit, failure, instance))

    def take_failure_result(self) -> int | None:
        """Return the simulator's MAV_RESULT of the newest request, once; None while there is none."""
        result, self._failure_result = self._failure_result, None
        return result

    def take_requests(self) -> bytes:
        """Return the bytes that the simulator is to get besides its answers, once."""
        if not self._requests:
            return b""
        requests, self._requests = b"".join(self._requests), []
        return requests

    def failure_request(self, unit: int, failure: int, instance: int) -> bytes:
        """Return the bytes that ask the simulator for a failure: MAV_CMD_INJECT_FAILURE with its values."""
        number = mavlink.MAV_CMD_INJECT_FAILURE
        return self._link.encode(
            mavlink.MAVLink_command_long_message(0, 0, number, 0, unit, failure, instance, 0, 0, 0, 0)
        )

    def _take_plant_state(self, m: Message) -> None:
        """Take a frame that the general decoder read: it may be signed, or cut where its payload ends in zeros."""
        self._speaks_hil = False
        self.state[:] = (*m.position_ned_m, *m.velocity_ned_m_s, *m.q, *m.rates_frd_rad_s)
        self.rotor_speed_rad_s[:] = m.rotor_speed_rad_s
        self._take_time(m.time_us)

    def _take_hil(self, m: Message) -> None:
        self._speaks_hil = True
        position = self._frame.to_ned(GeoPoint(m.lat / 1e7, m.lon / 1e7, m.alt / 1e3))
        velocity = (m.vx / 100.0, m.vy / 100.0, m.vz / 100.0)
        rates = (m.rollspeed, m.pitchspeed, m.yawspeed)
        self.state[:STATE_SIZE] = (*position, *velocity, *m.attitude_quaternion, *rates)
        self._take_time(m.time_usec)

    def answer(self, rotor_speed_rad_s: FloatArray, armed: bool) -> bytes | memoryview:
        """Return the answer to the newest state: rotor speeds (8,), commanded."""
        if self._speaks_hil:
            return self._hil_answer(rotor_speed_rad_s, armed)
        self._actuators.rotor_speed_rad_s[:] = rotor_speed_rad_s
        return self._actuators.seal(self._state_us, self._lockstep | (ARMED_FLAG if armed else 0))

    def _hil_answer(self, rotor_speed_rad_s: FloatArray, armed: bool) -> bytes:
        count = self._top_speed.size
        shares = np.clip(rotor_speed_rad_s[:count] / self._top_speed, 0.0, 1.0).tolist()
        controls = [share * share if math.isfinite(share) else 0.0 for share in shares]
        controls += [0.0] * (16 - count)
        if not armed:
            controls = [0.0] * 16
        return self._link.encode(
            mavlink.MAVLink_hil_actuator_controls_message(
                self._state_us,
                controls,
                HIL_ARMED if armed else HIL_DISARMED,
                HIL_LOCKSTEP if self._lockstep else 0,
            )
        )


assert MAX_ROTORS <= 16
